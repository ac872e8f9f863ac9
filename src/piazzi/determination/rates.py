"""Range-rates: of an instant, means over a count, and shifts of echoes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from piazzi.determination.parts import Part
from piazzi.determination.ranging import Way, by_kind, part_of, passes, share_of, way_of
from piazzi.determination.sites import Context
from piazzi.earth import sensors
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.formats import Segment
from piazzi.problem.checks import Array


def rates(context: Context, index: Array) -> Sequence[Part]:
    """Rows of range-rate as parts, one for each station, segment, kind and pass."""
    return [_part(context, rows, kind) for kind, own in by_kind(context, index) for rows in passes(context, own)]


def _part(context: Context, rows: Array, kind: str) -> Part:
    observations = context.observations
    segment = observations.segments[observations.segment[rows[0]]]
    way = way_of(context, segment, rows, kind)
    count: str | None = None
    numbers: dict[str, Any] = {}
    if kind == "range_rate_averaged":
        count, numbers = count_of(context, segment, "range rates")
    sensor = _sensor(way, count, context.clocks)
    given, rows = context.placed(sensor, rows, **numbers)
    factor = share_of(segment, way, kind)
    if kind == "doppler":
        factor = -SPEED_OF_LIGHT / (_frequency(context, segment) * (1.0 if way.path == "one-way" else 2.0))
    return part_of(context, sensor, given, rows, factor)


def count_of(context: Context, segment: Segment, what: str) -> tuple[str, dict[str, Any]]:
    """Of which part of a count times are, and the number of the sensor that says how long it is."""
    if segment.interval is None:
        raise ValueError(f"{context.where}over how long are {what} averaged? --interval SECONDS")
    if segment.interval_reference is None:
        raise ValueError(f"{context.where}of which part of the count are times? --interval-reference start, middle or end")
    return segment.interval_reference, {"count": float(segment.interval)}


def _frequency(context: Context, segment: Segment) -> float:
    """At which frequency shifts were measured."""
    stated = dict(segment.frequencies)
    found = stated.get("transmit", stated.get("carrier"))
    if not found:
        raise ValueError(f"{context.where}the file does not say at which frequency Doppler shifts were measured")
    return found


@lru_cache(maxsize=64)
def _sensor(way: Way, count: str | None, clocks: bool) -> Any:
    name = way.named("range_rate", *([count] if count else []))
    return sensors.range_rate(
        way.path, name=name, tag=way.tag, count=count, time_bias=clocks, transmitter=way.transmitter, aboard=way.aboard
    )
