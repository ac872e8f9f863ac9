"""Rows of a TDM as they are read, gathered into columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.scales import UTC_BEGINS
from piazzi.formats.columns import coded, read_numbers
from piazzi.formats.dates import instants, read_dates
from piazzi.formats.frames import KNOWN
from piazzi.formats.kinds import KINDS, TAGS, asked_sigmas
from piazzi.formats.ndm import Item, Source, shown
from piazzi.formats.observations import Observations, Segment
from piazzi.formats.tdm_segment import Meaning, Row, check_texts

_COLUMNS = {"t": np.float64, "value": np.float64, "kind": np.int16, "participant": np.int16, "line": np.int32}
_ALONG = ("range", "range_ru", "range_rate", "range_rate_averaged")


class Rows:
    """Columns that grow by some lines at a time."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.epoch: Epoch | None = None
        self.kinds: dict[str, int] = {}
        self.people: dict[str, int] = {}
        self.segments: list[Segment] = []
        self.roles: list[tuple[int, int]] = []
        self.counts: list[int] = []
        self.columns: dict[str, list[Array]] = {name: [] for name in _COLUMNS}
        self.meaning: Meaning | None = None
        self.scale_line = 0

    def begin(self, meaning: Meaning, items: Sequence[Item]) -> None:
        """Go on with another segment, whose metadata these are."""
        found = {item.keyword: item for item in items}
        check_texts(self.source, found, meaning.segment.scale)
        scale = found["TIME_SYSTEM"]
        if self.segments and self.segments[0].scale != meaning.segment.scale:
            before = f"{self.segments[0].scale} in line {self.scale_line}"
            self.source.refuse(
                scale.line, f"TIME_SYSTEM is {meaning.segment.scale}, and {before}: a message has one time system"
            )
        self.scale_line = self.scale_line or scale.line
        for name in meaning.segment.participants:
            self.people.setdefault(name, len(self.people))
        names = meaning.segment.participants
        roles = [self.people[names[i]] if i >= 0 else -1 for i in (meaning.station, meaning.seen)]
        self.roles.append((roles[0], roles[1]))
        self.segments.append(meaning.segment)
        self.counts.append(0)
        self.meaning = meaning

    def take(self, keywords: Array, dates: Array, numbers: Array, lines: Array) -> None:
        """Add rows of the present segment.

        Raises
        ------
        ValueError
            With file and line, for the first of them that has something wrong with it.
        """
        assert self.meaning is not None
        words, code = coded(keywords)
        taken = [self.meaning.row(word.decode("utf-8", "replace")) for word in words]
        readings, no_date = read_dates(dates)
        values, no_number = read_numbers(numbers)
        no_word = np.array([isinstance(row, str) for row in taken])[code]
        early = (readings.day < UTC_BEGINS) & (self.meaning.segment.scale == "UTC")
        wrong = no_word | no_date | no_number | early
        if wrong.any():
            i = int(np.argmax(wrong))
            faults = {"date": bool(no_date[i]), "number": bool(no_number[i])}
            self._refuse(taken[code[i]], _text(keywords[i]), _text(dates[i]), _text(numbers[i]), faults, int(lines[i]))
        rows = [row for row in taken if isinstance(row, Row)]
        found = instants(self.meaning.segment.scale, readings, self.epoch)
        self.epoch = found.epoch
        people = [self.people[self.meaning.segment.participants[r.participant]] if r.participant >= 0 else -1 for r in rows]
        kinds = [self.kinds.setdefault(row.kind, len(self.kinds)) for row in rows]
        values *= np.array([row.factor for row in rows])[code]
        values += np.array([row.offset for row in rows])[code]
        new = {"t": found.t, "value": values, "kind": np.array(kinds)[code], "participant": np.array(people)[code]}
        for name, column in (new | {"line": lines}).items():
            self.columns[name].append(column.astype(_COLUMNS[name], copy=False))
        self.counts[-1] += len(code)

    def _refuse(self, row: Row | str, keyword: str, date: str, number: str, faults: dict[str, bool], line: int) -> None:
        if isinstance(row, str):
            reason = row
        elif faults["date"]:
            reason = f"{keyword}: {shown(date)} is no date, such as 2005-06-08T17:41:00 or 2005-159T17:41:00"
        elif faults["number"]:
            reason = f"{keyword}: {shown(number)} is no number"
        else:
            reason = f"{keyword}: {date}: there is no UTC before 1960; give it in UT1 or TT"
        self.source.refuse(line, reason)

    def observations(self) -> Observations:
        """All rows, with what is assumed and open."""
        if self.epoch is None:
            self.source.refuse(1, "the message has no data")
        columns: dict[str, Any] = {}
        for name, parts in self.columns.items():
            columns[name] = parts[0] if len(parts) == 1 else np.concatenate(parts)
            parts.clear()
        if (columns["participant"] < 0).all():
            columns["participant"] = -1
        station, seen = (self._by_segment([role[i] for role in self.roles], np.int32) for i in (0, 1))
        tags = [TAGS.index(segment.tag or "receive") for segment in self.segments]
        segment = self._by_segment(list(range(len(self.segments))), np.int32)
        weather: dict[str, Any] = {**self._weather(columns)}
        kinds = tuple(self.kinds)
        present = dict(zip(kinds, np.bincount(columns["kind"]).tolist(), strict=True))
        return Observations(
            epoch=self.epoch, **columns, kinds=kinds, segments=tuple(self.segments), participants=tuple(self.people),
            station=station, object=seen, segment=segment, tag=self._by_segment(tags, np.int8), files=(self.source.name,),
            **weather, assumed=assumed_of(self.segments), open=open_of(self.segments, present),
        )  # fmt: skip

    def _by_segment(self, values: list[int], kind: Any) -> Any:
        """A column that is the same throughout each segment."""
        return values[0] if len(set(values)) == 1 else np.repeat(np.array(values, dtype=kind), self.counts)

    def _weather(self, columns: dict[str, Any]) -> dict[str, Array]:
        """Weather of each row, from rows of it in the same segment: between two of them linearly, held before and after."""
        out: dict[str, Array] = {}
        ends = np.cumsum([0, *self.counts])
        for name in ("pressure", "temperature", "humidity"):
            if name not in self.kinds:
                continue
            column = np.full(len(columns["t"]), np.nan)
            for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
                part = slice(start, end)
                own = np.flatnonzero(columns["kind"][part] == self.kinds[name]) + start
                if len(own):
                    own = own[np.argsort(columns["t"][own], kind="stable")]
                    column[part] = np.interp(columns["t"][part], columns["t"][own], columns["value"][own])
            out[name] = column
        return out


