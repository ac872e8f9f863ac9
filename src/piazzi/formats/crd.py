"""Laser ranges: files in the Consolidated Laser Ranging Data Format, normal points and full rate, versions 1 and 2.

A row's value is the range, half of the flight time of a closed path times the speed of light in vacuum; its time is that of the
event that the file names.
"""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.scales import UTC_BEGINS
from piazzi.formats.conventions import Conventions, with_usual_sigmas
from piazzi.formats.crd_headers import CORRECTIONS, ONE_WAY, Session
from piazzi.formats.crd_records import Group, parse
from piazzi.formats.dates import Readings, instants
from piazzi.formats.kinds import TAGS
from piazzi.formats.observations import Correction, Observations, Segment

C = 299792458.0  # m/s
SIGMA = {"normal points": 0.03, "full rate": 0.05, "sampled engineering": 0.05}  # m, where the file gives none
_DAY = 86400.0
_TAG = ("receive", "bounce", "transmit", "receive", "transmit", "transmit", "transmit")  # by epoch event
_WITHOUT = ("transmit times only", "receive times only")


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """The ranges of a file, without passes that a later release in the same file replaces.

    Raises ValueError with file, line and reason.
    """
    laser = parse(BytesIO(data), name)
    sessions, group = laser.sessions, np.frombuffer(laser.group, dtype=np.int32) if laser.group else np.zeros(0, np.int32)
    seconds, flight, line = (np.array(column) for column in (laser.seconds, laser.flight, laser.line))
    laser.seconds, laser.flight = (), ()  # a million rows need their room
    _check(seconds, flight, line, name)
    of_pass = np.array([g.session for g in laser.groups], dtype=np.int32)
    replaced = superseded(sessions)
    left_out = dict(laser.skipped)
    first = float(min(session.start[0] for session in sessions))
    if first < UTC_BEGINS:
        raise ValueError(f"{name}: a pass begins on the day {first:.0f} (MJD): there is no UTC before 1960")
    epoch = Epoch.from_jd(2400000.5, first, "UTC")
    t, weather = np.empty(len(seconds)), np.full((3, len(seconds)), np.nan)
    keep = np.ones(len(seconds), dtype=bool)
    ends = [*laser.first[1:], len(seconds)]
    for i, (session, a, b) in enumerate(zip(sessions, laser.first, ends, strict=True)):
        t[a:b] = _instants(epoch, session, seconds[a:b])
        _blow(epoch, session, laser.weather[i], t[a:b], weather[:, a:b])
        reason = "rows of a pass that a later release replaces" if i in replaced else ""
        if session.range_type in _WITHOUT:
            reason = f"rows of {session.range_type}, which measure no range"
        if reason and b > a:
            keep[a:b], left_out[reason] = False, left_out.get(reason, 0) + b - a
    people = _participants(sessions)
    table = Observations(
        epoch=epoch,
        t=t,
        value=_ranges(flight, laser.groups, group),
        kinds=("range",),
        kind=0,  # type: ignore[arg-type]
        participants=people,
        station=_by_group([people.index(s.station.pad) for s in sessions], of_pass, group),
        object=_by_group([people.index(_named(s, sessions)) for s in sessions], of_pass, group),
        segments=tuple(_segment(g, sessions, laser.delays[g.session]) for g in laser.groups),
        segment=group,
        files=(name,),
        line=line,
        pressure=weather[0],
        temperature=weather[1],
        humidity=weather[2],
        tag=_by_group([TAGS.index(_TAG[g.event]) for g in laser.groups], np.arange(len(laser.groups)), group),
        used=_by_group([not g.noise for g in laser.groups], np.arange(len(laser.groups)), group),
        left_out=tuple(left_out.items()),
    )
    for kind in dict.fromkeys(session.kind for session in sessions):
        own = _by_group([SIGMA[kind] if s.kind == kind else np.nan for s in sessions], of_pass, group)
        table = with_usual_sigmas(table, told, own, f"sigma of laser ranges, {kind}: {SIGMA[kind]} m")
    return table if keep.all() else table[keep]


def _check(seconds: Array, flight: Array, line: Array, name: str) -> None:
    for values, good, what in (
        (seconds, (seconds >= 0.0) & (seconds < 2 * _DAY), "second of the day"),
        (flight, (flight >= 0.0) & (flight < 1e6), "flight time"),
    ):
        bad = np.flatnonzero(~good)
        if len(bad):
            raise ValueError(f"{name}: line {line[bad[0]]}: the {what} is {values[bad[0]]:g} s")


def _by_group(values: Sequence[Any], index: Array, group: Array) -> Any:
    """A column of what each group has; one number where all have the same."""
    if len(set(values)) == 1:
        return values[0]
    return np.array(values)[index][group]


