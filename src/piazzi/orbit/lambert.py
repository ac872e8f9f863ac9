"""Lambert's problem: orbits through two positions in a given time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.differential import check_mu
from piazzi.orbit.library import orbit_library

NORTH = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Transfer:
    """One orbit through two positions.

    Attributes
    ----------
    v1, v2 : (3,) velocities at the two positions
    prograde : whether the motion is about the axis, or against it
    turns : full revolutions before the second position
    late : which of the two orbits with as many turns (see `lambert`); None without turns
    """

    v1: Array
    v2: Array
    prograde: bool
    turns: int
    late: bool | None


def lambert(
    r1: Any, r2: Any, dt: Any, mu: float, *, prograde: Any = True, turns: Any = 0, late: Any = False, about: Any = NORTH
) -> tuple[Array, Array]:
    """Velocities (..., 3) at two positions that are `dt` apart on one orbit.

    Parameters
    ----------
    r1, r2 : (..., 3) positions from the centre; shapes broadcast, with all but `mu` and `about`
    dt : (...) time from the first to the second, positive
    mu : gravitational parameter, in units that fit the others
    prograde : whether the motion is about the axis `about` (angular momentum along it), or against it
    turns : full revolutions before the second position
    late : of the two orbits that make as many turns, that with the apocentre in the last one: the larger x of Izzo
    about : axis, (3,): the north pole; where the positions are on one line through the centre, it is the normal of the plane

    Returns
    -------
    v1, v2 : (..., 3), NaN where there is no time for so many turns

    Raises
    ------
    ValueError
        For shapes that do not fit, values that are not finite, a position at the centre, times that are not positive, equal
        positions, or a line through the centre along the axis, which leaves the plane open.

    Notes
    -----
    Izzo's unknown, Halley's method within a bracket, series where digits would be lost: velocities are as good as the
    positions and the time define them, on every conic.  Sources: Izzo, Celestial Mechanics and Dynamical Astronomy 121
    (2015); Gooding, same journal 48 (1990); Battin (1999), ch. 7.
    """
    r1, r2, dt, shape = _checked(r1, r2, dt, mu, (prograde, turns, late))
    axis = _axis(about, r1, r2)
    back = np.where(np.asarray(prograde, dtype=bool), 0.0, 1.0)
    which = [np.broadcast_to(np.asarray(w, dtype=float), shape).reshape(-1) for w in (back, turns, late)]
    if np.any(which[1] < 0) or np.any(which[1] != np.round(which[1])):
        raise ValueError(f"turns are {np.asarray(turns).flat[0]}; they must be whole numbers from 0")
    out = np.empty((len(dt), 6))
    orbit_library().lambert(r1, r2, dt, axis, np.stack(which, -1), float(mu), out, len(dt))
    out = out.reshape((*shape, 6))
    return out[..., :3], out[..., 3:]


def lambert_all(r1: Any, r2: Any, dt: float, mu: float, *, about: Any = NORTH) -> tuple[Transfer, ...]:
    """Every orbit through two positions (3,) that are `dt` apart: both ways around, with every number of turns.

    Of the motion against `about` second; with no turns first; of as many turns the early one first.  Errors as of `lambert`.
    """
    r1, r2, at, shape = _checked(r1, r2, dt, mu, ())
    if shape:
        raise ValueError(f"positions have the shape {(*shape, 3)}; all orbits are found for one pair, (3,)")
    axis = _axis(about, r1, r2)
    found = []
    for prograde in (True, False):
        most = np.empty(1)
        orbit_library().lambert_most(r1, r2, at, axis, 0.0 if prograde else 1.0, float(mu), most, 1)
        wanted = [(0, None), *((m, late) for m in range(1, int(most[0]) + 1) for late in (False, True))]
        for turns, late in wanted:
            v1, v2 = lambert(r1[0], r2[0], dt, mu, prograde=prograde, turns=turns, late=bool(late), about=about)
            found.append(Transfer(v1, v2, prograde, turns, late))
    return tuple(found)


def _checked(r1: Any, r2: Any, dt: Any, mu: float, others: tuple[Any, ...]) -> tuple[Array, Array, Array, tuple[int, ...]]:
    """Positions (K, 3) and times (K,) in rows, and the shape they came in."""
    r1, r2, dt = (np.asarray(a, dtype=float) for a in (r1, r2, dt))
    check_mu(mu)
    for what, a in (("r1", r1), ("r2", r2)):
        if a.shape[-1:] != (3,):
            raise ValueError(f"{what} has shape {a.shape}; it must be (..., 3)")
        if not np.isfinite(a).all():
            raise ValueError(f"{what} is {a}; it must be finite")
        if not a.any(axis=-1).all():
            raise ValueError(f"{what} is zero: a position at the centre of attraction is on no orbit")
    if not (np.isfinite(dt).all() and (dt > 0.0).all()):
        wrong = dt[~(np.isfinite(dt) & (dt > 0.0))].flat[0]
        raise ValueError(f"the time between the positions is {wrong:g}; it must be positive")
    shape = np.broadcast_shapes(r1.shape[:-1], r2.shape[:-1], dt.shape, *(np.shape(o) for o in others))
    r1, r2 = (np.ascontiguousarray(np.broadcast_to(a, (*shape, 3)).reshape(-1, 3)) for a in (r1, r2))
    if np.any(np.all(r1 == r2, axis=-1)):
        raise ValueError("the two positions are equal: any plane, and any period that fits the time, leads back there")
    return r1, r2, np.ascontiguousarray(np.broadcast_to(dt, shape).reshape(-1)), shape


def _axis(about: Any, r1: Array, r2: Array) -> Array:
    axis = np.asarray(about, dtype=float)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        raise ValueError(f"axis of the motion is {about}; it must be three numbers, not all zero")
    axis = np.asarray(axis / np.linalg.norm(axis))
    u1, u2 = (r / np.linalg.norm(r, axis=-1)[:, None] for r in (r1, r2))
    line = np.linalg.norm(np.cross(u1, u2), axis=-1) < 1e-14
    if np.any(line & (np.linalg.norm(np.cross(u1, axis), axis=-1) < 1e-8)):
        raise ValueError("the positions and the axis are on one line, which leaves the plane open; give another `about`")
    return axis
