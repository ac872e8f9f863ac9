"""Source of the steps that are no formula of the model's: tableaus, error control, Kepler's closed form; and of orbit axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from piazzi.kernels.integrators import Kepler
from piazzi.kernels.quadrature import noise_order, rule_source
from piazzi.kernels.tableaus import DORMAND_PRINCE_8, ERROR_3, ERROR_5, Row
from piazzi.model import Model

MOST_INLINED = 6  # stages
PANEL = 0.6  # of the time in which gravity or motion turns the orbit: 0.42 rad of a circular one
MAX_PANELS = 1_000_000  # in one interval: 150,000 turns of a circular orbit


def inline_source(head: str, *lines: str, mark: str = "inline") -> str:
    """Source of a helper that disappears into its caller; or, marked "outlined", that is compiled once and called."""
    return f"@{mark}\ndef {head}:\n" + "".join(f"    {line}\n" for line in lines) + "\n\n"


def _combination(base: str, k: str, coefficients: Sequence[float], h: str = "*h") -> str:
    """Text of base + h sum c_j k_j."""
    terms = [f"({c!r}{h})*{k}{j}" for j, c in enumerate(coefficients) if c]
    return " + ".join([base, *terms] if base else terms)


def runge_kutta_source(a: Sequence[Row], weights: Row, nodes: Row, *, rule: bool = True, long: bool = False) -> str:
    """The stages of an explicit tableau, on the state alone and on state and transition matrix together.

    Many stages are compiled once and called: inlined wherever a step is taken, they would take minutes to compile.  So are,
    within them, rates that are `long`: twelve copies of many forces are more than a processor keeps at hand.
    """
    mark = "inline" if len(weights) <= MOST_INLINED else "outlined"
    suffix = "_outlined" if long and mark == "outlined" else ""
    alone, both = [], []
    for i, (row, c) in enumerate(zip(a, nodes, strict=True)):
        t = f"t + {c!r}*h" if c else "t"
        alone.append(f"k{i} = dynamics{suffix}({t}, {_combination('x', 'k', row)}, p)")
        both.append(f"k{i}, K{i} = rhs{suffix}({t}, {_combination('x', 'k', row)}, {_combination('R', 'K', row)}, p)")
    alone.append(f"return {_combination('x', 'k', weights)}")
    both.append(f"return {_combination('x', 'k', weights)}, {_combination('R', 'K', weights)}")
    step, jacobian = "substep(t, h, x, p)", "substep_jacobian(t, h, x, R, p)"
    noise = rule_source(noise_order(len(weights))) if rule else ""
    return noise + inline_source(step, *alone, mark=mark) + inline_source(jacobian, *both, mark=mark)


def adaptive_source(model: Model, rtol: float, atol: float, max_steps: int) -> str:
    """``trial``, ``trial_jacobian``: a step of order 8 and its error in units of the tolerance, alone and with derivative."""
    a, weights, nodes = DORMAND_PRINCE_8
    suffix = "_outlined" if model.reads_data else ""
    stages, both, error = [], [], []
    for i, (row, c) in enumerate(zip(a, nodes, strict=True)):
        t, x = f"t + {c!r}*h" if c else "t", _combination("x", "k", row)
        stages.append(f"k{i} = dynamics{suffix}({t}, {x}, p)")
        both.append(f"k{i}, K{i} = rhs{suffix}({t}, {x}, {_combination('R', 'K', row)}, p)")
    for v, k in (("y", "x"), ("S", "R")):
        (stages if v == "y" else both).append(f"{v} = {_combination(k, 'k' if v == 'y' else 'K', weights)}")
    both.append(stages[-1])
    groups = _together(model)
    for i, group in enumerate(groups):
        before, after = (" + ".join(f"{v}[{j}]*{v}[{j}]" for j in group) for v in "xy")
        error.append(f"w{i} = 1.0 / maximum(ATOL + RTOL * sqrt(maximum({before}, {after})), 1e-300)")
        for j in group:
            error.append(f"u{j}, v{j} = w{i} * e5[{j}], w{i} * e3[{j}]")
    sums = [" + ".join(f"{u}{j}*{u}{j}" for j in range(len(model.moving))) for u in "uv"]
    embedded = [f"e{q} = {_combination('', 'k', e, '')}" for q, e in ((5, ERROR_5), (3, ERROR_3))]
    error = [*embedded, *error, f"error = combined_error(h, {sums[0]}, {sums[1]})"]
    matrix = [f"E{q} = {_combination('', 'K', e, '')}" for q, e in ((5, ERROR_5), (3, ERROR_3))]
    matrix += ["off = matrix_error(h, R, S, E5, E3)", "return y, S, off if not off <= error else error"]
    member = tuple(next(g for g, group in enumerate(groups) if j in group) for j in range(len(model.moving)))
    return (
        f"MAX_STEPS = {max_steps}\nRTOL = {rtol!r}\nATOL = {atol!r}\nGROUP = {member!r}\n"
        + rule_source(10)
        + inline_source("trial(t, h, x, p)", *stages, *error, "return y, error", mark="outlined")
        + inline_source("trial_jacobian(t, h, x, R, p)", *both, *error, *matrix, mark="outlined")
        + inline_source("substep_jacobian(t, h, x, R, p)", "y, S, _ = trial_jacobian(t, h, x, R, p)", "return y, S")
    )


def _together(model: Model) -> list[list[int]]:
    """States whose lengths are measured together: those of a group (of the smallest, where there are several)."""
    groups = sorted((members for _, members in model.groups), key=len)
    seen: dict[tuple[str, ...], list[int]] = {}
    for j, state in enumerate(model.moving):
        seen.setdefault(next((g for g in groups if state in g), (state,)), []).append(j)
    return list(seen.values())


def kepler_source(model: Model, mu: str | float, position: Any, velocity: Any) -> str:
    """The closed-form step and its derivative, from the numbers that ``kepler_motion`` and ``kepler_partials`` give."""
    nd, n = len(model.moving), model.n
    axes = Kepler(mu=mu, position=position, velocity=velocity).axes(dict(model.groups))
    r, v = ([model.names.index(s) for s in group] for group in axes)
    if mu in model.names:
        m = f"x[{model.names.index(mu)}]"
    else:
        m = f"p.parameters[{model.given.index(str(mu))}]" if mu in model.given else repr(mu)
    dot = {
        name: " + ".join(f"x[{i}]*x[{j}]" for i, j in zip(*pair, strict=True))
        for name, pair in {"rr": (r, r), "rv": (r, v), "vv": (v, v)}.items()
    }
    head = [f"r0 = sqrt({dot['rr']})", f"sigma0 = {dot['rv']}"]
    call = f"(r0, sigma0, {dot['vv']}, {m}, h)"
    new, rows = [f"x[{i}]" for i in range(n)], [f"unit({i}, {n})" for i in range(nd)]
    for i, j in zip(r, v, strict=True):
        new[i], new[j] = f"F*x[{i}] + G*x[{j}]", f"Ft*x[{i}] + Gt*x[{j}]"
        rows[i] = f"x[{i}]*DF + x[{j}]*DG + F*unit({i}, {n}) + G*unit({j}, {n})"
        rows[j] = f"x[{i}]*DFt + x[{j}]*DGt + Ft*unit({i}, {n}) + Gt*unit({j}, {n})"
    by_r0, by_sigma0, by_beta, by_mu = (["0.0"] * n for _ in range(4))
    for i, j in zip(r, v, strict=True):
        by_r0[i], by_sigma0[i], by_sigma0[j] = f"x[{i}]/r0", f"x[{j}]", f"x[{i}]"
        by_beta[i], by_beta[j] = f"-2.0*{m}*x[{i}]/(r0*r0*r0)", f"-2.0*x[{j}]"
    if mu in model.names:
        by_beta[model.names.index(mu)], by_mu[model.names.index(mu)] = "2.0/r0", "1.0"
    change = ", ".join(f"vector({', '.join(row)})" for row in (by_r0, by_sigma0, by_beta, by_mu))
    reach = [*head[:1], f"return {PANEL!r} / sqrt({m}/(r0*r0*r0) + ({dot['vv']})/(r0*r0))"]
    return (
        f"MAX_PANELS = {MAX_PANELS}\n"
        + rule_source(10)
        + inline_source("panel(x, p)", *reach)
        + inline_source("substep(t, h, x, p)", *head, f"F, G, Ft, Gt = kepler_motion{call}", f"return vector({', '.join(new)})")
        + inline_source(
            "substep_jacobian(t, h, x, R, p)",
            *head,
            f"F, G, Ft, Gt, dF, dG, dFt, dGt = kepler_partials{call}",
            f"change = matrix({change})",
            "DF, DG, DFt, DGt = dF @ change, dG @ change, dFt @ change, dGt @ change",
            f"return vector({', '.join(new)}), matrix({', '.join(rows)}) @ complete(R)",
        )
    )


def axes_source(model: Model) -> str:
    """``orbit_axes(x)``: columns along radius, transverse and normal, for position and for velocity; "" without such groups."""
    groups = dict(model.groups)
    r, v = ([model.names.index(s) for s in groups.get(g, ())] for g in ("position", "velocity"))
    if len(r) != len(v) or len(r) not in (2, 3):
        return ""
    entries = [["1.0" if i == j else "0.0" for j in range(model.n)] for i in range(model.n)]
    for group in (r, v):
        for a, i in enumerate(group):
            for b, j in enumerate(group):
                entries[i][j] = f"e{b}{a}"
    rows = ", ".join(f"vector({', '.join(row)})" for row in entries)
    make = _axes_in_plane if len(r) == 2 else _axes_in_space
    return inline_source("orbit_axes(x)", *make([f"x[{i}]" for i in r], [f"x[{i}]" for i in v]), f"return matrix({rows})")


def _axes_in_plane(r: Sequence[str], v: Sequence[str]) -> list[str]:
    """Radial e0 and transverse e1, which has a positive component along the velocity."""
    return [
        f"inverse = 1.0 / sqrt({r[0]}*{r[0]} + {r[1]}*{r[1]})",
        f"turn = -1.0 if {r[0]}*{v[1]} < {r[1]}*{v[0]} else 1.0",
        f"e00, e01 = inverse * {r[0]}, inverse * {r[1]}",
        "e10, e11 = -turn * e01, turn * e00",
    ]


def _axes_in_space(r: Sequence[str], v: Sequence[str]) -> list[str]:
    """Radial e0, normal e2 along the angular momentum, and transverse e1 = e2 x e0."""

    def cross(a: Sequence[str], b: Sequence[str]) -> str:
        return ", ".join(f"{a[i]}*{b[j]} - {a[j]}*{b[i]}" for i, j in ((1, 2), (2, 0), (0, 1)))

    return [
        f"inverse = 1.0 / sqrt({r[0]}*{r[0]} + {r[1]}*{r[1]} + {r[2]}*{r[2]})",
        f"e00, e01, e02 = inverse * {r[0]}, inverse * {r[1]}, inverse * {r[2]}",
        f"n0, n1, n2 = {cross(r, v)}",
        "inverse = 1.0 / sqrt(n0*n0 + n1*n1 + n2*n2)",
        "e20, e21, e22 = inverse * n0, inverse * n1, inverse * n2",
        f"e10, e11, e12 = {cross(('e20', 'e21', 'e22'), ('e00', 'e01', 'e02'))}",
    ]
