"""What the metadata of a TDM's segment mean: the conventions as a `Segment`, and what each keyword of its data is in SI."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from piazzi.formats.conventions import Conventions
from piazzi.formats.frames import frame_named
from piazzi.formats.ndm import Item, Source, known, needed, numbered, shown, single
from piazzi.formats.observations import Correction, Segment
from piazzi.formats.tdm_keywords import (
    ANGLE_KINDS,
    CORRECTIONS,
    DEGREE,
    METADATA,
    MODES,
    OF_PARTICIPANT,
    PLAIN,
    RANGE_FACTORS,
    TEXTS,
)

_WHAT = "the metadata of a segment"


class Row(NamedTuple):
    """What rows of a keyword are: kind, value = number * factor + offset, and the participant that it names, -1 for none."""

    kind: str
    factor: float
    offset: float
    participant: int


@dataclass(frozen=True)
class Meaning:
    """A segment's conventions, and how to take its rows; `station` and `seen` are places among the participants, or -1."""

    segment: Segment
    station: int
    seen: int
    angles: tuple[str, str] | None
    range_kind: str
    range_factor: float
    offset: float
    count_scale: float

    def row(self, keyword: str) -> Row | str:
        """What a keyword of the data means here, or why it cannot be taken."""
        if keyword == "RANGE":
            return Row(self.range_kind, self.range_factor, 0.0, -1)
        if keyword in ("ANGLE_1", "ANGLE_2"):
            if self.angles is None:
                return f"{keyword} needs an ANGLE_TYPE among the metadata"
            return Row(self.angles[int(keyword[-1]) - 1], DEGREE, 0.0, -1)
        quantity, participant = PLAIN.get(keyword), -1
        if quantity is None:
            name, _, number = keyword.rpartition("_")
            quantity = OF_PARTICIPANT.get(name)
            if quantity is None or not (number.isdigit() and len(number) == 1 and number != "0"):
                return f"{shown(keyword)} is no keyword of the data"
            participant = int(number) - 1
            if participant >= len(self.segment.participants):
                return f"{keyword}: there is no PARTICIPANT_{number}"
        offset = self.offset if quantity.kind == "receive_frequency" else 0.0
        factor = 1.0 / self.count_scale if quantity.kind == "doppler_count" else quantity.factor
        return Row(quantity.kind, factor, offset, participant)


def meaning_of(source: Source, items: Sequence[Item], line: int, told: Conventions) -> Meaning:
    """The meaning of a segment whose metadata are these items, and which ends in a line.

    Raises
    ------
    ValueError
        With file, line and reason: for keywords that are not of the format, given twice, missing, or with a wrong value.
    """
    for item in items:
        known(source, item, METADATA, _WHAT)
    found = single(source, items, _WHAT)
    needed(source, found, ("TIME_SYSTEM", "PARTICIPANT_1"), _WHAT, line)
    participants = _participants(source, found)
    paths = _paths(source, found, participants)
    unit = source.word(found["RANGE_UNITS"], ("KM", "S", "RU")) if "RANGE_UNITS" in found else "KM"
    unit = unit if unit == "RU" else unit.lower()
    angles = ANGLE_KINDS[source.word(found["ANGLE_TYPE"], ANGLE_KINDS)] if "ANGLE_TYPE" in found else None
    path = next((p for p in paths if p), None)
    segment = Segment(
        scale=_scale(source, found["TIME_SYSTEM"], participants, told),
        participants=participants,
        path=_names(paths[0], participants),
        second_path=_names(paths[1], participants),
        mode=source.word(found["MODE"], MODES).lower() if "MODE" in found else None,
        way=_way(path) if paths[1] is None else None,
        range_is="sum" if path and _way(path) == "one-way" and paths[1] is None else None,
        range_modulus=_number(source, found, "RANGE_MODULUS", 0.0) * RANGE_FACTORS[unit],
        range_mode=_word(source, found, "RANGE_MODE", ("COHERENT", "CONSTANT", "ONE_WAY")),
        tag=_word(source, found, "TIMETAG_REF", ("TRANSMIT", "RECEIVE")),
        interval=source.number(found["INTEGRATION_INTERVAL"]) if "INTEGRATION_INTERVAL" in found else None,
        interval_reference=_word(source, found, "INTEGRATION_REF", ("START", "MIDDLE", "END")),
        corrections=_corrections(source, found, RANGE_FACTORS[unit]),
        frame=frame_named(found["REFERENCE_FRAME"].text) if "REFERENCE_FRAME" in found else None,
        frequencies=_frequencies(source, found),
        turnaround=_turnaround(source, found),
        delays=_delays(source, found, participants),
        quality=_word(source, found, "DATA_QUALITY", ("RAW", "VALIDATED", "DEGRADED")),
        said=tuple((keyword, item.text) for keyword, item in found.items() if keyword not in ("TIME_SYSTEM",)),
    )
    station, seen = _roles(path, participants)
    offset, scale = _number(source, found, "FREQ_OFFSET", 0.0), _number(source, found, "DOPPLER_COUNT_SCALE", 1.0)
    if not scale:
        source.refuse(found["DOPPLER_COUNT_SCALE"].line, "DOPPLER_COUNT_SCALE is 0; counts cannot be divided by it")
    kind = "range_ru" if unit == "RU" else "range"
    return Meaning(segment, station, seen, angles, kind, RANGE_FACTORS[unit], offset, scale)


