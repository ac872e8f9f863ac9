"""Derivatives against differences of values."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from piazzi.arrays import Array

AGREED = 1e-5  # of a derivative
ROUNDING = 64 * 2.0**-52  # of a value: what rounding in a function may come to
LONG = 1e-3  # of an argument: shorter steps have too much rounding in them to tell what is zero


def disagreement(
    function: Callable[..., Array], at: Sequence[float], argument: int, derivatives: Array
) -> list[tuple[int, float]]:
    """Outputs whose derivative by an argument agrees with central differences of no length, and what the nearest one gives.

    Lengths go from a tenth of the argument down to a millionth, or about zero over six powers of ten to either side of 1; each
    is extrapolated with its half.  Outputs that have no finite value, or no finite differences, agree.
    """
    x = at[argument]
    steps = np.abs(x) * 10.0 ** -np.arange(1.0, 6.5, 0.5) if x else 10.0 ** np.arange(6.0, -6.5, -0.5)
    value = function(*at)
    best = np.full(len(value), np.nan)
    least = np.full(len(value), np.inf)
    agreed = ~np.isfinite(value) | ~np.isfinite(derivatives)
    for h in steps:
        d = _difference(function, at, argument, float(h))
        miss = np.abs(d - derivatives)
        allowed = AGREED * np.maximum(np.abs(d), np.abs(derivatives))
        if h >= LONG * (abs(x) or 1.0):
            allowed += ROUNDING * np.abs(value) / h
        agreed |= miss <= allowed
        nearer = miss < least
        best[nearer], least[nearer] = d[nearer], miss[nearer]
    return [(int(i), float(best[i])) for i in np.flatnonzero(~agreed & np.isfinite(best))]


def _difference(function: Callable[..., Array], at: Sequence[float], argument: int, h: float) -> Array:
    """The central difference, extrapolated with that of half its length."""

    def slope(h: float) -> Array:
        ends = [[x + s * h if k == argument else x for k, x in enumerate(at)] for s in (1, -1)]
        return np.asarray((function(*ends[0]) - function(*ends[1])) / (ends[0][argument] - ends[1][argument]))

    return (4.0 * slope(0.5 * h) - slope(h)) / 3.0