def _text(word: bytes) -> str:
    return bytes(word).decode("utf-8", "replace")


def assumed_of(segments: Sequence[Segment]) -> tuple[str, ...]:
    """What is assumed of segments that do not say it."""
    out = []
    if any(segment.tag is None and segment.path for segment in segments):
        out.append("times are those of reception where TIMETAG_REF is not given (--tag transmit says otherwise)")
    return tuple(out)


def open_of(segments: Sequence[Segment], present: Mapping[str, int]) -> tuple[str, ...]:
    """What only the user can say, given the kinds of rows that there are."""
    out = []
    kinds = {kind for kind, count in present.items() if count}
    closed = sorted({",".join(s.path) for s in segments if s.path and s.range_is is None})
    if closed and kinds & set(_ALONG):
        along = f"ranges and range rates along {'; '.join(closed[:3])}"
        out.append(f"whether {along} are half or all of the way: --range two-way or --range round-trip")
    if "range_ru" in kinds:
        out.append("how long a range unit of the station is: --range-unit 0.28m")
    if "range_rate_averaged" in kinds and any(s.interval is None or s.interval_reference is None for s in segments):
        out.append("over which interval range rates are averaged: --interval 60 and --interval-reference middle")
    if "right_ascension" in kinds:
        out.append("what directions are reduced to: --angles astrometric, --angles geocentric or --angles apparent")
        if any(segment.frame not in KNOWN for segment in segments):
            out.append("the axes of right ascension and declination: --frame EME2000")
    if any(c.applied is None for segment in segments for c in segment.corrections):
        out.append("whether the corrections are applied: --corrections applied or --corrections open")
    if any(dict(segment.said).get("DOPPLER_COUNT_ROLLOVER", "").upper() == "YES" for segment in segments):
        out.append("at how many cycles the Doppler counter rolled over, which the message has no keyword for")
    measured = sorted(kind for kind in kinds if not KINDS[kind].auxiliary)
    if measured:
        out.append(asked_sigmas(measured))
    return tuple(out)
