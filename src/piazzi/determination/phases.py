"""Phases of carriers, and counts of Doppler cycles, from an unknown begin in each pass."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from piazzi.determination.frequencies import constant, segment_of
from piazzi.determination.parts import Part
from piazzi.determination.ranging import Way, by_kind, part_of, passes, way_of
from piazzi.determination.sites import Context
from piazzi.earth import sensors
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

FARTHEST = 4e8  # m: a count that began anywhere this side of the Moon


class _Count(NamedTuple):
    """Rows of one count with what its sensor needs: cycles a metre, Hz without a shift."""

    rows: Array
    way: Way
    cycles: float
    beat: float


def phases(context: Context, index: Array) -> Sequence[Part]:
    """Rows of phases and counts as parts, one for each station, segment and pass, whose begin is estimated.

    Raises
    ------
    ValueError
        For what the file leaves open, and carriers that are ramped.
    """
    counts = [_count(context, rows, kind) for kind, own in by_kind(context, index) for rows in passes(context, own)]
    return [_part(context, count, k, len(counts)) for k, count in enumerate(counts, 1)]


def _count(context: Context, rows: Array, kind: str) -> _Count:
    segment = segment_of(context, rows)
    way = way_of(context, segment, rows, kind)
    if way.tag != "reception":
        raise ValueError(f"{context.where}phases and counts are determined from at times of reception, not of {way.tag}")
    sent = constant(context, rows)
    if sent is None:
        raise ValueError(f"{context.where}the file does not say of which frequency cycles were counted (TRANSMIT_FREQ)")
    if way.path != "one-way" and segment.turnaround is None:
        raise ValueError(
            f"{context.where}the file does not say what the transponder makes of a frequency (TURNAROUND_NUMERATOR)"
        )
    received = sent * (segment.turnaround if way.path != "one-way" and segment.turnaround else 1.0)
    beat = received if kind == "receive_phase" else dict(segment.frequencies).get("count bias", 0.0)
    if kind == "doppler_count":
        context.said["counts of Doppler cycles grow while an object comes nearer, and by their bias"] = None
        if dict(segment.said).get("DOPPLER_COUNT_ROLLOVER", "").upper() == "YES":
            raise ValueError(f"{context.where}the Doppler counter rolled over, and the file does not say at how many cycles")
    return _Count(rows, way, received / SPEED_OF_LIGHT, beat)


def _part(context: Context, count: _Count, number: int, of: int) -> Part:
    """A part that counts from its first row on, so that numbers are as small as may be."""
    observations = context.observations
    sensor = _sensor(count.way, of, context.clocks)
    since = float(observations.t[count.rows[0]]) + (observations.epoch - context.epoch)
    numbers: dict[str, Any] = {
        f"is_{k}": float(k == number) for k in range(1, of + 1)
    }  # of passes, whatever stations are called
    numbers |= {"cycles": count.cycles, "beat": count.beat, "since": since}
    given, rows = context.placed(sensor, count.rows, **numbers)
    part = part_of(context, sensor, given, rows, 1.0)
    zero = float(observations.value[count.rows[0]])
    sigma = count.cycles * FARTHEST
    own = {name: (role, Gaussian(0.0, sigma**2)) for name, role in sensor.parameters.items() if name == f"phase_{number}"}
    return Part(
        sensor, part.station, part.t, part.values - zero, part.noise, part.rows, part.place, part.numbers, part.functions, own
    )


@lru_cache(maxsize=64)
def _sensor(way: Way, passes: int, clocks: bool) -> Any:
    return sensors.carrier_phase(
        way.path, name=way.named("carrier_phase", str(passes)), time_bias=clocks, passes=[str(k + 1) for k in range(passes)],
        transmitter=way.transmitter, aboard=way.aboard,
    )  # fmt: skip
