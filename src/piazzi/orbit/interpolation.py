"""Polynomials through rows of an ephemeris: Lagrange's through positions, Hermite's through positions and velocities."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array

LAGRANGE = (8, 10, 12, 14, 16)  # rows
HERMITE = (2, 3, 4, 5, 6, 7, 8)


class Interpolated(NamedTuple):
    """Positions and velocities (K, 3) of a polynomial, and how far those of the next degrees are from it."""

    r: Array
    v: Array
    method: str
    degree: int
    error: float
    slope_error: float


def polynomial(t: Array, r: Array, v: Array | None, at: Array, rows: int) -> tuple[Array, Array]:
    """Value and derivative (K, 3) at times of the polynomial through so many rows about each.

    Newton's form of divided differences; a row that has a velocity too counts twice.
    """
    rows = min(rows, len(t))
    step = float(t[-1] - t[0]) / max(len(t) - 1, 1) or 1.0
    first = np.clip(np.searchsorted(t, at, side="right") - (rows + 1) // 2, 0, len(t) - rows)
    chosen = first[:, None] + np.arange(rows)
    if v is not None:
        chosen = np.repeat(chosen, 2, axis=1)
    z = (t[chosen] - at[:, None]) / step
    table = r[chosen]
    for j in range(1, chosen.shape[1]):
        gap = (z[:, j:] - z[:, :-j])[..., None]
        change = table[:, j:] - table[:, j - 1 : -1]
        with np.errstate(divide="ignore", invalid="ignore"):
            change = change / gap
        if j == 1 and v is not None:
            change = np.where(gap == 0.0, v[chosen[:, 1:]] * step, change)
        table = np.concatenate([table[:, :j], change], axis=1)
    value, slope = table[:, -1], np.zeros((len(at), 3))
    for j in range(chosen.shape[1] - 2, -1, -1):  # Horner's scheme at 0, which is the time asked for
        slope = value - z[:, j, None] * slope
        value = table[:, j] - z[:, j, None] * value
    return value, slope / step


def interpolated(t: Array, r: Array, v: Array | None, at: Array, degree: int | None) -> Interpolated:
    """States at times within those of the rows.

    Parameters
    ----------
    t, r, v : rows in order of time, (N,), (N, 3), (N, 3) or None
    at : (K,)
    degree : of the polynomial; None for the one that differs least from its neighbours

    Notes
    -----
    Where rows have velocities, Hermite's polynomials are tried and Lagrange's: velocities of some theories, SGP4 among them,
    are not the derivatives of its positions.
    """
    ways = [(1, None, LAGRANGE)] if v is None else [(2, v, HERMITE), (1, None, LAGRANGE)]
    tried = [one for each, slopes, counts in ways for one in _tried(t, r, slopes, at, degree, each, counts)]
    between = not np.isin(at, t).all()
    return min(tried, key=lambda one: one.error if between else one.slope_error)


def _tried(
    t: Array, r: Array, v: Array | None, at: Array, degree: int | None, each: int, counts: tuple[int, ...]
) -> Iterator[Interpolated]:
    """Polynomials of one kind, each compared with those of the next degrees below and above, as far as there are rows."""
    more = 2 // each
    rows = [c for c in counts if c <= len(t)] or [len(t)]
    if degree is not None:
        rows = [min(max((degree + each) // each, 2), len(t))]
    below, here = (polynomial(t, r, v, at, max(count, 1)) for count in (rows[0] - more, rows[0]))
    for count in rows:
        above = polynomial(t, r, v, at, min(count + more, len(t)))
        change = [
            float(np.linalg.norm([old - mine, new - mine], axis=-1).max(initial=0.0))
            for old, mine, new in zip(below, here, above, strict=True)
        ]
        yield Interpolated(*here, "Lagrange" if v is None else "Hermite", each * count - 1, *change)
        below, here = here, above
