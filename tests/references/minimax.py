"""Coefficients of the elementary functions of kernels: minimax fits by Remez's exchange, in forty digits.

``python -m tests.references.minimax`` prints them.  Each series P stands in one formula, and the largest error of that relative
to the function is the least that a polynomial of so many coefficients can have:

    sin r = r + r z P(z),  cos r = 1 - z/2 + z^2 P(z),  atan r = r + r z P(z),  exp r = 1 + r + r^2 P(r),
    log((1 + s) / (1 - s)) = 2 s + s z P(z),  with z the square of r or s.

Intervals are a thousandth wider than the reduced arguments, which rounding may put outside.
"""

from collections.abc import Callable
from typing import NamedTuple

import mpmath as mp

WIDER = mp.mpf("1.001")
ROUNDS = 30


class Fit(NamedTuple):
    """What to fit: P by so many coefficients over an interval; what an error of P at a point is of the function there."""

    many: int
    wanted: Callable[[mp.mpf], mp.mpf]
    relative: Callable[[mp.mpf], mp.mpf]
    begin: mp.mpf
    end: mp.mpf


def by_root(f: Callable[[mp.mpf], mp.mpf]) -> Callable[[mp.mpf], mp.mpf]:
    """An even function of r as one of z = r^2."""
    return lambda z: f(mp.sqrt(z))


def fits() -> dict[str, Fit]:
    turn, arc = (mp.pi / 4) ** 2 * WIDER, mp.tan(mp.pi / 8) ** 2 * WIDER
    ln2, ratio = mp.log(2) / 2 * WIDER, mp.tan(mp.pi / 8) ** 4 * WIDER  # (sqrt(2) - 1) / (sqrt(2) + 1) squared
    zero = mp.mpf(0)
    return {
        "sine_series": Fit(6, by_root(lambda r: (mp.sin(r) / r - 1) / r**2), by_root(lambda r: r**3 / mp.sin(r)), zero, turn),
        "cosine_series": Fit(
            6, by_root(lambda r: (mp.cos(r) - 1 + r**2 / 2) / r**4), by_root(lambda r: r**4 / mp.cos(r)), zero, turn
        ),
        "arc_series": Fit(11, by_root(lambda r: (mp.atan(r) / r - 1) / r**2), by_root(lambda r: r**3 / mp.atan(r)), zero, arc),
        "exponential_series": Fit(11, lambda r: (mp.exp(r) - 1 - r) / r**2, lambda r: r**2 / mp.exp(r), -ln2, ln2),
        "logarithm_series": Fit(
            7, by_root(lambda s: (2 * mp.atanh(s) / s - 2) / s**2), by_root(lambda s: s**3 / (2 * mp.atanh(s))), zero, ratio
        ),
    }


def minimax(fit: Fit) -> list[mp.mpf]:
    """The coefficients, c0 + c1 z + ..., of the fit whose largest error is least (Remez 1934)."""
    size, half = fit.many + 1, (fit.end - fit.begin) / 2
    nodes = [fit.begin + half * (1 - mp.cos(mp.pi * (i + mp.mpf(1) / 2) / size)) for i in range(size)]
    points = [fit.begin + half * (1 - mp.cos(mp.pi * (i + mp.mpf(1) / 2) / (60 * size))) for i in range(60 * size)]
    values, weights = [fit.wanted(z) for z in points], [fit.relative(z) for z in points]
    coefficients: list[mp.mpf] = []
    for _ in range(ROUNDS):
        rows = [[*(z**j for j in range(fit.many)), (-1) ** i / fit.relative(z)] for i, z in enumerate(nodes)]
        coefficients = list(mp.lu_solve(mp.matrix(rows), mp.matrix([fit.wanted(z) for z in nodes])))[: fit.many]

        def error(z: mp.mpf, c: list[mp.mpf] = coefficients) -> mp.mpf:
            return fit.relative(z) * (mp.polyval(c[::-1], z) - fit.wanted(z))

        errors = [w * (mp.polyval(coefficients[::-1], z) - v) for z, v, w in zip(points, values, weights, strict=True)]
        before, nodes = nodes, [largest(error, points, i) for i in turns(errors, size)]
        if len(nodes) < size or max(abs(a - b) for a, b in zip(nodes, before, strict=True)) < mp.mpf("1e-14") * half:
            break
    return coefficients


def turns(errors: list[mp.mpf], many: int) -> list[int]:
    """Where the errors are largest between changes of their sign; the `many` of them that are worst at the ends."""
    found: list[int] = []
    for i, e in enumerate(errors):
        if not found or (e > 0) != (errors[found[-1]] > 0):
            found.append(i)
        elif abs(e) > abs(errors[found[-1]]):
            found[-1] = i
    while len(found) > many:
        found = found[1:] if abs(errors[found[0]]) < abs(errors[found[-1]]) else found[:-1]
    return found


def largest(error: Callable[[mp.mpf], mp.mpf], points: list[mp.mpf], i: int) -> mp.mpf:
    """The place of the largest error near point i, by thirds."""
    low, high = points[max(i - 1, 0)], points[min(i + 1, len(points) - 1)]
    sign = mp.sign(error(points[i]))
    for _ in range(80):
        a, b = low + (high - low) / 3, high - (high - low) / 3
        low, high = (low, b) if sign * error(a) > sign * error(b) else (a, high)
    return (low + high) / 2


if __name__ == "__main__":
    with mp.workdps(40):
        for name, fit in fits().items():
            print(f"{name} = {[float(c) for c in minimax(fit)]}")
