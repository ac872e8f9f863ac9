"""Where a fit begins when nobody says it: all orbits that the tracking allows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from piazzi.determination.guesses import Guess
from piazzi.determination.initial import EARTH, STRETCH, InitialOrbits, first_stretch, initial_orbits
from piazzi.determination.sensing import Measured
from piazzi.determination.sights import rows_of
from piazzi.orbit.modes import two_body_modes
from piazzi.problem import Problem

MOTION = 1e-2  # m/s^2: what two-body motion lacks in low orbits
AIR = 1e-3  # rad: aberration and refraction, which are left in for a first look


def first_look(seen: Measured) -> Guess:
    """A two-body orbit that fits, by geometry alone: good enough to choose forces by.

    Raises
    ------
    ValueError
        Where no row says where the body is, or nothing fits.
    """
    given = SimpleNamespace(model=SimpleNamespace(sensors=seen.sensors), stations=seen.stations, epoch=seen.epoch)
    rows, _ = rows_of(given, seen.tracking, ask=False)
    kept = first_stretch(rows, STRETCH)
    coarse = replace(rows, sigma=np.where(rows.kind[:, None] == 3, np.hypot(rows.sigma, AIR), rows.sigma))
    search = two_body_modes(coarse.of(kept), EARTH, motion=MOTION)
    if not search.modes:
        raise ValueError(_nothing(len(kept)))
    best = search.modes[0].state
    return Guess(seen.epoch + search.epoch, best[:3], best[3:], "initial orbits")


def unguided(seen: Measured, pose: Callable[[Guess], Problem]) -> Guess:
    """The most probable of all orbits that fit, by the problem that `pose` makes of a first one; it knows the others."""
    found: InitialOrbits = initial_orbits(pose(first_look(seen)), seen.tracking)
    best = found.modes[0]
    words = "the only orbit that fits" if len(found.modes) == 1 else f"the most probable of {len(found.modes)} orbits that fit"
    told = f"{words}, of {found.starts} starts"
    return Guess(best.epoch, best.mean[:3], best.mean[3:], "initial orbits", (f"the fit begins at {told}",), found)


def _nothing(rows: int) -> str:
    return f"no orbit about the Earth fits the {rows} rows of the first stretch: say where to begin with --guess"
