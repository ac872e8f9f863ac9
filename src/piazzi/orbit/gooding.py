"""Orbits from three directions by Gooding's method: all of them, over any arc, with any number of turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.initial import InitialOrbit, Three, three_directions
from piazzi.orbit.lambert import NORTH, lambert
from piazzi.orbit.library import orbit_library
from piazzi.orbit.two_body import propagate_kepler

GRID = 20  # starts along each of the two ranges
_MET = 1e-11  # rad: a middle direction that is met
_SAME = 1e-7


def gooding(
    times: Any,
    directions: Any,
    observers: Any,
    mu: float,
    *,
    turns: int = 0,
    ranges: tuple[float, float] | None = None,
    about: Any = NORTH,
) -> tuple[InitialOrbit, ...]:
    """All orbits through three directions, the nearest first.

    Parameters
    ----------
    times, directions, observers, mu : as of `gauss`; directions may lie in one plane
    turns : full revolutions between the first and the last at most
    ranges : between which distances from the observer they are looked for; default a hundredth to twenty times the distance
        of the second observer from the centre
    about : axis of prograde motion, of which both ways around are tried; see `lambert`

    Raises
    ------
    ValueError
        As `gauss`, but for the plane; for limits that are not positive and increasing.

    Notes
    -----
    Two ranges give an orbit by Lambert's problem; they are changed until it passes through the middle direction.
    That is done
    from 400 pairs of ranges, for each way around and each number of turns, and every end is kept once, so none but a very
    narrow one is missed.  About 0.1 s for each number of turns.
    Source: Gooding, Celestial Mechanics and Dynamical Astronomy 66 (1997).
    """
    given = three_directions(times, directions, observers, mu)
    scale = float(np.linalg.norm(given.R[1])) or float(np.linalg.norm(given.R, axis=1).max())
    low, high = (0.01 * scale, 20.0 * scale) if ranges is None else ranges
    if not 0.0 < low < high < np.inf:
        raise ValueError(f"ranges are {low:g} to {high:g}; they must be positive and increase")
    if turns < 0 or turns != int(turns):
        raise ValueError(f"turns are {turns}; they must be a whole number from 0")
    grid = np.log(low) + (np.arange(GRID) + 0.5) / GRID * np.log(high / low)
    starts = np.stack(np.meshgrid(grid, grid, indexing="ij"), -1).reshape(-1, 2)
    axis = np.asarray(about, dtype=float) / np.linalg.norm(about)
    found: list[tuple[Array, InitialOrbit]] = []
    for prograde in (True, False):
        for m in range(int(turns) + 1):
            for late in (False, True) if m else (False,):
                ends = _ends(given, starts, axis, (0.0 if prograde else 1.0, float(m), float(late)))
                for end in ends[(ends[:, :3] >= low).all(axis=1) & (ends[:, :3] <= high).all(axis=1)]:
                    if not any(np.abs(end[:3] / other - 1.0).max() < _SAME for other, _ in found):
                        orbit = _orbit(given, end[:3], axis, prograde, m, late)
                        found.append((end[:3], orbit))
    return tuple(orbit for _, orbit in sorted(found, key=lambda pair: pair[0][1]))


def improved(given: Three, ranges: Array, axis: Array) -> InitialOrbit | None:
    """The orbit next to ranges (3,) that meets all three directions, in motion about `axis`; None where there is none."""
    ends = _ends(given, np.log(ranges[None, [0, 2]]), axis, (0.0, 0.0, 0.0))
    return _orbit(given, ends[0, :3], axis, True, 0, False) if len(ends) else None


def _ends(given: Three, starts: Array, axis: Array, which: tuple[float, float, float]) -> Array:
    """Where the starts lead: ranges (K, 3) that meet the middle direction, best first, with the square of what is left."""
    L, R = given.L, given.R
    across = np.cross(L[1], np.eye(3)[np.argmin(np.abs(L[1]))])
    across /= np.linalg.norm(across)
    block = np.concatenate(
        [L.ravel(), across, np.cross(L[1], across), R.ravel(), axis, [given.t[1] - given.t[0], given.t[2] - given.t[0]]]
    )
    out = np.empty((len(starts), 4))
    orbit_library().gooding(starts, block, np.array(which), given.mu, out, len(starts))
    met = out[np.isfinite(out).all(axis=1) & (out[:, 3] < _MET**2)]
    return met[np.argsort(met[:, 3])]


def _orbit(given: Three, ranges: Array, axis: Array, prograde: bool, turns: int, late: bool) -> InitialOrbit:
    first, last = given.R[0] + ranges[0] * given.L[0], given.R[2] + ranges[2] * given.L[2]
    span = given.t[2] - given.t[0]
    v1, _ = lambert(first, last, span, given.mu, prograde=prograde, turns=turns, late=late, about=axis)
    r, v = propagate_kepler(first, v1, given.mu, given.t[1] - given.t[0])
    return given.orbit(r, v, ranges)
