"""A model's equations -> the source of its functions, specialised for its sizes.  Needs SymPy; runs when nothing is cached.

Sizes: `ND` states, `N` values with the estimated constants, `M` components of the widest sensor; `MN`, `NN`, and `WORK` for
the factors of an update.  The functions:

* ``dynamics(t, x, p)``, ``rhs(t, x, R, p)``: dx/dt, and with it dR/dt = F R for the first `ND` rows of a transition matrix
* ``substep(t, h, x, p)``, ``substep_jacobian(t, h, x, R, p)``: one step of the integrator; with its derivative times R
* ``trial(t, h, x, p)``, ``orbit_axes(x)``: a step with its error; the directions of the orbit (see `steps`)
* ``remember(x)``, ``first_rows()``: the state at the start of a step, and its derivative; ``identity_rows()``
* ``complete(R)``: R with the constants' rows below it
* ``dynamics_beside(t, x, p)``, ``rhs_beside(t, x, R, p)``: of a model with events, on the sides of them that `p` says
* ``events_of(t, x, p)``, ``events_into(t, x, p, at)``, ``event_row(t, x, p, event)``, ``jumped(R, jump, row)``: see
  `_events_source`
* ``measure_into(sensor, t, x, p, s, at, out, row)``: h
* ``innovate(sensor, t, x, p, s, at, z, row, nu, H, out)``: z - h, angles wrapped and put on the sky, and H
* ``measure_row(measured, row, t, x, p, out, at)``, ``innovate_row(measured, row, t, x, p, nu, H, out)``: of a row's station
* ``measure_lanes(sensor, t, x, p, s, at, h)``, ``innovate_lanes(sensor, t, x, p, s, at, z, nu, H)``: the same of `LANES` runs
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

from piazzi.kernels.multistep import multistep_source
from piazzi.kernels.printer import call_of, function, in_time, with_used
from piazzi.kernels.quadrature import rule_source
from piazzi.kernels.sizes import ROWS, sizes_source
from piazzi.kernels.steps import adaptive_source, axes_source, kepler_source, runge_kutta_source
from piazzi.kernels.steps import inline_source as _inline
from piazzi.kernels.tableaus import DORMAND_PRINCE_8
from piazzi.kernels.tables import outside_source
from piazzi.model import Model, Sensor
from piazzi.model.derivation import constant_acceleration_step, derive, derive_events, derive_sensor

if TYPE_CHECKING:
    import sympy as sp

MOST_MODELS = 16  # whose equations are remembered as source: modules of one determination differ in the rest
SIDE = "p.sides[{}]"  # of an event, where the integrator knows it

_ITERATION = re.compile(r"^ +for _ in range\(\d+\):$", re.M)  # as printed for a root
_BRANCHING = re.compile(r"(?<![\w.])(sin|cos|tan|exp|log)\(")


def model_source(model: Model, scheme: tuple[Any, ...], lanes: int) -> str:
    """Source of the sizes, dynamics, step and sensors; `lanes` problems are worked on at once where there are that many."""
    parts = [sizes_source(model, lanes), _identity_source(model), axes_source(model)]
    parts.append(outside_source(model))
    if not model.discrete:
        parts.append(_dynamics_source(model))
    parts.append(_step_source(model, scheme))
    if model.events:
        parts.append(_events_source(model, lanes))
    if model.looks_elsewhen:
        parts.append(re.sub(r"\bsubstep", "elsewhen", runge_kutta_source(*DORMAND_PRINCE_8, rule=False, long=model.reads_data)))
    parts.append(_sensor_source(model))
    return _apart("".join(parts))


def _apart(source: str) -> str:
    """The source with the functions that branch called, not inlined, where roots are iterated.

    Copies of them one behind the other, each with a branch, are followed by the compiler along every path: 2 to the power of
    the number of steps of the iteration.
    """
    if not _ITERATION.search(source):
        return source
    called = sorted({*_BRANCHING.findall(source)})
    source = _BRANCHING.sub(r"apart_\1(", source)
    return "".join(_inline(f"apart_{name}(a)", f"return {name}(a)", mark="outlined") for name in called) + source


def _arguments(model: Model, extra: Sequence[str] = (), beside: str = "") -> tuple[dict[str, str], dict[sp.Symbol, str]]:
    """What stands for each argument in calls, from the state `x` and what is given, `p`; and the symbols that arguments are.

    The equations of motion have the side of each event besides: `beside` says what is called for it, with its number for {}.
    """
    d = derive(model)
    names = {s: f"x{i}" for i, s in enumerate(d.x)} | {s: f"p{i}" for i, s in enumerate(d.p)} | {d.t: "t"}
    given = {a: a for a in ("p", "t", *extra)}
    given |= {f"x{i}": f"x[{i}]" for i in range(len(d.x))} | {f"p{i}": f"p.parameters[{i}]" for i in range(len(d.p))}
    if beside:
        names |= {s: f"side{i}" for i, s in enumerate(d.sides)}
        given |= {f"side{i}": beside.format(i) for i in range(len(d.sides))}
    return given, names


def _identity_source(model: Model) -> str:
    """Where a step starts: memories take the value, and the derivative, of the state that they remember."""
    nd, n = len(model.moving), model.n
    rows = [", ".join(f"unit({i}, {n})" for i in source) for source in (range(nd), model.sources)]
    rest = "".join(f", unit({i}, {n})" for i in range(nd, n))
    full = "R" if nd == n else "matrix(" + ", ".join(f"R[{i}]" for i in range(nd)) + rest + ")"
    start = ", ".join(f"x[{i}]" for i in (*model.sources, *range(nd, n)))
    return (
        _inline("identity_rows()", f"return matrix({rows[0]})")
        + _inline("first_rows()", f"return matrix({rows[1]})")
        + _inline("remember(x)", f"return alike(x, {start})" if model.memory else "return x")
        + _inline("complete(R)", f"return {full}")
    )


class _Jacobian:
    """A Jacobian's entries: those that vary are outputs of the scalar function, the rest are literals in the source.

    `called` says what the equation of each row is called.
    """

    def __init__(self, matrix: sp.Matrix, prefix: str, called: Sequence[str]) -> None:
        self.matrix = matrix
        varying = [(i, j) for i in range(matrix.rows) for j in range(matrix.cols) if matrix[i, j].free_symbols]
        self.outputs, self.called = [matrix[i, j] for i, j in varying], [called[i] for i, _ in varying]
        self.names = [f"{prefix}{i}_{j}" for i, j in varying]
        self._texts = dict(zip(varying, self.names, strict=True))
        literals = [ij for ij in product(range(matrix.rows), range(matrix.cols)) if ij not in self._texts and matrix[ij] != 0]
        numbers = {ij: matrix[ij].is_Rational or matrix[ij].is_Float for ij in literals}
        self._texts |= {ij: repr(float(matrix[ij])) for ij in literals if numbers[ij]}
        slow = [ij for ij in literals if not numbers[ij]]
        texts = in_time(lambda k: called[slow[k][0]], lambda ij: repr(float(matrix[ij])), slow)
        self._texts |= dict(zip(slow, texts, strict=True))

    def entry(self, i: int, j: int) -> str:
        """Text of an entry, "" where it is zero."""
        return self._texts.get((i, j), "")

    def row_times(self, i: int, rows: Sequence[str], width: int) -> str:
        """Row i of the product with the matrix of those rows."""
        total = ""
        for j, row in enumerate(rows):
            e = self.entry(i, j)
            if e and total:
                total = f"{total} + {row}" if e == "1.0" else f"fused({e}, {row}, {total})"
            elif e:
                total = row if e == "1.0" else f"{e}*{row}"
        return total or f"unit(-1, {width})"

    def dense_row(self, i: int) -> str:
        return "vector(" + ", ".join(self.entry(i, j) or "0.0" for j in range(self.matrix.cols)) + ")"


def _called(model: Model) -> list[str]:
    """What the equations of the states are called."""
    return [f"the dynamics of {name}" for name in model.moving]


def _rows(model: Model) -> list[str]:
    """Text of the rows that a Jacobian multiplies: those of R, then the constants' unit rows."""
    nd, n = len(model.moving), model.n
    return [f"R[{i}]" for i in range(nd)] + [f"unit({i}, {n})" for i in range(nd, n)]


