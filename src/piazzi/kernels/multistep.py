"""Gauss-Jackson: weights of the multi-step method in summed form, in exact fractions, and the source that applies them.

With the backward difference D and the sums S1 = D^-1 f, S2 = D^-2 f of all rates f so far (Berry and Healy, Implementation of
Gauss-Jackson integration for orbit propagation, Journal of the Astronautical Sciences 52(3), 2004)::

    velocity = h D (-ln(1 - D))^-1 S1,    position = h^2 (D (-ln(1 - D))^-1)^2 S2

The series are cut after as many rates as the order says, and written as weights of the rates themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb
from typing import NamedTuple

from piazzi.kernels.steps import inline_source
from piazzi.model import Model

Weights = tuple[Fraction, ...]
SHIFTS = 64  # steps after which the rates are moved to the end of their memory


class Rule(NamedTuple):
    """Weights of the newest rates, newest first, for position and velocity: from those before a step, and with its own."""

    predictor: tuple[Weights, Weights]
    corrector: tuple[Weights, Weights]


def rule(order: int) -> Rule:
    """The weights of so many rates."""
    single = _reciprocal([Fraction(1, k + 1) for k in range(order + 2)])  # -z / ln(1 - z)
    double = [sum((single[j] * single[k - j] for j in range(k + 1)), Fraction(0)) for k in range(order + 2)]
    ahead = [_summed(series) for series in (double, single)]  # the same, a step later: over 1 - z
    predictor = _of_rates(ahead[0][2:]), _of_rates(ahead[1][1 : order + 1])
    return Rule(predictor, (_of_rates(double[2:]), _of_rates(single[1 : order + 1])))


def within(order: int) -> tuple[tuple[Weights, ...], tuple[Weights, ...]]:
    """Integrals of the polynomial through the newest rates, from the newest back over s steps: powers of s, weights of rates.

    Of the second integral the coefficients of s^2, s^3, ..., of the first those of s, s^2, ...
    """
    bases = [_lagrange(j, order) for j in range(order)]
    twice = tuple(tuple(b[k] / ((k + 1) * (k + 2)) for b in bases) for k in range(order))
    once = tuple(tuple(b[k] / (k + 1) for b in bases) for k in range(order))
    return twice, once


def _reciprocal(series: Sequence[Fraction]) -> list[Fraction]:
    """Coefficients of one over a power series that begins with 1."""
    out = [Fraction(1)]
    for k in range(1, len(series)):
        out.append(-sum((series[j] * out[k - j] for j in range(1, k + 1)), Fraction(0)))
    return out


def _summed(series: Sequence[Fraction]) -> list[Fraction]:
    return [sum(series[: k + 1], Fraction(0)) for k in range(len(series))]


def _of_rates(differences: Sequence[Fraction]) -> Weights:
    """Weights of rates that are those of their backward differences, order by order."""
    count = range(len(differences))
    return tuple(sum((differences[k] * (-1) ** j * comb(k, j) for k in count if k >= j), Fraction(0)) for j in count)


def _lagrange(j: int, count: int) -> Weights:
    """Coefficients, lowest power first, of the polynomial that is 1 at j and 0 at the other numbers below `count`."""
    out = [Fraction(1)]
    for i in range(count):
        if i != j:
            shifted = [Fraction(0), *out]
            out = [(a - i * b) / (j - i) for a, b in zip(shifted, [*out, Fraction(0)], strict=True)]
    return tuple(out)


def second_order(model: Model) -> tuple[tuple[int, int], ...]:
    """Pairs of a state whose rate is a state, and that state, by position; () unless every other state is constant."""
    if model.discrete or model.memory:
        return ()
    place = {name: i for i, name in enumerate(model.states)}
    rates = [text.strip() for text in model.dynamics]
    pairs = tuple((i, place[rate]) for i, rate in enumerate(rates) if place.get(rate, i) != i)
    known = {i for pair in pairs for i in pair} | {i for i, rate in enumerate(rates) if rate == "0"}
    apart = {i for i, _ in pairs}.isdisjoint(j for _, j in pairs)
    return pairs if apart and len(known) == len(rates) else ()


def multistep_source(model: Model, order: int) -> str:
    """The sizes of a history of rates, the weighted sums over it, and what makes a state of positions and velocities."""
    pairs, n = second_order(model), model.n
    driven = sorted({j for _, j in pairs})
    slot = len(driven) * (1 + n)
    sizes = {"ORDER": order, "DRIVEN": len(driven), "SLOT": slot, "TOP": SHIFTS * slot, "HISTORY": (SHIFTS + order) * slot}
    weights, back = rule(order), within(order)
    literal = [[[float(w) for w in row] for row in pair] for pair in (weights.predictor, weights.corrector)]
    powers = [[f"vector({', '.join(repr(float(w)) for w in row)})" for row in rows] for rows in back]
    horner = [f"{name} = {rows[-1]}" for name, rows in zip("ab", powers, strict=True)]
    for k in range(order - 2, -1, -1):
        horner += [f"{name} = fused(s, {name}, {rows[k]})" for name, rows in zip("ab", powers, strict=True)]
    entries = [[f"{name}[{j}]" for j in range(order)] for name in "ab"]
    return (
        "".join(f"{name} = {size}\n" for name, size in sizes.items())
        + "\n\n"
        + inline_source("rate(t, x, p)", "return dynamics(t, x, p)")
        + inline_source("rate_jacobian(t, x, R, p)", "return rhs(t, x, R, p)")
        + inline_source("predicted(F, at)", *_sums([[repr(w) for w in row] for row in literal[0]]))
        + inline_source("corrected(F, at)", *_sums([[repr(w) for w in row] for row in literal[1]]))
        + inline_source("between(F, at, s)", *horner, "a = (s * s) * a", "b = s * b", *_sums(entries))
        + _shapes(model, pairs, driven)
    )


def _sums(weights: Sequence[Sequence[str]]) -> list[str]:
    """Lines that weigh the rates from `at` for position and velocity, and their derivatives: x, v, X, V."""
    lines = []
    for j, (wx, wv) in enumerate(zip(*weights, strict=True)):
        lines.append(f"f, G = rates_at(F, at + {j} * SLOT), rows_at(F, at + {j} * SLOT)")
        if j == 0:
            lines.append(f"x, v, X, V = {wx} * f, {wv} * f, {wx} * G, {wv} * G")
        else:
            lines.append(f"x, v = fused({wx}, f, x), fused({wv}, f, v)")
            lines.append(f"X, V = fused({wx}, G, X), fused({wv}, G, V)")
    return [*lines, "return x, v, X, V"]


def _shapes(model: Model, pairs: Sequence[tuple[int, int]], driven: Sequence[int]) -> str:
    """Pick what is driven, what is a position, and join both."""
    nd, n = len(model.moving), model.n
    positions = [i for i, _ in pairs]
    of = [driven.index(j) for _, j in pairs]  # which rate drives a position

    def picked(what: str, places: Sequence[int], make: str) -> str:
        return f"return {make}({', '.join(f'{what}[{i}]' for i in places)})"

    state, rows = [f"x[{i}]" for i in range(n)], [f"unit({i}, {n})" for i in range(nd)]
    for k, i in enumerate(positions):
        state[i], rows[i] = f"q[{k}]", f"Q[{k}]"
    for k, i in enumerate(driven):
        state[i], rows[i] = f"v[{k}]", f"V[{k}]"
    return (
        inline_source("driven(f)", picked("f", driven, "vector"))
        + inline_source("driven_of(K)", picked("K", driven, "matrix"))
        + inline_source("positions(x)", picked("x", positions, "vector"))
        + inline_source("positions_of(R)", picked("R", positions, "matrix"))
        + inline_source("doubled(v)", picked("v", of, "vector"))
        + inline_source("doubled_of(V)", picked("V", of, "matrix"))
        + inline_source("joined(x, q, v)", f"return vector({', '.join(state)})")
        + inline_source("joined_of(Q, V)", f"return matrix({', '.join(rows)})")
    )
