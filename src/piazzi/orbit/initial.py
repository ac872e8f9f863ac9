"""What the methods of initial orbits share: their answer, and the checks of what they are given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.differential import check_mu
from piazzi.orbit.two_body import propagate_kepler
from piazzi.text import brief


@dataclass(frozen=True, eq=False)
class InitialOrbit:
    """An orbit that a few observations allow.

    Attributes
    ----------
    t : time of the state, that of the middle observation (of `radar` the first)
    r, v : (3,) position and velocity from the centre, in the units of what was given
    ranges : (3,) distances from the observers (of `radar` K)
    positions : (3, 3) the body at the three times, as the method has it
    residual : the largest angle, in radians, between a direction observed and that of two-body motion from `r` and `v`
    """

    t: float
    r: Array
    v: Array
    ranges: Array
    positions: Array
    residual: float

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Three:
    """Three directions, checked: times (3,), unit vectors (3, 3), observers (3, 3), gravitational parameter."""

    t: Array
    L: Array
    R: Array
    mu: float

    def orbit(self, r: Array, v: Array, ranges: Array) -> InitialOrbit:
        """The answer, with how well two-body motion meets the directions."""
        seen = propagate_kepler(r, v, self.mu, self.t - self.t[1])[0] - self.R
        across = np.linalg.norm(np.cross(self.L, seen), axis=1)
        residual = np.arctan2(across, np.sum(self.L * seen, axis=1)).max()
        return InitialOrbit(float(self.t[1]), r, v, ranges, self.R + ranges[:, None] * self.L, float(residual))

    def check_spread(self, method: str) -> None:
        """Raise ValueError where the directions lie in one plane, which leaves ranges open."""
        a, b = np.cross(self.L[0], self.L[1]), np.cross(self.L[1], self.L[2])
        sides = np.linalg.norm(a) * np.linalg.norm(b)
        if not abs(a @ self.L[2]) > 1e-9 * sides:
            raise ValueError(
                f"the three directions lie in one plane, in which {method} cannot tell the ranges; take double_r or gooding"
            )


def three_directions(times: Any, directions: Any, observers: Any, mu: float) -> Three:
    """What angles-only methods work on.

    Parameters
    ----------
    times : (3,) in increasing order
    directions : (3, 3) from observer to body; their lengths do not matter
    observers : (3, 3), or (3,) for one that stands still, from the centre
    mu : gravitational parameter

    Raises
    ------
    ValueError
        For another number of observations (with what those do determine), equal times, values that are not finite, equal
        directions.
    """
    t, L, R = (np.asarray(a, dtype=float) for a in (times, directions, observers))
    check_mu(mu)
    if t.ndim != 1 or L.shape != (len(t), 3):
        raise ValueError(f"times have shape {t.shape} and directions {L.shape}; they must be (3,) and (3, 3)")
    if len(t) < 3:
        raise ValueError(_too_few(len(t)))
    if len(t) > 3:
        raise ValueError(f"there are {len(t)} directions; this method takes three: choose the first, a middle one and the last")
    R = np.broadcast_to(R, (3, 3)) if R.shape == (3,) else R
    if R.shape != (3, 3):
        raise ValueError(f"observers have shape {R.shape}; they must be (3, 3)")
    if not (np.isfinite(t).all() and np.isfinite(L).all() and np.isfinite(R).all()):
        raise ValueError("a time, a direction or an observer is not finite")
    if np.ptp(t) == 0.0:
        raise ValueError(f"all three directions are at one time, {t[0]:g}: they say nothing about motion")
    if not (np.diff(t) > 0.0).all():
        raise ValueError(f"times are {', '.join(f'{x:g}' for x in t)}; they must increase")
    length = np.linalg.norm(L, axis=1)
    if not (length > 0.0).all():
        raise ValueError("a direction is zero")
    L = L / length[:, None]
    if min(np.linalg.norm(L[0] - L[1]), np.linalg.norm(L[1] - L[2])) == 0.0 and np.ptp(R, axis=0).max() == 0.0:
        raise ValueError("two of the directions are equal, and seen from one place: they determine no motion")
    return Three(t, L, R, float(mu))


def _too_few(count: int) -> str:
    if count == 2:
        return (
            "two directions are four numbers of the six of an orbit: with a pair of ranges each gives one orbit (see lambert); "
            "three directions are needed"
        )
    if count == 1:
        return "one direction gives two numbers of the six of an orbit: where it is seen, not how far; three are needed"
    return "there are no directions; three are needed"


def three_positions(positions: Any, mu: float) -> Array:
    """Three positions (3, 3), checked; ValueError says what fewer determine."""
    r = np.asarray(positions, dtype=float)
    check_mu(mu)
    if r.ndim == 2 and r.shape[1] == 3 and len(r) == 2:
        raise ValueError("two positions determine an orbit with the time between them: see lambert; this method takes three")
    if r.shape != (3, 3):
        raise ValueError(f"positions have shape {r.shape}; they must be (3, 3)")
    if not np.isfinite(r).all():
        raise ValueError("a position is not finite")
    if not r.any(axis=1).all():
        raise ValueError("a position is zero: at the centre of attraction there is no orbit")
    return r
