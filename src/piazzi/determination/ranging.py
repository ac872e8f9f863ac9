"""Ranges to stations on the ground: one sensor for each kind of path, tag and medium, one part for each pass of a station."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from piazzi.determination.parts import Part
from piazzi.determination.sites import Context, weather_of
from piazzi.earth import Station, laser_sphere, sensors
from piazzi.formats import TAGS, Segment
from piazzi.problem.checks import Array

EVENTS = {"transmit": "transmission", "bounce": "bounce", "receive": "reception"}
GAP = 3600.0  # s without a row, behind which another pass begins: a low satellite comes again after 75 min or more


class Way(NamedTuple):
    """What a sensor of range is made by."""

    path: str
    tag: str
    troposphere: str | None
    transmitter: Station | None = None


def ranges(context: Context, index: Array) -> Sequence[Part]:
    """Rows of ranges as parts, one for each station, segment and pass.

    Raises
    ------
    ValueError
        For what the file leaves open, a station that nobody gave, and paths that are not taken yet.
    """
    return [_part(context, rows) for rows in passes(context, index)]


def passes(context: Context, index: Array) -> Iterator[Array]:
    """Rows of one station, segment and tag without a long gap, each (R,)."""
    rows = context.observations
    keys = np.stack([rows.station[index], rows.segment[index], rows.tag[index]], axis=1)
    for key in np.unique(keys, axis=0):
        own = index[(keys == key).all(axis=1)]
        own = own[np.argsort(rows.t[own], kind="stable")]
        yield from np.split(own, np.flatnonzero(np.diff(rows.t[own]) > GAP) + 1)


def _part(context: Context, rows: Array) -> Part:
    observations = context.observations
    first = int(rows[0])
    segment = observations.segments[observations.segment[first]]
    site = context.site(int(observations.station[first]))
    way = way_of(context, segment, int(observations.tag[first]))
    sensor = _sensor(way, context.clocks)
    numbers: dict[str, Any] = {"centre_of_mass": _centre(context, segment)}
    weather = None
    if way.troposphere is not None:
        weather, measured = weather_of(observations, rows, site, context.epoch)
        if not measured:
            context.said[f"weather at {site.name}: standard for its height"] = None
        if segment.wavelength is not None:
            numbers["wavelength"] = segment.wavelength
    known = dict(sensor.defaults)
    given = sensor.at(
        site, context.epoch, 1.0, weather=weather, **{name: value for name, value in numbers.items() if name in known}
    )
    whole = 0.5 if segment.range_is == "sum" and way.path != "one-way" else 1.0
    sigma = whole * observations.sigma[rows]
    return Part(
        sensor, site.name, observations.t[rows], whole * observations.value[rows, None], (sigma**2)[:, None, None],
        rows[:, None], given["place"], given["numbers"], sensor.functions(context.epoch), {}, (),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _sensor(way: Way, clocks: bool) -> Any:
    """The sensor, by a name that says what it is of."""
    name = "_".join(["range", *way.path.split("-"), way.tag, *(way.troposphere.split("-") if way.troposphere else [])])
    return sensors.range(
        way.path, name=name, tag=way.tag, relativity=True, troposphere=way.troposphere, time_bias=clocks,
        transmitter=way.transmitter,
    )  # fmt: skip


def way_of(context: Context, segment: Segment, tag_index: int) -> Way:
    """Path, tag and medium of a segment's ranges or rates; raises ValueError for what is open, or not taken yet."""
    tag = TAGS[tag_index] or segment.tag
    if segment.way not in ("one-way", "two-way", "three-way"):
        what = (
            f"{segment.way} ranges are" if segment.way else "ranges of a path that the file does not say (--range two-way) are"
        )
        raise ValueError(f"{context.where}{what} not determined from yet")
    if segment.mode == "single_diff" or segment.range_modulus:
        what = "differences of ranges" if segment.mode == "single_diff" else "ranges that are known up to a modulus"
        raise ValueError(f"{context.where}{what} are not determined from yet")
    if segment.way == "two-way" and segment.range_is is None:
        raise ValueError(f"{context.where}are ranges half of the way or all of it? --range two-way or --range round-trip")
    if tag is None:
        tag = "bounce"
        context.said["times are those of the bounce (--tag transmit or receive says otherwise)"] = None
    return Way(segment.way, EVENTS[tag], _troposphere(context, segment), _transmitter(context, segment))


def _transmitter(context: Context, segment: Segment) -> Station | None:
    """The station that sent a three-way signal, which is one for all of them."""
    if segment.way != "three-way":
        return None
    if not segment.path:
        raise ValueError(f"{context.where}the file does not say which station sent the three-way signals")
    sender = segment.path[0]
    others = {one.path[0] for one in context.observations.segments if one.way == "three-way" and one.path}
    if len(others) > 1:
        who = ", ".join(sorted(others))
        raise ValueError(f"{context.where}three-way signals of several transmitters ({who}) are not determined from yet")
    return context.site(context.observations.participants.index(sender))


def _troposphere(context: Context, segment: Segment) -> str | None:
    """Which air is to be added: none where it is corrected for already."""
    applied = context.corrected or any(c.name == "troposphere" and c.applied for c in segment.corrections)
    if applied:
        return None
    if segment.wavelength is not None:
        return "mendes-pavlis"
    context.said["radio ranges are not corrected for the troposphere, Saastamoinen's (--corrections applied)"] = None
    return "saastamoinen"


def _centre(context: Context, segment: Segment) -> float:
    """What ranges are shorter by than to the centre of mass, m."""
    if any(c.name == "centre of mass" and c.applied for c in segment.corrections):
        return 0.0
    if context.com is not None:
        return context.com
    try:
        sphere = laser_sphere(context.object)
    except KeyError:
        if segment.wavelength is not None:
            context.said["reflectors are taken to be at the centre of mass (--com says otherwise)"] = None
        return 0.0
    context.said[f"centre of mass of {sphere.name}: {sphere.centre_of_mass:g} m ({sphere.source})"] = None
    return sphere.centre_of_mass
