"""Values of definitions at given numbers, in Python: for checks at the door, not for kernels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import isfinite, nan
from typing import Any

from piazzi.expressions import evaluate, evaluate_arrays
from piazzi.model.definitions import TIME, Definition, Definitions, needed
from piazzi.model.functions import AT, ROOT

MOST_ITERATIONS = 50
SHORT = 1.0  # s


def with_values(
    values: Mapping[str, float], *layers: Definitions, functions: Mapping[str, Any] | None = None, model: Any = None
) -> dict[str, float]:
    """The values with those of the definitions beside them; a definition whose own names have no value is left out.

    `functions` are those from outside, by name, each with its `value(*arguments)`; `model` is for the state at another instant.
    """
    out = dict(values)
    for layer in layers:
        for d in layer:
            if d.needs <= out.keys():
                _define(d, out, functions or {}, model)
    return out


def with_arrays(
    values: Mapping[str, Any],
    wanted: Collection[str],
    *layers: Definitions,
    functions: Mapping[str, Any] | None = None,
    model: Any = None,
) -> dict[str, Any]:
    """As `with_values`, of arrays of numbers that go together, for the definitions that are wanted.

    A function that has `arrays` is asked for all rows at once.
    """
    import numpy as np

    out = dict(values)
    for d in (d for layer in layers for d in layer if set(d.provides) & set(wanted)):
        if d.function in (ROOT, AT):
            out.update(_one_by_one(d, out, functions or {}, model))
            continue
        arguments = [evaluate_arrays(text, out) for text in d.texts]
        if d.function:
            shape = np.broadcast_shapes(*map(np.shape, arguments))
            rows = [np.broadcast_to(a, shape).reshape(-1) for a in arguments]
            function = (functions or {})[d.function]
            found = (
                function.arrays(*rows)
                if hasattr(function, "arrays")
                else np.array([function.value(*row) for row in zip(*(a.tolist() for a in rows), strict=True)], dtype=float)
            )
            out.update((name, found[:, i].reshape(shape)) for i, name in enumerate(d.names))
        else:
            out[d.names[0]] = arguments[0]
    return out


def _one_by_one(d: Definition, known: Mapping[str, Any], functions: Mapping[str, Any], model: Any) -> dict[str, Any]:
    """Values of a root, or of the state at another instant, for each row of numbers that go together."""
    import numpy as np

    names, shape = list(known), np.broadcast_shapes(*map(np.shape, known.values()))
    rows = zip(*(np.broadcast_to(known[name], shape).reshape(-1).tolist() for name in names), strict=True)
    found: list[list[float]] = []
    for row in rows:
        here = dict(zip(names, row, strict=True))
        _define(d, here, functions, model)
        found.append([here[name] for name in d.provides])
    return {name: np.reshape(column, shape) for name, column in zip(d.provides, zip(*found, strict=True), strict=True)}


def _define(d: Definition, out: dict[str, float], functions: Mapping[str, Any], model: Any) -> None:
    if not d.function:
        out[d.names[0]] = evaluate(d.texts[0], out)
    elif d.function == ROOT:
        _solve(d, out, functions, model)
    elif d.function == AT:
        offset = evaluate(d.texts[0], out)
        there = _nearby if len(d.texts) > 1 else _elsewhen
        out.update(zip(d.names, there(out, offset, functions, model), strict=False))
    elif d.function in functions:
        arguments = [evaluate(text, out) for text in d.texts]
        try:
            values = functions[d.function].value(*arguments)
        except ValueError as error:
            raise ValueError(f"{d.text}: {error}") from None
        out.update(zip(d.names, map(float, values), strict=False))


def _solve(d: Definition, out: dict[str, float], functions: Mapping[str, Any], model: Any) -> None:
    """A root by Newton's method, with differences for slopes; NaN where that does not arrive."""
    name, (equation, start) = d.names[0], d.texts

    def residual(tau: float) -> float:
        out[name] = tau
        for inner in d.inner:
            _define(inner, out, functions, model)
        return evaluate(equation, out)

    tau = evaluate(start, out)
    for _ in range(MOST_ITERATIONS):
        g = residual(tau)
        if g == 0.0:
            return
        h = 1e-5 * (abs(tau) or abs(g))
        rise = residual(tau + h) - residual(tau - h)
        if not isfinite(g) or not isfinite(rise) or rise == 0.0:
            break
        before, tau = tau, tau - 2.0 * h * g / rise
        if abs(tau - before) <= 1e-12 * abs(tau):
            residual(tau)
            return
    residual(nan)


def _rates(values: Mapping[str, float], functions: Mapping[str, Any], model: Any) -> list[float]:
    """dx/dt at the states and the time among the values; definitions that have a value there keep it."""
    here = dict(values)
    wanted = needed(model.dynamics, model.definitions)
    for d in model.definitions:
        if set(d.provides) & wanted and not here.keys() >= set(d.provides):
            _define(d, here, functions, model)
    return [evaluate(e, here) for e in model.dynamics]


def _nearby(values: Mapping[str, float], offset: float, functions: Mapping[str, Any], model: Any) -> Sequence[float]:
    """States at t + offset to second order: a state whose rate is a state too has the rate of that."""
    rates = dict(zip(model.states, _rates(values, functions, model), strict=True))
    second = {s: rates.get(text, 0.0) for s, text in zip(model.states, model.dynamics, strict=True)}
    return [values[s] + offset * (rates[s] + offset / 2 * second[s]) for s in model.states]


def _elsewhen(values: Mapping[str, float], offset: float, functions: Mapping[str, Any], model: Any) -> Sequence[float]:
    """States at t + offset by a few steps of the classical Runge-Kutta method, a light time by one."""
    states, steps = model.states, 4 if abs(offset) > SHORT else 1
    here = {name for d in model.definitions for name in d.provides}  # which are other ones there
    given = {name: value for name, value in values.items() if name not in here}
    x, t, h = [values[s] for s in states], values.get(TIME, 0.0), offset / steps

    def rates(x: Sequence[float], t: float) -> list[float]:
        return _rates({**given, **dict(zip(states, x, strict=True)), TIME: t}, functions, model)

    for i in range(steps):
        now = t + i * h
        k1 = rates(x, now)
        k2 = rates([a + h / 2 * k for a, k in zip(x, k1, strict=True)], now + h / 2)
        k3 = rates([a + h / 2 * k for a, k in zip(x, k2, strict=True)], now + h / 2)
        k4 = rates([a + h * k for a, k in zip(x, k3, strict=True)], now + h)
        x = [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True)]
    return x