def _unpack(names: Sequence[str], call: str) -> str:
    return f"({', '.join(names)},) = {call}"


def _function(*what: Any) -> str:
    return with_used(function(*what))


@lru_cache(maxsize=MOST_MODELS)
def _dynamics_source(model: Model) -> str:
    d, (given, names) = derive(model), _arguments(model, beside="0.0")
    nd, n, called = len(model.moving), model.n, _called(model)
    F = _Jacobian(d.F, "F", called)
    rates = [f"f{i}" for i in range(nd)]
    whole = f"alike(x, {', '.join(rates + ['0.0'] * (n - nd))})"
    rows = ", ".join(F.row_times(i, _rows(model), n) for i in range(nd))
    f = _function("scalar_f", [*given], names, list(d.f), d.values, called)
    f_F = _function("scalar_f_F", [*given], names, list(d.f) + F.outputs, d.partials, called + F.called)

    def rates_by(suffix: str, given: Mapping[str, str]) -> str:
        value, both = _unpack(rates, call_of(f, given)), _unpack(rates + F.names, call_of(f_F, given))
        source = _inline(f"dynamics{suffix}(t, x, p)", value, f"return {whole}")
        source += _inline(f"rhs{suffix}(t, x, R, p)", both, f"return {whole}, matrix({rows})")
        for name, taken in (("dynamics", "t, x, p"), ("rhs", "t, x, R, p")) if model.reads_data else ():
            source += _inline(f"{name}{suffix}_outlined({taken})", f"return {name}{suffix}({taken})", mark="outlined")
        return source

    return f + f_F + rates_by("", given) + (rates_by("_beside", _arguments(model, beside=SIDE)[0]) if model.events else "")