def _participants(sessions: Sequence[Session]) -> tuple[str, ...]:
    pads = (session.station.pad for session in sessions)
    return tuple(dict.fromkeys((*pads, *(_named(session, sessions) for session in sessions))))


def _named(session: Session, sessions: Sequence[Session]) -> str:
    """Name of a pass's target as the first pass to the same object has it."""
    target = session.target
    return next(other.target.name for other in sessions if other.target.cospar == target.cospar)


def _ranges(flight: Array, groups: Sequence[Group], group: Array) -> Array:
    one_way = _by_group([g.event >= ONE_WAY for g in groups], np.arange(len(groups)), group)
    flight *= np.where(one_way, C, C / 2.0)
    return flight


def _segment(group: Group, sessions: Sequence[Session], delays: dict[str, list[float]]) -> Segment:
    session, one_way = sessions[group.session], group.event >= ONE_WAY
    station, target = session.station.pad, _named(session, sessions)
    waves = session.wavelengths
    wave = waves.get(group.configuration, next(iter(waves.values())) if len(waves) == 1 else None)
    sizes = {"station delay": -C / (1 if one_way else 2) * float(np.mean(delays.get(group.configuration, [np.nan])))}
    corrections = tuple(
        Correction(name, size if np.isfinite(size := sizes.get(name, np.nan)) else None, name in session.applied)
        for name in CORRECTIONS
        if name != "spacecraft delay" or session.target.transponder or name in session.applied
    )
    legs = (station, target) if group.event in (3, 5) else (target, station)
    said = {
        "data": session.kind, "window": group.window, "station": session.station.name, "system": session.station.system,
        "occupancy": session.station.occupancy, "cospar": session.target.cospar, "sic": session.target.sic,
        "norad": session.target.norad, "release": str(session.release), "configuration": group.configuration,
        "prediction": session.prediction, "quality": session.quality,
    }  # fmt: skip
    return Segment(
        "UTC",
        participants=(station, target),
        path=legs if one_way else (station, target, station),
        way="one-way" if one_way else "two-way",
        range_is="sum" if one_way else "half",
        tag=_TAG[group.event],
        corrections=corrections,
        wavelength=wave,
        quality=None if session.quality == "good" else "degraded",
        said=tuple((name, text) for name, text in said.items() if text),
    )


def _of_day(session: Session, seconds: Array) -> tuple[Array, Array]:
    """Modified Julian Days of seconds of the day, which begin anew at midnight, and seconds below a day."""
    day, start = session.start
    if session.seconds < 82800.0:  # every second of the day comes once: the day that puts it nearest to the pass
        turns = np.round((start + session.seconds / 2.0 - seconds) / _DAY)
    else:  # by steps from row to row
        along = np.unwrap(seconds, period=_DAY)
        turns = np.round((along - seconds) / _DAY) + np.round((start - seconds[:1]) / _DAY)
    return day + turns, seconds


def _instants(epoch: Epoch, session: Session, seconds: Array) -> Array:
    """Seconds of TT past `epoch`; leap seconds come at midnight, so that each day needs one look at their table."""
    day, of_day = _of_day(session, seconds)
    if session.start[0] < 41317:  # before 1972 UTC drifted within the day
        whole = np.floor(of_day)
        return instants("UTC", Readings(day, whole, of_day - whole), epoch).t
    days, which = np.unique(day, return_inverse=True)
    return np.asarray(instants("UTC", Readings(days, 0.0 * days, 0.0 * days), epoch).t[which] + of_day)


def _blow(epoch: Epoch, session: Session, records: Sequence[tuple[float, ...]], t: Array, out: Array) -> None:
    """Weather of each row: on the line between the records before and after it, the nearest one outside of them."""
    if not records or not len(t):
        return
    table = np.array(records).T
    at = _instants(epoch, session, table[0])
    for row, values in zip(out, table[1:], strict=True):
        there = np.isfinite(values)
        if there.any():
            order = np.argsort(at[there], kind="stable")
            row[:] = np.interp(t, at[there][order], values[there][order])


def superseded(sessions: Sequence[Session]) -> set[int]:
    """Passes that overlap one of the same station, target and kind of data whose release is later."""
    alike: dict[tuple[str, ...], list[int]] = {}
    for i, session in enumerate(sessions):
        alike.setdefault((session.station.pad, session.target.cospar, session.kind), []).append(i)
    out: set[int] = set()
    for group in alike.values():
        if len({sessions[i].release for i in group}) < 2:
            continue
        spans = {i: (b := _DAY * sessions[i].start[0] + sessions[i].start[1], b + sessions[i].seconds) for i in group}
        for i in group:
            later = (j for j in group if sessions[j].release > sessions[i].release)
            if any(spans[i][0] <= spans[j][1] and spans[j][0] <= spans[i][1] for j in later):
                out.add(i)
    return out
