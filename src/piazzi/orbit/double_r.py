"""Orbits from three directions by the double-r method: two distances from the centre are changed until both times fit."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.anomalies import from_true
from piazzi.orbit.initial import InitialOrbit, Three, three_directions

STARTS = (0.3, 0.6, 1.05, 1.3, 1.7, 2.3, 3.3, 4.5, 6.6, 10.0)  # distances from the centre, in those of the observer
_STEP = 1e-6
_SAME = 1e-7


def double_r(
    times: Any,
    directions: Any,
    observers: Any,
    mu: float,
    *,
    prograde: bool | None = None,
    guess: tuple[float, float] | None = None,
) -> tuple[InitialOrbit, ...]:
    """Orbits through three directions, the smallest distance first.

    Parameters
    ----------
    times, directions, observers, mu : as of `gauss`; directions may lie in one plane
    prograde : whether the angular momentum points north, along the third axis, or south; None for both, one after the other
    guess : distances from the centre at the first two times; default pairs of ten that lie about that of the observer

    Raises
    ------
    ValueError
        As `gauss`, but for the plane.

    Notes
    -----
    Two distances put the first two positions on their lines of sight, and their plane the third; the conic through
    the three has
    its times, by Kepler's equation.  Newton's method makes them those of the observations.  Less than one turn in all.
    Sources: Escobal, Methods of Orbit Determination (1965), ch. 7; Vallado (2013), algorithm 53.
    """
    given = three_directions(times, directions, observers, mu)
    scale = float(np.linalg.norm(given.R[1])) or float(np.linalg.norm(given.R, axis=1).max())
    starts = [guess] if guess is not None else [(scale * a, scale * b) for a in STARTS for b in STARTS if 0.5 < a / b < 2.0]
    found: list[InitialOrbit] = []
    for start, north in [(s, north) for north in ((True, False) if prograde is None else (prograde,)) for s in starts]:
        with np.errstate(all="ignore"):
            ends = _newton(given, np.log(np.asarray(start, dtype=float)), north)
        if ends is None or any(np.linalg.norm(o.r - ends.r) < _SAME * np.linalg.norm(o.r) for o in found):
            continue
        found.append(ends)
    return tuple(sorted(found, key=lambda orbit: float(np.linalg.norm(orbit.r))))


def _newton(given: Three, x: Array, prograde: bool) -> InitialOrbit | None:
    """The orbit next to logarithms of two distances, None where there is none."""
    miss = _miss(given, x, prograde)
    for _ in range(60):
        if not np.isfinite(miss).all():
            return None
        J = np.stack([(_miss(given, x + _STEP * e, prograde) - _miss(given, x - _STEP * e, prograde)) for e in np.eye(2)], -1)
        J /= 2.0 * _STEP
        if not np.isfinite(J).all() or np.linalg.det(J) == 0.0:
            return None
        step = np.linalg.solve(J, -miss)
        share = min(1.0, 0.3 / max(np.abs(step).max(), 1e-300))
        for _ in range(10):
            new = _miss(given, x + share * step, prograde)
            if np.isfinite(new).all() and np.abs(new).max() < np.abs(miss).max():
                break
            share *= 0.5
        else:
            break
        x, miss = x + share * step, new
        if np.abs(step).max() < 1e-14:
            break
    if not np.abs(miss).max() < 1e-10:
        return None
    conic = _conic(given, np.exp(x), prograde)
    return None if conic is None or not (conic[2] > 0.0).all() else given.orbit(*conic)


def _miss(given: Three, x: Array, prograde: bool) -> Array:
    """By how much both intervals are off, in parts of the whole."""
    shape = _shape(given, np.exp(x), prograde)
    if shape is None:
        return np.full(2, np.nan)
    _, p, e, true, _ = shape
    alpha = (1.0 - e) * (1.0 + e) / p
    if not np.isfinite(alpha) or e == 1.0 or (e > 1.0 and np.any(1.0 + e * np.cos(true) <= 0.0)):
        return np.full(2, np.nan)
    if e > 1.0:
        true = np.arctan2(np.sin(true), np.cos(true))
    M = from_true(true, e, "mean")
    found = (M - M[1]) / np.sqrt(given.mu * abs(alpha) ** 3)
    wanted = given.t - given.t[1]
    return np.asarray((found - wanted)[[0, 2]] / (given.t[2] - given.t[0]))


def _shape(given: Three, distances: Array, prograde: bool) -> tuple[Array, float, float, Array, Array] | None:
    """Positions (3, 3), p, e, true anomalies that grow, and the normal of the conic; None where there is none."""
    L, R = given.L, given.R
    along = np.sum(L[:2] * R[:2], axis=1)
    inside = along**2 - np.sum(R[:2] ** 2, axis=1) + distances**2
    if not (inside >= 0.0).all():
        return None
    rho = np.append(-along + np.sqrt(inside), 0.0)
    r = R + rho[:, None] * L
    n = np.cross(r[0], r[1])
    size = np.linalg.norm(n)
    if not size > 0.0:
        return None
    n = n / size * (1.0 if (n[2] >= 0.0) == prograde else -1.0)
    r[2] = R[2] - (R[2] @ n) / (L[2] @ n) * L[2]
    d = np.linalg.norm(r, axis=1)
    u = r[0] / d[0]
    w = np.cross(n, u)
    angle = np.arctan2(r @ w, r @ u)
    angle = angle - angle[0]
    angle[1:] %= 2.0 * np.pi
    if angle[2] < angle[1]:
        angle[2] += 2.0 * np.pi
    rows = np.stack([np.ones(3), -(r @ u), -(r @ w)], -1)
    if not np.isfinite(rows).all() or abs(np.linalg.det(rows / d[:, None])) < 1e-15:
        return None
    p, ex, ey = np.linalg.solve(rows, d)  # r = p - e . r
    if not p > 0.0:
        return None
    true = angle - np.arctan2(ey, ex)
    return r, float(p), float(np.hypot(ex, ey)), true, n


def _conic(given: Three, distances: Array, prograde: bool) -> tuple[Array, Array, Array] | None:
    """Position and velocity at the middle, and the three ranges."""
    shape = _shape(given, distances, prograde)
    if shape is None:
        return None
    r, p, e, true, n = shape
    d = np.linalg.norm(r[1])
    radial = np.sqrt(given.mu / p) * e * np.sin(true[1])
    v = radial * r[1] / d + np.sqrt(given.mu * p) / d * np.cross(n, r[1] / d)
    return r[1], v, np.sum((r - given.R) * given.L, axis=1)