def _step_source(model: Model, scheme: tuple[Any, ...]) -> str:
    source = _any_step_source(model, scheme)
    if model.events and scheme[0] != "kepler":
        source = re.sub(r"\b(dynamics|rhs)(_outlined)?\(", r"\1_beside\2(", source)
        if "GAPS = " not in source:  # noise is integrated piece by piece
            source = rule_source(6) + source
        if scheme[0] == "adaptive":
            source += _inline("substep(t, h, x, p)", "y, _ = trial(t, h, x, p)", "return y")
    return source


def _events_source(model: Model, lanes: int) -> str:
    """Values of events with their rates along the orbit, their derivatives by the state, and what a jump makes of rows.

    Where an event depends on states alone whose rates are states, as a shadow's edge does, no rate is evaluated for it.
    """
    d, f, (given, names) = derive_events(model), derive(model), _arguments(model)
    nd, n, count = len(model.moving), model.n, len(model.events)
    called = [f"event {name}" for name, _ in model.events]
    J, moving = _Jacobian(d.G, "G", called), list(f.x)
    rate = [f"x[{moving.index(f.f[i])}]" if f.f[i] in moving else f"f[{i}]" for i in range(nd)]
    values = [f"g{e}" for e in range(count)]
    g = _function("scalar_g", [*given], names, list(d.g) + J.outputs, d.partials, called + J.called)
    unpack = _unpack(values + J.names, call_of(g, given))
    rates, row = [], [unpack, "row = unit(-1, N)"]
    for e in range(count):
        terms = [J.entry(e, n), *(f"{J.entry(e, i)}*{rate[i]}" for i in range(nd) if J.entry(e, i))]
        rates.append(" + ".join(term for term in terms if term) or "0.0")
        entries = ", ".join(J.entry(e, i) or "0.0" for i in range(n))
        row += [f"if event == {e}:", f"    row = vector({entries})"]
    both = [unpack, *(["f = dynamics_beside(t, x, p)"] if any("f[" in text for text in rates) else [])]
    into = [f"p.work[at + {i}] = {text}" for i, text in enumerate(values + rates)]
    return (
        f"EVENTS = {count}\nEVENTS_WORK = {6 * count}\nEVENTS_LANES = {2 * count * lanes}\n\n\n"
        + g
        + _inline("events_of(t, x, p)", *both, f"return vector({', '.join(values + rates)})", mark="outlined")
        + _inline("events_into(t, x, p, at)", *both, *into, mark="outlined")
        + _inline("event_row(t, x, p, event)", *row, "return row", mark="outlined")
        + _inline("jumped(R, jump, row)", f"return matrix({', '.join(f'R[{i}] + jump[{i}]*row' for i in range(nd))})")
    )


