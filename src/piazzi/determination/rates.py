"""Range-rates: of an instant, and means over a count."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from piazzi.determination.parts import Part
from piazzi.determination.ranging import Way, passes, way_of
from piazzi.determination.sites import Context
from piazzi.earth import sensors
from piazzi.problem.checks import Array


def rates(context: Context, index: Array) -> Sequence[Part]:
    """Rows of range-rate as parts, one for each station, segment, kind and pass."""
    observations = context.observations
    found = []
    for kind in ("range_rate", "range_rate_averaged"):
        if kind in observations.kinds:
            own = index[observations.kind[index] == observations.kinds.index(kind)]
            found += [_part(context, rows, kind == "range_rate_averaged") for rows in passes(context, own)]
    return found


def _part(context: Context, rows: Array, averaged: bool) -> Part:
    observations = context.observations
    first = int(rows[0])
    segment = observations.segments[observations.segment[first]]
    site = context.site(int(observations.station[first]))
    way = way_of(context, segment, int(observations.tag[first]))
    count = None
    numbers = {}
    if averaged:
        if segment.interval is None:
            raise ValueError(f"{context.where}over how long are range rates averaged? --interval SECONDS")
        if segment.interval_reference is None:
            raise ValueError(f"{context.where}of which part of the count are times? --interval-reference start, middle or end")
        count, numbers = segment.interval_reference, {"count": float(segment.interval)}
    sensor = _sensor(way, count, context.clocks)
    given = sensor.at(site, context.epoch, 1.0, **numbers)
    whole = 0.5 if segment.range_is == "sum" and way.path != "one-way" else 1.0
    sigma = whole * observations.sigma[rows]
    return Part(
        sensor, site.name, observations.t[rows], whole * observations.value[rows, None], (sigma**2)[:, None, None],
        rows[:, None], given["place"], given["numbers"], sensor.functions(context.epoch),
    )  # fmt: skip


@lru_cache(maxsize=64)
def _sensor(way: Way, count: str | None, clocks: bool) -> Any:
    name = "_".join(["range_rate", *way.path.split("-"), way.tag, *([count] if count else [])])
    return sensors.range_rate(way.path, name=name, tag=way.tag, count=count, time_bias=clocks, transmitter=way.transmitter)