_QUOTED = re.compile(r"""^(?:'(?=.*'$)|"(?=.*"$)|\u2018(?=.*\u2019$))(.*).$""")  # a name as some programs write it


def _participants(source: Source, found: dict[str, Item]) -> tuple[str, ...]:
    people = dict(numbered(found, "PARTICIPANT"))
    for number in range(1, max(people) + 1):
        if number not in people or not _QUOTED.sub(r"\1", people[number].text):
            source.refuse(people[max(people)].line, f"{_WHAT} has no PARTICIPANT_{number}")
    return tuple(_QUOTED.sub(r"\1", people[number].text) for number in sorted(people))


def _paths(source: Source, found: dict[str, Item], people: tuple[str, ...]) -> tuple[list[int] | None, list[int] | None]:
    """The path of a signal as places among the participants, and the second one of a difference."""
    if "PATH" in found and ("PATH_1" in found or "PATH_2" in found):
        source.refuse(found["PATH"].line, "a segment has PATH, or PATH_1 and PATH_2, not both")
    first = found.get("PATH") or found.get("PATH_1")
    return _path(source, first, people), _path(source, found.get("PATH_2"), people)


def _path(source: Source, item: Item | None, people: tuple[str, ...]) -> list[int] | None:
    if item is None:
        return None
    words = [word.strip() for word in item.text.split(",")]
    if len(words) < 2 or not all(word.isascii() and word.isdigit() and 1 <= int(word[:4]) <= len(people) for word in words):
        source.refuse(item.line, f"{item.keyword} is {shown(item.text)}; it must be numbers of participants, as 1,2,1")
    return [int(word) - 1 for word in words]


def _names(path: list[int] | None, people: tuple[str, ...]) -> tuple[str, ...] | None:
    return tuple(people[i] for i in path) if path else None


def _way(path: list[int] | None) -> str | None:
    if path is None:
        return None
    if len(path) > 3:
        return "relayed"
    return "one-way" if len(path) == 2 else "two-way" if path[0] == path[-1] else "three-way"


def _roles(path: list[int] | None, people: tuple[str, ...]) -> tuple[int, int]:
    """Who received, and who is seen: the first of one leg, or who is in the middle of several."""
    if path is None:
        return 0, -1
    return path[-1], path[0] if len(path) == 2 else path[len(path) // 2]


def _scale(source: Source, item: Item, people: tuple[str, ...], told: Conventions) -> str:
    scale = source.scale(item)
    for name in people:
        if (other := dict(told.scales).get(name, scale)) != scale:
            source.refuse(item.line, f"TIME_SYSTEM is {scale}, and {other} was said for {name}")
    return scale


def _number(source: Source, found: dict[str, Item], keyword: str, default: float) -> float:
    return source.number(found[keyword]) if keyword in found else default


def _word(source: Source, found: dict[str, Item], keyword: str, words: Sequence[str]) -> str | None:
    return source.word(found[keyword], words).lower() if keyword in found else None


def _corrections(source: Source, found: dict[str, Item], range_factor: float) -> tuple[Correction, ...]:
    applied = None
    if "CORRECTIONS_APPLIED" in found:
        applied = source.word(found["CORRECTIONS_APPLIED"], ("YES", "NO")) == "YES"
    out = []
    for name, factor in CORRECTIONS.items():
        if (item := found.get(f"CORRECTION_{name}")) is not None:
            size = source.number(item) * (range_factor if factor is None else factor)
            out.append(Correction(name.lower(), size, applied))
    return tuple(out)


def _frequencies(source: Source, found: dict[str, Item]) -> tuple[tuple[str, float], ...]:
    names = {"FREQ_OFFSET": "offset", "DOPPLER_COUNT_BIAS": "count bias"}
    return tuple((name, source.number(found[keyword])) for keyword, name in names.items() if keyword in found)


def _turnaround(source: Source, found: dict[str, Item]) -> float | None:
    over, under = (found.get(f"TURNAROUND_{part}") for part in ("NUMERATOR", "DENOMINATOR"))
    if over is None or under is None:
        if over is not under:
            source.refuse((over or under or Item("", "", 0)).line, "TURNAROUND_NUMERATOR and _DENOMINATOR go together")
        return None
    if not source.number(under):
        source.refuse(under.line, "TURNAROUND_DENOMINATOR is 0")
    return source.number(over) / source.number(under)


def _delays(source: Source, found: dict[str, Item], people: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
    out = []
    for event in ("TRANSMIT", "RECEIVE"):
        for number, item in numbered(found, f"{event}_DELAY"):
            if number > len(people):
                source.refuse(item.line, f"{item.keyword}: there is no PARTICIPANT_{number}")
            out.append((f"{event.lower()} {people[number - 1]}", source.number(item)))
    return tuple(out)


def check_texts(source: Source, found: dict[str, Item], scale: str) -> None:
    """Dates and whole numbers among what is kept as text are such."""
    for keyword in TEXTS:
        if keyword in found and keyword.endswith("_TIME"):
            source.date(found[keyword], scale)
        elif keyword in found and keyword.endswith("_DEGREE"):
            source.whole(found[keyword])