def _any_step_source(model: Model, scheme: tuple[Any, ...]) -> str:
    if scheme[0] == "runge-kutta":
        return runge_kutta_source(*scheme[1], long=model.reads_data)
    if scheme[0] == "gauss-jackson":
        return runge_kutta_source(*DORMAND_PRINCE_8, long=model.reads_data) + multistep_source(model, *scheme[1:])
    if scheme[0] == "adaptive":
        return adaptive_source(model, *scheme[1:])
    if scheme[0] == "kepler":
        return kepler_source(model, *scheme[1:])
    if scheme[0] == "constant-acceleration":
        return _constant_acceleration_source(model)
    return _map_source(model)


def _constant_acceleration_source(model: Model) -> str:
    """The step of the founding text; its derivative needs F of the rates alone, so it costs no more than they do."""
    d, (nxt, h) = derive(model), constant_acceleration_step(model)
    given, names = _arguments(model, ("h",), SIDE)
    names = {**names, h: "h"}
    nd, n, called = len(model.moving), model.n, _called(model)
    F, rows = _Jacobian(d.F, "F", called), _rows(model)
    moving = list(d.x[:nd])
    rates = [moving.index(rate) if rate in moving else i for i, rate in enumerate(d.f)]  # the state whose rate counts
    results = [f"n{i}" for i in range(nd)]
    whole = f"alike(x, {', '.join(results + [f'x[{i}]' for i in range(nd, n)])})"
    used = sorted(set(rates))
    products = [f"K{j} = {F.row_times(j, rows, n)}" for j in used]
    products += [f"V{j} = R[{j}] + h*K{j}" for j in used]
    new = [f"V{i}" if i == j else f"R[{i}] + half*(R[{j}] + V{j})" for i, j in enumerate(rates)]
    step = _function("scalar_step", [*given], names, list(nxt), d.values, called)
    step_F = _function("scalar_step_F", [*given], names, list(nxt) + F.outputs, d.partials, called + F.called)
    return (
        step
        + step_F
        + _inline("substep(t, h, x, p)", _unpack(results, call_of(step, given)), f"return {whole}")
        + _inline(
            "substep_jacobian(t, h, x, R, p)",
            _unpack(results + F.names, call_of(step_F, given)),
            "half = 0.5*h",
            *products,
            f"return {whole}, matrix({', '.join(new)})",
        )
    )


def _map_source(model: Model) -> str:
    """A step given as a formula: its Jacobian is derived."""
    d, (given, names) = derive(model), _arguments(model, ("h",))
    names = {**names, d.dt: "h"}
    nd, n, called = len(model.moving), model.n, _called(model)
    G = _Jacobian(d.F, "G", called)
    results = [f"n{i}" for i in range(nd)]
    whole = f"alike(x, {', '.join(results + [f'x[{i}]' for i in range(nd, n)])})"
    rows = ", ".join(G.row_times(i, _rows(model), n) for i in range(nd))
    step = _function("scalar_step", [*given], names, list(d.f), d.values, called)
    step_G = _function("scalar_step_G", [*given], names, list(d.f) + G.outputs, d.partials, called + G.called)
    return (
        step
        + step_G
        + _inline("substep(t, h, x, p)", _unpack(results, call_of(step, given)), f"return {whole}")
        + _inline(
            "substep_jacobian(t, h, x, R, p)",
            _unpack(results + G.names, call_of(step_G, given)),
            f"return {whole}, matrix({rows})",
        )
    )


