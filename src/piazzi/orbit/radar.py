"""Orbits from radar plots: range and direction, with or without range-rate, at two times and more."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.differential import check_mu
from piazzi.orbit.initial import InitialOrbit
from piazzi.orbit.lambert import NORTH, lambert_all
from piazzi.orbit.two_body import propagate_kepler


def radar(
    times: Any,
    ranges: Any,
    directions: Any,
    observers: Any,
    mu: float,
    range_rates: Any = None,
    observer_velocities: Any = None,
    *,
    about: Any = NORTH,
) -> tuple[InitialOrbit, ...]:
    """Orbits through the first and the last of K radar plots, that first which meets the others and the range rates best.

    Parameters
    ----------
    times : (K,) increasing, two and more
    ranges, range_rates : (K,), rates positive when receding; without, only the plots between tell orbits apart
    directions : (K, 3) from observer to body
    observers, observer_velocities : (K, 3), or (3,) of one that stands still or moves on, inertial
    mu : gravitational parameter, in units that fit
    about : axis of prograde motion; see `lambert`

    Returns
    -------
    tuple of InitialOrbit, each with the state at the first time, the given ranges and positions, and as `residual`
    the largest
    angle between a position and that of two-body motion, as seen from the centre, range rates included as such an angle

    Raises
    ------
    ValueError
        For one plot (with what it determines), times that do not increase, or values that make no sense.

    Notes
    -----
    With every number of turns for which there is time, both ways around: two plots alone leave all of them.
    """
    t, rho, L, R, V, rates = _plots(times, ranges, directions, observers, range_rates, observer_velocities)
    check_mu(mu)
    r = R + rho[:, None] * L
    found = []
    for transfer in lambert_all(r[0], r[-1], float(t[-1] - t[0]), mu, about=about):
        position, velocity = propagate_kepler(r[0], transfer.v1, mu, t - t[0])
        off = np.linalg.norm(position - r, axis=1) / np.linalg.norm(r, axis=1)
        if rates is not None:
            computed = np.sum(L * (velocity - V), axis=1)
            off = np.append(off, np.abs(computed - rates) / np.linalg.norm(velocity, axis=1))
        found.append(InitialOrbit(float(t[0]), r[0], transfer.v1, rho, r, float(off.max())))
    return tuple(sorted(found, key=lambda orbit: orbit.residual))


def _plots(
    times: Any, ranges: Any, directions: Any, observers: Any, range_rates: Any, observer_velocities: Any
) -> tuple[Array, Array, Array, Array, Array, Array | None]:
    t, rho, L = (np.asarray(a, dtype=float) for a in (times, ranges, directions))
    if t.ndim != 1 or rho.shape != t.shape or L.shape != (len(t), 3):
        raise ValueError(
            f"times have shape {t.shape}, ranges {rho.shape} and directions {L.shape}; they must be (K,) and (K, 3)"
        )
    if len(t) < 2:
        raise ValueError(
            "one plot of range, range-rate and direction is four numbers of the six of an orbit: the velocity across the line "
            "of sight is open; two plots are needed, or rates of the direction (see range_to_state)"
        )
    if not (np.isfinite(t).all() and (np.diff(t) > 0.0).all()):
        raise ValueError(f"times are {', '.join(f'{x:g}' for x in t)}; they must increase")
    if not (np.isfinite(rho).all() and (rho > 0.0).all()):
        raise ValueError(f"range is {rho[~(rho > 0.0)].flat[0]:g}; it must be positive")
    length = np.linalg.norm(L, axis=1)
    if not (np.isfinite(length).all() and (length > 0.0).all()):
        raise ValueError("a direction is zero or not finite")
    rates = None if range_rates is None else np.asarray(range_rates, dtype=float)
    if rates is not None and (rates.shape != t.shape or not np.isfinite(rates).all()):
        raise ValueError(f"range rates have shape {rates.shape}; they must be ({len(t)},) and finite")
    R = np.broadcast_to(np.asarray(observers, dtype=float), L.shape)
    V = np.broadcast_to(np.asarray(0.0 if observer_velocities is None else observer_velocities, dtype=float), L.shape)
    return t, rho, L / length[:, None], R, V, rates
