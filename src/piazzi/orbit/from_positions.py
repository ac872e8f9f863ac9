"""A velocity from three positions: Gibbs's and Herrick and Gibbs's methods."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.initial import three_positions

MOST_OFF_PLANE = np.radians(5.0)  # of the first position, off the plane of the others


def gibbs(positions: Any, mu: float) -> Array:
    """Velocity (3,) at the second of three positions (3, 3) of one orbit; no times are needed.

    Parameters
    ----------
    positions : in order of time; the farther apart, the better: below 1 degree take `herrick_gibbs`
    mu : gravitational parameter, in units that fit

    Raises
    ------
    ValueError
        For fewer than three positions, positions on one line through the centre, more than 5 degrees out of one
        plane, or that no conic about the centre passes through in that order.

    Notes
    -----
    Source: Gibbs (1889); Vallado, Fundamentals of Astrodynamics and Applications (2013), algorithm 54.
    """
    r = three_positions(positions, mu)
    d = np.linalg.norm(r, axis=1)
    Z12, Z23, Z31 = np.cross(r[0], r[1]), np.cross(r[1], r[2]), np.cross(r[2], r[0])
    if not min(np.linalg.norm(Z12) / (d[0] * d[1]), np.linalg.norm(Z23) / (d[1] * d[2])) > 1e-12:
        raise ValueError("two of the positions are on one line through the centre, which leaves the plane of the orbit open")
    off = np.arcsin(np.clip(r[0] @ Z23 / (d[0] * np.linalg.norm(Z23)), -1.0, 1.0))
    if abs(off) > MOST_OFF_PLANE:
        raise ValueError(f"the first position is {np.degrees(abs(off)):.3g} deg out of the plane of the others: no one orbit")
    N = d[0] * Z23 + d[1] * Z31 + d[2] * Z12
    D = Z12 + Z23 + Z31
    S = (d[1] - d[2]) * r[0] + (d[2] - d[0]) * r[1] + (d[0] - d[1]) * r[2]
    if not N @ D > 0.0:
        raise ValueError("no conic about the centre passes through the three positions in that order")
    return np.asarray(np.sqrt(mu / (np.linalg.norm(N) * np.linalg.norm(D))) * (np.cross(D, r[1]) / d[1] + S))


def herrick_gibbs(positions: Any, times: Any, mu: float) -> Array:
    """Velocity (3,) at the second of three positions (3, 3) that lie close together, by a Taylor series.

    Parameters
    ----------
    positions : in order of time, not much more than 1 degree apart (5 at most)
    times : (3,) increasing
    mu : gravitational parameter, in units that fit

    Raises
    ------
    ValueError
        For fewer than three positions or times that do not increase.

    Notes
    -----
    The error grows with the fourth power of the time between.  Source: Herrick, Astrodynamics (1971); Vallado
    (2013), algorithm 55.
    """
    r, t = three_positions(positions, mu), np.asarray(times, dtype=float)
    if t.shape != (3,) or not np.isfinite(t).all():
        raise ValueError(f"times are {times}; they must be three numbers")
    if np.ptp(t) == 0.0:
        raise ValueError(f"all three positions are at one time, {t[0]:g}: they say nothing about motion")
    if not (np.diff(t) > 0.0).all():
        raise ValueError(f"times are {', '.join(f'{x:g}' for x in t)}; they must increase")
    t31, t32, t21 = t[2] - t[0], t[2] - t[1], t[1] - t[0]
    pull = mu / (12.0 * np.linalg.norm(r, axis=1) ** 3)
    return np.asarray(
        -t32 * (1.0 / (t21 * t31) + pull[0]) * r[0]
        + (t32 - t21) * (1.0 / (t21 * t32) + pull[1]) * r[1]
        + t21 * (1.0 / (t32 * t31) + pull[2]) * r[2]
    )
