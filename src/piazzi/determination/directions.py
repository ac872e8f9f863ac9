"""Directions from stations on the ground: azimuth with elevation, right ascension with declination, in pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.parts import Part
from piazzi.determination.ranging import EVENTS, passes
from piazzi.determination.sites import Context, weather_of
from piazzi.earth import Place, body, sensors, transform
from piazzi.earth.rotation import frame_named
from piazzi.outside.table import Table
from piazzi.problem.checks import Array

SHIFTS = tuple(30.0 * k - 105.0 for k in range(8))  # s, of the table about a row of an observer that moves
GEOCENTRE = "500"  # of the Minor Planet Center: reduced to the centre of the Earth
AZEL, RADEC = ("azimuth", "elevation"), ("right_ascension", "declination")
SPHERE = (AZEL, RADEC)  # whose first angle is along a parallel
NEIGHBOUR = 3600.0  # s, between rows from which motion on the sky is told
XEYN, XSYE = ("x_east", "y_north"), ("x_south", "y_east")
MOUNTS = {"azel": AZEL, "xeyn": XEYN, "xsye": XSYE}  # as `sensors.azimuth_elevation` calls them


@dataclass(frozen=True, eq=False)
class Standing(Table):
    """A place as a table, of an orbit about `about`."""

    about: str = "earth"

    def __getstate__(self) -> dict[str, Any]:
        return super().__getstate__() | {"about": self.about}


def mounts(context: Context, index: Array) -> Sequence[Part]:
    """Rows of both angles of a mount as parts, one for each station, segment and pass."""
    kinds = context.observations.kinds[context.observations.kind[index[0]]]
    pair = next(pair for pair in MOUNTS.values() if kinds in pair)
    return [_part(context, rows, pair) for rows in passes(context, index)]


def ascensions(context: Context, index: Array) -> Sequence[Part]:
    """Rows of right ascension and declination, likewise; of an observer that moves those of each place."""
    place = context.observations.place
    return [
        _part(context, rows[place[rows] == k], RADEC) for rows in passes(context, index) for k in distinct(place[rows]).tolist()
    ]


def _part(context: Context, index: Array, kinds: tuple[str, str]) -> Part:
    observations = context.observations
    rows = paired(context, index, kinds)
    first = int(index[0])
    segment = observations.segments[observations.segment[first]]
    number = int(observations.station[first])
    partner, moving = context.partner(number), int(observations.place[first]) >= 0
    nowhere = partner is not None or moving or (number >= 0 and observations.participants[number] == GEOCENTRE)
    site = None if nowhere else context.site(number)
    tag = EVENTS[context.tag(first) or "bounce"]
    if kinds != RADEC:
        if site is None or context.about == "sun":
            raise ValueError(f"{context.where}azimuths and elevations are of stations, of an orbit about the Earth")
        bent = "radio" if context.open else None
        if not context.open:
            context.said["azimuths and elevations are free of refraction (--corrections open says otherwise)"] = None
        sensor = _mount(next(m for m, pair in MOUNTS.items() if pair == kinds), tag, bent, context.clocks)
    else:
        if segment.angles is None:
            raise ValueError(f"{context.where}what are the directions? --angles astrometric, geocentric or apparent")
        sensor = _ascension(segment.angles, frame_named(segment.frame or "GCRF"), tag, context.clocks, context.about)
    if moving:
        name = observations.participants[number] if number >= 0 else "observer"
        given = sensor.at(None, context.epoch, 1.0, name=name, place=_about_its_row(context, first, segment.angles))
    elif site is None and partner is None:
        place = Place(None, context.epoch, about=context.about)
        given = sensor.at(None, context.epoch, 1.0, name=GEOCENTRE, place=place)
    else:
        weather = weather_of(observations, index, site, context.epoch)[0] if site and context.about == "earth" else None
        given, usable = context.placed(sensor, index, weather)
        rows = rows[np.isin(rows.max(axis=1), usable)]
    there = rows >= 0
    values = np.where(there, observations.value[rows], np.nan)
    sigma = np.where(there, observations.sigma[rows], np.nan)
    sigma = np.where(there, sigma, sigma[:, ::-1])
    noise = np.zeros((len(rows), 2, 2))
    noise[:, [0, 1], [0, 1]] = sigma**2
    both = there.all(axis=1)
    correlation = np.where(both, np.nan_to_num(observations.correlation[rows[:, 1]]), 0.0)
    noise[:, 0, 1] = noise[:, 1, 0] = correlation * sigma[:, 0] * sigma[:, 1]
    t = observations.t[rows.max(axis=1)]
    noise += _by_times(t, values, observations.time_sigma[rows.max(axis=1)], np.cos(values[:, 1]) if kinds in SPHERE else 1.0)
    return Part(
        sensor, given["name"], t, values, noise, rows, given["place"], given["numbers"], sensor.functions(context.epoch)
    )


def _by_times(t: Array, values: Array, spread: Array, across: Any) -> Array:
    """What standard deviations of times (R,) add to the covariance of directions (R, 2, 2): the motion on the sky, times them.

    The motion is that to the rows before and after, where these are near.
    """
    spread = np.nan_to_num(spread)
    order = np.argsort(t, kind="stable")
    step, dt = np.diff(values[order], axis=0), np.diff(t[order])
    step[:, 0] = np.remainder(step[:, 0] + np.pi, 2.0 * np.pi) - np.pi
    near = (dt > 0) & (dt <= NEIGHBOUR) & np.isfinite(step).all(axis=1)
    rate = np.where(near[:, None], step, 0.0) / np.where(near, dt, 1.0)[:, None]
    none, count = np.zeros((1, 2)), np.concatenate([[0], near]) + np.concatenate([near, [0]])
    moved = np.empty_like(values)
    moved[order] = (np.vstack([none, rate]) + np.vstack([rate, none])) / np.maximum(count, 1)[:, None]
    moved[:, 0] *= np.nan_to_num(across)
    moved *= spread[:, None]
    return np.asarray(moved[:, :, None] * moved[:, None, :])


def _about_its_row(context: Context, row: int, angles: str | None) -> Standing:
    """Where an observer that moves is when it measures a row; on the Earth it turns with it, in space it stands still.

    Raises
    ------
    ValueError
        For apparent directions from space, whose aberration is by a velocity that nobody says.
    """
    observations = context.observations
    dates = [observations.instant(row) + shift for shift in SHIFTS]
    r = np.tile(observations.places[observations.place[row]], (len(dates), 1))
    v = np.zeros_like(r)
    if str(observations.extra["place_axes"][row]) == "ITRF":
        r, v = (np.asarray(a) for a in transform(r, v, "ITRF", "GCRF", dates, context.eop))
    elif angles == "apparent":
        raise ValueError(f"{context.where}apparent directions from space depend on a velocity that the file does not say")
    if context.about == "sun":
        place, velocity = body("earth", dates, "sun")
        r, v = r + place, v + velocity
    t = observations.t[row] + (observations.epoch - context.epoch)
    return Standing(t + np.array(SHIFTS), np.hstack([r, v]), about=context.about)


def paired(context: Context, index: Array, kinds: tuple[str, ...]) -> Array:
    """(R, m) rows of one time together, one of each kind, -1 where there is none."""
    observations = context.observations
    what = np.array([kinds.index(kind) if kind in kinds else -1 for kind in observations.kinds])[observations.kind[index]]
    found: dict[tuple[float, int], list[int]] = {}
    seen: dict[tuple[float, int], int] = {}
    for row, kind in zip(index.tolist(), what.tolist(), strict=True):
        key = (float(observations.t[row]), kind)
        again = seen.get(key, 0)
        seen[key] = again + 1
        found.setdefault((key[0], again), [-1] * len(kinds))[kind] = row
    return np.array([found[key] for key in sorted(found)], dtype=np.int64)


@lru_cache(maxsize=64)
def _mount(mount: str, tag: str, bent: str | None, clocks: bool) -> Any:
    name = "_".join(["azimuth_elevation" if mount == "azel" else mount, tag, *([bent] if bent else [])])
    return sensors.azimuth_elevation(name=name, mount=mount, tag=tag, refraction=bent, time_bias=clocks)


@lru_cache(maxsize=64)
def _ascension(angles: str, axes: str, tag: str, clocks: bool, about: str) -> Any:
    name = "_".join(["right_ascension", angles, axes.lower(), tag, *([about] if about != "earth" else [])])
    return sensors.right_ascension_declination(angles, name=name, axes=axes, tag=tag, time_bias=clocks, about=about)
