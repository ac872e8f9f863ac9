"""Two-body motion of single states, on any conic, without a model: the kernels' own formulas, uncompiled for few."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.arrays import Array
from piazzi.kernels.fragments.kepler import kepler_motion, kepler_partials
from piazzi.orbit.library import orbit_library

MANY = 1000  # states: from here on it pays to load compiled code


def propagate_kepler(r: Any, v: Any, mu: float, dt: Any) -> tuple[Array, Array]:
    """Position and velocity `dt` later (or, where it is negative, earlier), in the units of what is given.

    Parameters
    ----------
    r, v : (..., d)
        Position and velocity in d dimensions; shapes broadcast against each other and against `dt`.
    mu : float
        Gravitational parameter.
    dt : float or (...)

    Returns
    -------
    r, v : ndarray, shape (..., d)

    Raises
    ------
    ValueError
        For shapes that do not fit, a position at the centre, values that are not finite, or `mu` not positive.

    Notes
    -----
    About 0.1 ms a state; from a thousand states in three dimensions on, compiled code takes 1 us each.  Source: Shepperd,
    Celestial Mechanics 35 (1985), in universal functions.
    """
    r, v, dt = _checked(r, v, mu, dt)
    if dt.size >= MANY and r.shape[-1] == 3 and kernels.is_compiled():
        return _many(r, v, mu, dt)
    new = np.empty((*dt.shape, 2, r.shape[-1]))
    with np.errstate(all="ignore"):
        for i in np.ndindex(dt.shape):
            F, G, Ft, Gt = kepler_motion(np.sqrt(r[i] @ r[i]), r[i] @ v[i], v[i] @ v[i], mu, float(dt[i]))
            new[i] = F * r[i] + G * v[i], Ft * r[i] + Gt * v[i]
    return new[..., 0, :], new[..., 1, :]


def _many(r: Array, v: Array, mu: float, dt: Array) -> tuple[Array, Array]:
    rows = [np.ascontiguousarray(a).reshape(-1, 3) for a in (r, v)]
    out = np.empty((dt.size, 6))
    orbit_library().kepler_arcs(*rows, np.ascontiguousarray(dt).reshape(-1), float(mu), out, dt.size)
    return out[:, :3].reshape(r.shape), out[:, 3:].reshape(r.shape)


def kepler_transition(r: Any, v: Any, mu: float, dt: float) -> Array:
    """Derivative of position and velocity `dt` later with respect to position and velocity now, (2 d, 2 d).

    Raises
    ------
    ValueError
        As `propagate_kepler`.
    """
    r, v, at = _checked(r, v, mu, dt)
    if r.ndim != 1:
        raise ValueError(f"r has shape {r.shape}; a transition matrix is of one state, (d,)")
    d, r0 = len(r), np.sqrt(r @ r)
    with np.errstate(all="ignore"):
        F, G, Ft, Gt, *by = kepler_partials(r0, r @ v, v @ v, mu, float(at))
    zero, one = np.zeros(d), np.eye(d)
    change = np.array([[*(r / r0), *zero], [*v, *r], [*(-2 * mu / r0**3 * r), *(-2 * v)], np.zeros(2 * d)])
    dF, dG, dFt, dGt = (row @ change for row in by)
    top = np.outer(r, dF) + np.outer(v, dG) + np.hstack([F * one, G * one])
    bottom = np.outer(r, dFt) + np.outer(v, dGt) + np.hstack([Ft * one, Gt * one])
    return np.vstack([top, bottom])


def _checked(r: Any, v: Any, mu: float, dt: Any) -> tuple[Array, Array, Array]:
    """Position, velocity and time in their common shape."""
    r, v, dt = (np.asarray(a, dtype=float) for a in (r, v, dt))
    if r.ndim < 1 or v.ndim < 1 or r.shape[-1] != v.shape[-1] or not r.shape[-1]:
        raise ValueError(f"r has shape {r.shape} and v {v.shape}; both need the same number of components, (..., d)")
    if not (np.isfinite(mu) and mu > 0):
        raise ValueError(f"mu is {mu}; it must be positive")
    shape = np.broadcast_shapes(r.shape[:-1], v.shape[:-1], dt.shape)
    for what, a in (("r", r), ("v", v), ("dt", dt)):
        if not np.isfinite(a).all():
            raise ValueError(f"{what} is {a}; it must be finite")
    if not r.any(axis=-1).all():
        raise ValueError("r is zero: at the centre of attraction there is no motion to continue")
    d = r.shape[-1]
    return np.broadcast_to(r, (*shape, d)), np.broadcast_to(v, (*shape, d)), np.broadcast_to(dt, shape)
