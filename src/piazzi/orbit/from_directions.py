"""Orbits from three directions by the polynomial of the eighth degree: Gauss's and Laplace's methods."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.gooding import improved
from piazzi.orbit.initial import InitialOrbit, Three, three_directions


def gauss(times: Any, directions: Any, observers: Any, mu: float, improve: bool = True) -> tuple[InitialOrbit, ...]:
    """Orbits from three directions by Gauss's method, one for every root of its polynomial, smallest root first.

    Parameters
    ----------
    times : (3,) increasing, without light time (subtract it, or let the fit that follows do so)
    directions : (3, 3) from observer to body
    observers : (3, 3) positions of the observers from the centre, in the axes of the directions
    mu : gravitational parameter, in units that fit
    improve : change the ranges by Newton's method until Kepler's motion meets all three directions; without, the series alone

    Raises
    ------
    ValueError
        For another number of directions (with what those do determine), equal times, or directions in one plane.

    Notes
    -----
    Roots whose middle range is not positive are left out.  Where the improvement converges, the orbit meets all three
    directions, which `residual` tells; two roots may lead to one orbit.  Where it does not, the orbit is that of the
    series.  Good for arcs below some 60 degrees.
    Sources: Gauss, Theoria motus (1809); Escobal, Methods of Orbit Determination (1965), ch. 7; Curtis, Orbital Mechanics for
    Engineering Students (2014), algorithms 5.5 and 5.6.
    """
    given = three_directions(times, directions, observers, mu)
    given.check_spread("Gauss's method")
    t1, t3 = given.t[0] - given.t[1], given.t[2] - given.t[1]
    span = t3 - t1
    a1, a3 = t3 / span, -t1 / span
    b1, b3 = t3 * (span**2 - t3**2) / (6.0 * span), -t1 * (span**2 - t1**2) / (6.0 * span)
    N = np.linalg.solve(given.L.T, given.R.T)
    d1 = float((a1 * N[:, 0] - N[:, 1] + a3 * N[:, 2])[1])
    d2 = float((b1 * N[:, 0] + b3 * N[:, 2])[1]) * given.mu
    found = []
    for r2 in distances(d1, d2, float(given.L[1] @ given.R[1]), float(given.R[1] @ given.R[1])):
        u = given.mu / r2**3
        series = np.array([1.0 - 0.5 * u * t1**2, t1 - u * t1**3 / 6.0, 1.0 - 0.5 * u * t3**2, t3 - u * t3**3 / 6.0])
        ranges = _ranges(N, np.array([a1 + b1 * u, a3 + b3 * u]))
        if not ranges[1] > 0.0:
            continue
        first = given.orbit(given.R[1] + ranges[1] * given.L[1], _velocity(given, ranges, series), ranges)
        found.append(_improved(given, first) if improve else first)
    return tuple(found)


def laplace(
    times: Any, directions: Any, observers: Any, mu: float, observer_velocity: Any = None, observer_acceleration: Any = None
) -> tuple[InitialOrbit, ...]:
    """Orbits from three directions by Laplace's method, one for every root of its polynomial, smallest distance first.

    Parameters
    ----------
    times, directions, observers, mu : as of `gauss`
    observer_velocity, observer_acceleration : (3,) of the observer at the middle time; without, those of the parabola through
        the three observers, which must then be one and the same

    Raises
    ------
    ValueError
        As `gauss`.

    Notes
    -----
    Rates of the direction are those of a parabola through the three, so arcs must be short (those of the observer by the same
    parabola are often the better ones, because both errors go together): the orbit meets the
    middle direction
    only, and `residual` says by how much it misses the others.
    Sources: Laplace (1780); Escobal (1965), ch. 7; Vallado (2013), section 7.3.1.
    """
    given = three_directions(times, directions, observers, mu)
    given.check_spread("Laplace's method")
    L, dL, ddL = _parabola(given.t, given.L)
    R, dR, ddR = _parabola(given.t, given.R)
    dR = dR if observer_velocity is None else np.asarray(observer_velocity, dtype=float)
    ddR = ddR if observer_acceleration is None else np.asarray(observer_acceleration, dtype=float)
    across, along = np.cross(L, dL), np.cross(L, ddL)
    D = float(ddL @ across)
    d1, d2 = -float(ddR @ across) / D, -given.mu * float(R @ across) / D
    found = []
    for distance in distances(d1, d2, float(L @ R), float(R @ R)):
        u = given.mu / distance**3
        rho = d1 + d2 / distance**3
        if not rho > 0.0:
            continue
        rate = float((ddR + u * R) @ along) / (2.0 * D)
        r, v = R + rho * L, dR + rate * L + rho * dL
        ahead = [rho + rate * (t - given.t[1]) for t in given.t]
        found.append(given.orbit(r, v, np.array(ahead)))
    return tuple(found)


def distances(d1: float, d2: float, C: float, R2: float) -> Array:
    """Positive distances r, increasing, with r^2 = rho^2 + 2 C rho + R2 where rho = d1 + d2 / r^3: roots of degree 8."""
    unit = np.sqrt(R2)
    if not unit > 0.0:  # who watches from the centre sees no parallax
        return np.zeros(0)
    d1, d2, C = d1 / unit, d2 / unit**4, C / unit
    polynomial = np.array([1.0, 0.0, -(d1 * d1 + 2.0 * C * d1 + 1.0), 0.0, 0.0, -2.0 * d2 * (C + d1), 0.0, 0.0, -d2 * d2])
    roots = np.roots(polynomial)
    real = roots.real[(np.abs(roots.imag) <= 1e-6 * np.abs(roots)) & (roots.real > 0.0)]
    slope = np.polyder(polynomial)
    for _ in range(5):
        by = np.polyval(slope, real)
        real = real - np.where(by != 0.0, np.polyval(polynomial, real) / np.where(by != 0.0, by, 1.0), 0.0)
    return np.asarray(np.sort(real[np.isfinite(real) & (real > 0.0)]) * unit)


def _ranges(N: Array, c: Array) -> Array:
    """Ranges where the second position is c1 times the first and c3 times the third."""
    x = -c[0] * N[:, 0] + N[:, 1] - c[1] * N[:, 2]
    return np.array([x[0] / c[0], -x[1], x[2] / c[1]])


def _velocity(given: Three, ranges: Array, fg: Array) -> Array:
    r = given.R + ranges[:, None] * given.L
    f1, g1, f3, g3 = fg
    return np.asarray((f1 * r[2] - f3 * r[0]) / (f1 * g3 - f3 * g1))


def _improved(given: Three, first: InitialOrbit) -> InitialOrbit:
    """The orbit next to a first one that meets all three directions, or the first one where none is found."""
    if not (first.ranges > 0.0).all():
        return first
    normal = np.cross(first.r, first.v)
    better = improved(given, first.ranges, normal / np.linalg.norm(normal)) if normal.any() else None
    return better or first


def _parabola(t: Array, values: Array) -> tuple[Array, Array, Array]:
    """Value and two derivatives at the middle time of the parabola through three rows."""
    a, b = t[0] - t[1], t[2] - t[1]
    slopes = (values[0] - values[1]) / a, (values[2] - values[1]) / b
    return values[1], (b * slopes[0] - a * slopes[1]) / (b - a), 2.0 * (slopes[1] - slopes[0]) / (b - a)
