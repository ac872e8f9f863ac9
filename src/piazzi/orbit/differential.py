"""How the shape and the axes of an orbit change with its state: what every set of elements is derived from.

A change of the state turns the axes (u, t, n), radial, transverse and normal, by a small vector, and changes the
semi-latus rectum p and the two numbers c = e cos(nu) = p/r - 1 and s = e sin(nu).  All six are regular wherever there is an
angular momentum.  Source: Broucke and Cefola, Celestial Mechanics 5 (1972), for the idea; derived here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array


class Motion(NamedTuple):
    """Shape and axes of the orbits of states (...): numbers (...), axes (..., 3)."""

    r: Array
    radial_speed: Array
    h: Array
    p: Array
    c: Array
    s: Array
    alpha: Array  # 1 / a
    u: Array
    t: Array
    n: Array


class Differential(NamedTuple):
    """Derivatives, (..., 6), by position and velocity, of p, c and s and of the turn of the axes about u, t and n."""

    p: Array
    c: Array
    s: Array
    about_u: Array
    about_t: Array
    about_n: Array


def states(r: Any, v: Any, mu: float) -> tuple[Array, Array]:
    """Position and velocity, (..., 3), checked.

    Raises
    ------
    ValueError
        For a wrong shape, a value that is not finite, a position at the centre, or `mu` that is not positive.
    """
    r, v = np.asarray(r, dtype=float), np.asarray(v, dtype=float)
    for what, values in (("position", r), ("velocity", v)):
        if values.shape[-1:] != (3,):
            raise ValueError(f"{what} has shape {values.shape}; it must be (..., 3)")
        if not np.isfinite(values).all():
            raise ValueError(f"{what} is {values}; it must be finite")
    check_mu(mu)
    r, v = np.broadcast_arrays(r, v)
    if not r.any(axis=-1).all():
        raise ValueError("position is zero: at the centre of attraction there is no orbit")
    return r, v


def check_mu(mu: float) -> None:
    """Raise ValueError unless the gravitational parameter is positive."""
    if not (np.isfinite(mu) and mu > 0):
        raise ValueError(f"mu is {mu}; it must be positive")


def motion(r: Array, v: Array, mu: float) -> Motion:
    """Shape and axes of the orbits of states; raises ValueError where motion is along the radius, which has no plane."""
    distance = np.linalg.norm(r, axis=-1)
    u = r / distance[..., None]
    momentum = np.cross(r, v)
    h = np.linalg.norm(momentum, axis=-1)
    if not np.all(h > 0.0):
        raise ValueError("velocity is along the position: motion on a straight line has no plane and no elements")
    n = momentum / h[..., None]
    p = h * h / mu
    radial_speed = np.sum(u * v, axis=-1)
    alpha = 2.0 / distance - np.sum(v * v, axis=-1) / mu
    return Motion(distance, radial_speed, h, p, p / distance - 1.0, np.sqrt(p / mu) * radial_speed, alpha, u, np.cross(n, u), n)


def differential(m: Motion, v: Array, mu: float) -> Differential:
    """Derivatives of shape and axes by the state."""
    r, u, t, n = m.r[..., None], m.u, m.t, m.n
    zero = np.zeros_like(u)
    dr = np.concatenate([u, zero], -1)
    dh = np.concatenate([np.cross(v, n), r * t], -1)  # of the length of r x v
    dp = (2.0 * m.h / mu)[..., None] * dh
    speed = m.radial_speed[..., None]
    transverse = (m.h / m.r)[..., None]
    dspeed = np.concatenate([transverse / r * t, u], -1)
    dc = dp / r - (m.p / m.r**2)[..., None] * dr
    root = np.sqrt(m.p / mu)[..., None]
    ds = root * dspeed + (m.s / (2.0 * m.p))[..., None] * dp
    about_n = np.concatenate([t / r, zero], -1)
    about_t = np.concatenate([-n / r, zero], -1)
    about_u = np.concatenate([-speed * n, r * n], -1) / m.h[..., None]
    return Differential(dp, dc, ds, about_u, about_t, about_n)
