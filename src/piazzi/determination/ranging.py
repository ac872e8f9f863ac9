"""Ranges to stations and satellites: a sensor for each kind of path, tag and medium, a part for each pass of a station."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.parts import Part
from piazzi.determination.sites import Context, aboard, weather_of
from piazzi.earth import Station, laser_sphere, sensors
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.formats import Segment
from piazzi.formats.passes import GAP
from piazzi.problem.checks import Array

EVENTS = {"transmit": "transmission", "bounce": "bounce", "receive": "reception"}
HALVES = ("range", "range_rate", "range_rate_averaged")  # whose values may be half of all legs
PLURALS = {
    "range": "ranges", "time_of_flight": "times of flight", "range_rate": "range rates", "doppler": "Doppler shifts",
    "range_rate_averaged": "averaged range rates", "receive_frequency": "frequencies", "receive_phase": "phases",
    "doppler_count": "counts of Doppler cycles",
}  # fmt: skip
DELAYED = ("range", "time_of_flight")  # that the troposphere is added to


class Way(NamedTuple):
    """What a sensor of range is made by."""

    path: str
    tag: str
    troposphere: str | None
    transmitter: Station | None = None
    aboard: bool = False
    about: str = "earth"

    def named(self, kind: str, *more: str) -> str:
        """The name of a sensor that says what it is of."""
        who = [*(["aboard"] if self.aboard else []), *(["sun"] if self.about == "sun" else [])]
        return "_".join([kind, *self.path.split("-"), self.tag, *who, *more])


def ranges(context: Context, index: Array) -> Sequence[Part]:
    """Rows of ranges as parts, one for each station, segment and pass.

    Raises
    ------
    ValueError
        For what the file leaves open, a station that nobody gave, and paths that are not taken yet.
    """
    return [_part(context, rows, kind) for kind, own in by_kind(context, index) for rows in passes(context, own)]


def by_kind(context: Context, index: Array) -> Iterator[tuple[str, Array]]:
    """The rows of each kind that there is."""
    for i in distinct(context.observations.kind[index]).tolist():
        yield context.observations.kinds[i], index[context.observations.kind[index] == i]


def passes(context: Context, index: Array) -> Iterator[Array]:
    """Rows of one station, segment, tag and receiver without a long gap, each (R,)."""
    rows = context.observations
    keys = np.stack([rows.station[index], rows.segment[index], rows.tag[index], aboard(rows)[index]], axis=1)
    for key in sorted(set(map(tuple, keys.tolist()))):
        own = index[(keys == key).all(axis=1)]
        own = own[np.argsort(rows.t[own], kind="stable")]
        yield from np.split(own, np.flatnonzero(np.diff(rows.t[own]) > GAP) + 1)


def _part(context: Context, rows: Array, kind: str) -> Part:
    observations = context.observations
    segment = observations.segments[observations.segment[rows[0]]]
    way = way_of(context, segment, rows, kind)
    numbers: dict[str, Any] = {"centre_of_mass": _centre(context, segment)}
    weather = None
    if way.troposphere is not None:
        site = context.site(int(observations.station[rows[0]]))
        weather, measured = weather_of(observations, rows, site, context.epoch)
        if not measured:
            context.said[f"weather at {site.name}: standard for its height"] = None
        if segment.wavelength is not None:
            numbers["wavelength"] = segment.wavelength
    sensor = _sensor(way, context.clocks)
    given, rows = context.placed(sensor, rows, weather, **numbers)
    factor = SPEED_OF_LIGHT if kind == "time_of_flight" else 1.0
    return part_of(context, sensor, given, rows, factor * share_of(segment, way, kind))


def part_of(context: Context, sensor: Any, given: Any, rows: Array, factor: float, **others: Any) -> Part:
    """The part of rows of one number each, which are taken times a factor."""
    observations = context.observations
    sigma = factor * observations.sigma[rows]
    return Part(
        sensor, given["name"], observations.t[rows], factor * observations.value[rows, None], (sigma**2)[:, None, None],
        rows[:, None], given["place"], given["numbers"], context.functions(sensor), **others,
    )  # fmt: skip


def share_of(segment: Segment, way: Way, kind: str) -> float:
    """What the mean of the legs is of what was measured."""
    whole = segment.range_is == "sum" or kind == "time_of_flight"
    return 0.5 if whole and way.path != "one-way" else 1.0


@lru_cache(maxsize=64)
def _sensor(way: Way, clocks: bool) -> Any:
    """The sensor, by a name that says what it is of."""
    return sensors.range(
        way.path, name=way.named("range", *(way.troposphere.split("-") if way.troposphere else [])), tag=way.tag,
        relativity="sun" if way.about == "sun" else True, troposphere=way.troposphere, time_bias=clocks,
        transmitter=way.transmitter, aboard=way.aboard,
    )  # fmt: skip


def way_of(context: Context, segment: Segment, rows: Array, kind: str) -> Way:
    """Path, tag and medium of rows of a segment; raises ValueError for what is open, or not taken yet."""
    tag, own = context.tag(rows[0]), bool(aboard(context.observations)[rows[0]])
    what = PLURALS.get(kind, kind)
    if segment.way not in ("one-way", "two-way", "three-way"):
        open_ = "of a path that the file does not say (--range two-way) are"
        raise ValueError(
            f"{context.where}{what} {f'on {segment.way} paths are' if segment.way else open_} not determined from yet"
        )
    if segment.mode == "single_diff" or (segment.range_modulus and kind == "range"):
        text = f"differences of {what}" if segment.mode == "single_diff" else "ranges that are known up to a modulus"
        raise ValueError(f"{context.where}{text} are not determined from yet")
    if segment.way == "two-way" and segment.range_is is None and kind in HALVES:
        raise ValueError(f"{context.where}are ranges half of the way or all of it? --range two-way or --range round-trip")
    if own and (tag == "transmit" or segment.way == "three-way"):
        raise ValueError(
            f"{context.where}{segment.way} {what} that the object receives are determined from by times of reception"
        )
    if tag is None and not own:
        tag = "bounce"
        context.said["times are those of the bounce (--tag transmit or receive says otherwise)"] = None
    ground = context.partner(int(context.observations.station[rows[0]])) is None and context.about == "earth"
    troposphere = _troposphere(context, segment) if ground and kind in DELAYED else None
    tag = "receive" if own else str(tag)
    return Way(segment.way, EVENTS[tag], troposphere, _transmitter(context, segment), own, context.about)


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
