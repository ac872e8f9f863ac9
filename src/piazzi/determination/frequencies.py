"""Frequencies that stations receive: of a satellite's own transmitter, and of what its transponder returns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from math import floor, log10
from typing import Any

import numpy as np

from piazzi.arrays import distinct, median
from piazzi.determination.parts import Part
from piazzi.determination.ranging import part_of, passes, way_of
from piazzi.determination.rates import count_of
from piazzi.determination.sites import Context, aboard
from piazzi.earth import Station, sensors
from piazzi.formats import Segment
from piazzi.formats.ramps import Ramp, ramp_of
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

NAMES = ("carrier", "transmit")  # of a carrier that a segment states
DIGITS = 3  # of the nominal carrier, where nobody says it: the rest is estimated
LONGEST = 3.0  # s, that a signal is on its way to the Moon and back
SAME = 1e-12  # of a frequency: as well as files write it


def frequencies(context: Context, index: Array) -> Sequence[Part]:
    """Rows of received frequencies as parts, one for each station, segment and pass.

    The carrier is that of the file, or of what it says that the sender transmitted, which may be ramped where the satellite
    returns it.  Where the file says neither, carrier and drift of the satellite's transmitter are estimated, the same for all
    rows, about a rounded median of what was received.

    Raises
    ------
    ValueError
        For what the file leaves open, and carriers of a satellite that change.
    """
    found: list[Part] = []
    unknown = []
    for rows in passes(context, index):
        segment = segment_of(context, rows)
        if segment.way not in (None, "one-way"):
            found += _returned(context, segment, rows)
            continue
        _check(context, segment, rows)
        if (carrier := constant(context, rows)) is None:
            unknown.append(rows)
        else:
            found.append(_part(context, rows, carrier, estimated=False))
    if unknown:
        nominal = _rounded(context, median(context.observations.value[np.concatenate(unknown)]))
        context.said[f"the carrier is estimated, before the measurements {nominal / 1e6:g} MHz"] = None
        found += [_part(context, rows, nominal, estimated=True) for rows in unknown]
    return found


def _check(context: Context, segment: Segment, rows: Array) -> None:
    """Raise ValueError for frequencies on one way that are no carrier at the time of its reception."""
    tag = context.tag(rows[0])
    if segment.mode == "single_diff":
        raise ValueError(f"{context.where}differences of frequencies are not determined from yet")
    if tag not in (None, "receive"):
        raise ValueError(f"{context.where}frequencies are determined from at times of reception, not of {tag}")


def segment_of(context: Context, rows: Array) -> Segment:
    """The conventions of rows of one segment."""
    return context.observations.segments[int(context.observations.segment[rows[0]])]


def sender_of(context: Context, rows: Array) -> int:
    """Who sent what was received, -1 where nobody says it."""
    observations, segment = context.observations, segment_of(context, rows)
    if segment.path:
        return observations.participants.index(segment.path[0])
    return int((observations.station if aboard(observations)[rows[0]] else observations.object)[rows[0]])


def ramp_sent(context: Context, rows: Array) -> Ramp | None:
    """The frequency that the sender of rows transmitted, None where the file does not say it."""
    observations, sender = context.observations, sender_of(context, rows)
    stated = {value for name, value in segment_of(context, rows).frequencies if name in NAMES}
    own = observations.of_kind("transmit_frequency") & (observations.participant == sender)
    if sender >= 0 and own.any():
        return _merged(ramp_of(observations, observations.participants[sender]))
    if len(stated) > 1:
        raise ValueError(f"{context.where}two carriers are stated for one segment")
    return Ramp(np.array([-np.inf]), np.array([stated.pop()]), np.zeros(1)) if stated else None


def _merged(ramp: Ramp) -> Ramp:
    """The ramp without events at which nothing changes."""
    step = ramp.t[1:] - ramp.t[:-1]
    goes_on = np.abs(ramp.frequency[1:] - ramp.frequency[:-1] - ramp.rate[:-1] * step) <= SAME * ramp.frequency[1:]
    keep = np.append(True, ~(goes_on & (ramp.rate[1:] == ramp.rate[:-1])))
    return Ramp(ramp.t[keep], ramp.frequency[keep], ramp.rate[keep])


def constant(context: Context, rows: Array) -> float | None:
    """The one frequency that was sent, Hz, None where the file does not say it; raises ValueError where it changes."""
    ramp = ramp_sent(context, rows)
    if ramp is None:
        return None
    if len(ramp.t) > 1 or ramp.rate.any():
        raise ValueError(
            f"{context.where}a satellite's own carrier that changes, and phases of one, are not determined from yet"
        )
    return float(ramp.frequency[0])


def _returned(context: Context, segment: Segment, rows: Array) -> Iterator[Part]:
    """Parts of what a transponder returns, one for each piece of the ramp."""
    way = way_of(context, segment, rows, "receive_frequency")
    if way.aboard or way.tag != "reception":
        raise ValueError(f"{context.where}frequencies that return are determined from as stations receive them")
    ramp, turnaround = ramp_sent(context, rows), segment.turnaround
    if ramp is None or turnaround is None:
        lost = "frequency was sent (TRANSMIT_FREQ)" if ramp is None else "the transponder makes of it (TURNAROUND_NUMERATOR)"
        raise ValueError(f"{context.where}{segment.way} frequencies: the file does not say which {lost}")
    count, numbers = counted(context, segment)
    rows, piece = _on_one_piece(context, rows, ramp, count, numbers.get("count", 0.0))
    sensor = _returning(way.path, count, context.clocks, way.transmitter)
    late = context.observations.epoch - context.epoch
    for k in distinct(piece):
        since = 0.0 if np.isinf(ramp.t[k]) else float(ramp.t[k]) + late
        sent: dict[str, Any] = {
            "transmit_frequency": float(ramp.frequency[k]),
            "transmit_rate": float(ramp.rate[k]),
            "since": since,
        }
        given, own = context.placed(sensor, rows[piece == k], turnaround=turnaround, **sent, **numbers)
        yield part_of(context, sensor, given, own, 1.0)


def _on_one_piece(context: Context, rows: Array, ramp: Ramp, count: str | None, length: float) -> tuple[Array, Array]:
    """Rows whose signal was sent on one piece of the ramp for certain, and which; the others are left out."""
    before, behind = {None: (0.0, 0.0), "start": (0.0, 1.0), "middle": (0.5, 0.5), "end": (1.0, 0.0)}[count]
    t = context.observations.t[rows]
    first = np.searchsorted(ramp.t, t - before * length - LONGEST, side="right") - 1
    last = np.searchsorted(ramp.t, t + behind * length, side="right") - 1
    good = (first == last) & (first >= 0)
    if not good.all():
        reason = "rows while the frequency that was sent changed its ramp, or before it is known"
        context.left[reason] = context.left.get(reason, 0) + int((~good).sum())
    return rows[good], first[good]


def counted(context: Context, segment: Segment) -> tuple[str | None, dict[str, Any]]:
    """Of which part of a count times are, None for frequencies of an instant, and the number of its length."""
    return (None, {}) if segment.interval is None else count_of(context, segment, "frequencies")


def _rounded(context: Context, value: float) -> float:
    if not value > 0.0:
        raise ValueError(
            f"{context.where}received frequencies are {value:g} Hz in the median: "
            "of which frequency are they the offset (FREQ_OFFSET)?"
        )
    size = 10.0 ** (floor(log10(value)) - DIGITS + 1)
    return size * round(value / size)


def _part(context: Context, rows: Array, nominal: float, estimated: bool) -> Part:
    count, numbers = counted(context, segment_of(context, rows))
    sensor = _sensor(nominal, estimated, context.clocks, count, bool(aboard(context.observations)[rows[0]]))
    given, rows = context.placed(sensor, rows, **numbers)
    return part_of(context, sensor, given, rows, 1.0, parameters=beliefs(sensor))


def beliefs(sensor: Any) -> dict[str, tuple[str, Gaussian]]:
    """Role and prior of each parameter of a sensor."""
    priors = dict(sensor.priors)
    return {name: (role, Gaussian(priors[name][0], priors[name][1] ** 2)) for name, role in sensor.parameters.items()}


@lru_cache(maxsize=64)
def _sensor(nominal: float, estimated: bool, clocks: bool, count: str | None, own: bool) -> Any:
    name = "_".join(["frequency", *([] if estimated else [f"{nominal:.0f}"]), *([count] if count else []), *["aboard"] * own])
    parameters = ("carrier", "drift") if estimated else ()
    return sensors.frequency(nominal, name=name, count=count, time_bias=clocks, parameters=parameters, aboard=own)


@lru_cache(maxsize=64)
def _returning(path: str, count: str | None, clocks: bool, transmitter: Station | None) -> Any:
    name = "_".join(["returned_frequency", *path.split("-"), *([count] if count else [])])
    return sensors.returned_frequency(path, name=name, count=count, time_bias=clocks, transmitter=transmitter)
