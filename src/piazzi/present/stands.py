"""Where stations stand, in the axes that positions are in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from piazzi.model import Model
from piazzi.problem import Gaussian, Problem, Station, Tracking
from piazzi.problem.checks import Array


def stands(problem: Problem, tracking: Tracking) -> dict[str, Array]:
    """By name the places of stations in position: (1, d) of those that stand still, at their measurements of those that move.

    A station stands where its table says, or at the numbers of its own that its sensor takes off the position: those with which
    the equations stay the same when both are moved alike.  Others are left out; of several at one place the first is there.
    """
    columns = problem.model.group_indices.get("position", ())[:3]
    index = tracking.stations_of(problem)
    found: dict[str, Array] = {}
    for s, station in enumerate(problem.stations):
        place = _place(problem, station, columns, tracking.row_times[index == s])
        if place is not None and not any(np.array_equal(place, other) for other in found.values()):
            found[station.name] = place
    return _merged(found)


def _merged(found: Mapping[str, Array]) -> dict[str, Array]:
    """Without those that move through places of another: several sensors of one site."""
    seen: set[bytes] = set()
    out = {}
    for name, place in found.items():
        new = np.array([row.tobytes() not in seen for row in place])
        if new.any():
            out[name] = place[new]
            seen |= {row.tobytes() for row in place}
    return out


def _place(problem: Problem, station: Station, columns: Sequence[int], times: Array) -> Array | None:
    if station.place is not None:
        if len(columns) < 3 or not len(times):
            return None
        return np.array([station.place.value(float(t))[:3] for t in np.unique(times)])
    numbers = _numbers_of_place(problem.model, station.sensor, tuple(problem.model.names[c] for c in columns))
    if not numbers or not all(name in station.numbers for name in numbers):
        return None
    values = [station.numbers[name] for name in numbers]
    return np.array([[v.mean[0] if isinstance(v, Gaussian) else float(v) for v in values]])


@lru_cache(maxsize=32)
def _numbers_of_place(model: Model, name: str, position: tuple[str, ...]) -> tuple[str, ...]:
    """For each component of position the number of a sensor that is taken off it; () unless each has one."""
    sensor = model.sensor(name)
    own = sorted({n for n, _ in sensor.number_units} | _own_names(model, name))
    if len(position) < 2 or len(own) < len(position) or sensor.definitions or sensor.calls:
        return ()
    from sympy import Dummy, Symbol

    from piazzi.expressions import to_sympy

    symbols = {n: Symbol(n, real=True) for n in (*model.names, *model.parameter_names, *own, "t")}
    equations = [to_sympy(text, symbols) for text in sensor.equations]

    def goes_with(state: str, number: str) -> bool:
        by = Dummy(real=True)
        x, n = symbols[state], symbols[number]
        moved = [e.subs({x: x + by, n: n + by}, simultaneous=True) for e in equations]
        return any(e.has(n) for e in equations) and moved == equations

    found = [next((n for n in own if goes_with(state, n)), None) for state in position]
    return tuple(n for n in found if n is not None) if None not in found else ()


def _own_names(model: Model, name: str) -> set[str]:
    return set(model.sensor(name).free_names) - {*model.names, *model.parameter_names, "t"}