@lru_cache(maxsize=MOST_MODELS)
def _sensor_source(model: Model) -> str:
    functions, measure, innovate = [], [], []
    measure_lanes, innovate_lanes = [], []
    for index, sensor in enumerate(model.sensors):
        d = derive_sensor(model, sensor)
        given, names = _arguments(model)
        given |= {f"s{i}": f"s[at + {i}]" for i in range(len(d.own))}
        names |= {s: f"s{i}" for i, s in enumerate(d.own)}
        called = [f"{component} of sensor {sensor.name}" for component in sensor.components]
        J = _Jacobian(d.H, "H", called)
        seen = [f"h{i}" for i in range(sensor.width)]
        h = _function(f"scalar_h{index}", [*given], names, list(d.h), d.values, called)
        h_H = _function(f"scalar_h{index}_H", [*given], names, list(d.h) + J.outputs, d.partials, called + J.called)
        functions += [h, h_H]
        guard = f"if sensor == {index}:" if len(model.sensors) > 1 else "if True:"
        measure += [guard, "    " + _unpack(seen, call_of(h, given))]
        measure += [f"    out[row + {i}] = " + (f"h{i}" if i < sensor.width else "nan") for i in range(model.width)]
        innovate += [guard, "    " + _unpack(seen + J.names, call_of(h_H, given))]
        for i, angle in enumerate(sensor.is_angle):
            scale, put_on_sky = _on_sky(sensor, i, "z[row + {}]")
            difference = f"z[row + {i}] - h{i}"
            difference = f"wrap_angle({difference})" if angle else difference
            innovate += put_on_sky
            innovate.append(f"    nu[out + {i}] = unless_missing(z[row + {i}], {scale}({difference}))")
            innovate.append(f"    store(H, (out + {i}) * {model.n}, {scale}{J.dense_row(i)})")
        innovate += [f"    nu[out + {i}] = nan" for i in range(sensor.width, model.width)]
        measure_lanes += [guard, "    " + _unpack(seen, call_of(h, given))]
        measure_lanes.append(f"    store_packs(h, 0, vector({', '.join(seen)}), LANES)")
        innovate_lanes += [guard, "    " + _unpack(seen + J.names, call_of(h_H, given))]
        for i, angle in enumerate(sensor.is_angle):
            scale, put_on_sky = _on_sky(sensor, i, "load_packs(z, {} * LANES, 1, LANES)[0]")
            difference = f"load_packs(z, {i} * LANES, 1, LANES)[0] - h{i}"
            difference = f"wrap_angle({difference})" if angle else difference
            innovate_lanes += put_on_sky
            innovate_lanes.append(f"    store_packs(nu, {i} * LANES, vector({scale}({difference})), LANES)")
            innovate_lanes.append(f"    store_packs(H, {i * model.n} * LANES, {scale}{J.dense_row(i)}, LANES)")
    if not model.sensors:
        measure, innovate, measure_lanes, innovate_lanes = ["pass"], ["pass"], ["pass"], ["pass"]
    return (
        "".join(functions)
        + _inline("measure_into(sensor, t, x, p, s, at, out, row)", *measure)
        + _inline("innovate(sensor, t, x, p, s, at, z, row, nu, H, out)", *innovate)
        + ROWS
        + _inline("measure_lanes(sensor, t, x, p, s, at, h)", *measure_lanes)
        + _inline("innovate_lanes(sensor, t, x, p, s, at, z, nu, H)", *innovate_lanes)
    )


def _on_sky(sensor: Sensor, i: int, measured: str) -> tuple[str, list[str]]:
    """The factor of a component's innovation, and the line that works it out: by what is measured, where it is."""
    partner = sensor.circle[i]
    if partner is None:
        return "", []
    z = measured.format(partner)
    return f"scale{i}*", [f"    scale{i} = cos(choose(10.0, fabs({z}), {z}, h{partner}))"]
