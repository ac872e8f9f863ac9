"""Where a fit begins when nobody says it: all orbits that the tracking allows, about the Earth or about the Sun."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.centres import EARTH, SUN, Centre
from piazzi.determination.extending import FITS
from piazzi.determination.guesses import Guess
from piazzi.determination.initial import THROUGH, first_stretch, initial_orbits
from piazzi.determination.initial_result import InitialOrbits, UndeterminedError
from piazzi.determination.sensing import Measured
from piazzi.determination.sights import plain_rows
from piazzi.earth import body
from piazzi.earth.constants import ASTRONOMICAL_UNIT, SPEED_OF_LIGHT
from piazzi.earth.sensors.turning import barycentric_velocity
from piazzi.orbit.fits import DIRECTION, Rows
from piazzi.orbit.modes import two_body_modes
from piazzi.problem import Problem

MOTION = 1e-2  # m/s^2: what two-body motion lacks in low orbits
AIR = 1e-3  # rad: aberration and refraction, which are left in for a first look
SLOW = np.radians(1.0) / 3600.0  # rad/s among the stars: the Moon does half of it


def first_look(seen: Measured) -> Guess:
    """A two-body orbit that fits, by geometry alone: good enough to choose forces by.

    Raises
    ------
    ValueError
        Where no row says where the body is, or nothing fits.
    """
    if seen.about == "sun":  # whose forces do not depend on the orbit
        return nominal(seen)
    rows = _plain(seen)
    kept = first_stretch(rows.t, EARTH.stretch)
    coarse = replace(rows, sigma=np.where(rows.kind[:, None] == DIRECTION, np.hypot(rows.sigma, AIR), rows.sigma))
    search = two_body_modes(coarse.of(kept), EARTH.region, motion=MOTION)
    if not search.modes and len(distinct(rows.t)) < 3:  # anything will do: what they determine is found out later
        return nominal(seen)
    if not search.modes:
        raise ValueError(_nothing(len(kept)))
    above = [mode for mode in search.modes if mode.admissible]
    if not above:  # orbits through the Earth only: forces of any other will do, to find out the same
        return nominal(seen)
    best = above[0].state
    return Guess(seen.epoch + search.epoch, best[:3], best[3:], "initial orbits")


def nominal(seen: Measured, radius: float = 8e6) -> Guess:
    """Some circular orbit, about the Earth of that radius (m)."""
    r = 2.5 * ASTRONOMICAL_UNIT if seen.about == "sun" else radius
    v = float(np.sqrt(seen.centre.mu / r))
    return Guess(seen.epoch, np.array([r, 0.0, 0.0]), np.array([0.0, v, 0.0]), "initial orbits", about=seen.about)


def _plain(seen: Measured) -> Rows:
    return plain_rows(seen.sensors, seen.stations, seen.epoch, seen.tracking)[0]


def goes_about_the_sun(seen: Measured) -> bool:
    """Whether directions, slow among the stars, fit an orbit about the Sun and none about the Earth, which `seen` is about."""
    if not {*seen.observations.kinds} & {"right_ascension"} or len(seen.tracking.times) < 3:
        return False
    rows = _plain(seen)
    if not (rows.kind == DIRECTION).all() or not _slow(rows):
        return False
    epochs = [seen.epoch + float(t) for t in rows.t]
    place, velocity = body("earth", epochs, "sun")
    u = rows.value - barycentric_velocity(epochs) / SPEED_OF_LIGHT
    moved = replace(
        rows, observer=rows.observer + place, observer_velocity=rows.observer_velocity + velocity,
        value=u / np.linalg.norm(u, axis=1)[:, None],
    )  # fmt: skip
    return _fits(moved, SUN) and not _fits(rows, EARTH)


def _fits(rows: Rows, centre: Centre) -> bool:
    """Whether a two-body orbit about a centre leaves residuals that are not many sigma."""
    few = rows.of(first_stretch(rows.t, SUN.stretch))
    search = two_body_modes(few, centre.region)
    return any(m.admissible and m.square <= 2 * len(few) * FITS**2 for m in search.modes)


def _slow(rows: Rows) -> bool:
    """Whether it is never seen to move faster than `SLOW`."""
    order = np.argsort(rows.t, kind="stable")
    t, u = rows.t[order], rows.value[order]
    dt = np.diff(t)
    moved = np.linalg.norm(np.cross(u[1:], u[:-1]), axis=1)
    sigma = np.hypot(*(rows.sigma[order][part].max(axis=1) for part in (slice(1, None), slice(None, -1))))
    return bool((moved <= SLOW * dt + 5.0 * sigma).all())


def unguided(seen: Measured, pose: Callable[[Guess], Problem]) -> Guess:
    """The most probable of all orbits that fit, by the problem that `pose` makes of a first one; it knows the others.

    Raises
    ------
    UndeterminedError
        Where they are a ridge.
    """
    found: InitialOrbits = initial_orbits(pose(first_look(seen)), seen.tracking)
    if found.ridge is not None:
        raise UndeterminedError(found)
    best = found.modes[0]
    off = f"with residuals of {best.weighted_rms:.2g} sigma" if best.weighted_rms > FITS else ""
    if found.beyond is not None:
        far = f"no orbit was found that fits the {best.rows} measurements from {best.epoch} on: the nearest leaves them {off}"
        fits = far if off else f"an orbit fits {best.rows} measurements from {best.epoch} on"
        raise ValueError(
            f"{fits}, {'and' if off else 'but'} {found.beyond}: give them apart, or say where to begin with --guess"
        )
    if THROUGH in best.why_not:
        raise ValueError(f"the measurements fit no other orbit than one that is {best.why_not}")
    words = "the only orbit that fits" if len(found.modes) == 1 else f"the most probable of {len(found.modes)} orbits that fit"
    words = f"the nearest orbit that was found, {off}" if off else words
    told = f"{words}, of {found.starts} starts"
    said = (f"the fit begins at {told}",)
    return Guess(best.epoch, best.mean[:3], best.mean[3:], "initial orbits", said, found, seen.about)


def _nothing(rows: int) -> str:
    return f"no orbit about the Earth fits the {rows} rows of the first stretch: say where to begin with --guess"
