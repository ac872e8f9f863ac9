"""Records of laser ranging files (CRD), as they stand: ranges, weather, calibrations, under the headers that hold for them."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from piazzi.formats.crd_headers import (
    EVENTS,
    ONE_WAY,
    RANGE_TYPES,
    Session,
    Station,
    Target,
    read_session,
    read_station,
    read_target,
    read_version,
)
from piazzi.formats.fields import number, number_or_nan
from piazzi.text import one_line

_DATA = frozenset(("12", "20", "21", "30", "40", "41", "42", "50", "60"))
_NOISE = b"1"  # filter flag of a full rate row; 0 unknown, 2 data


class Group(NamedTuple):
    """Rows of one pass with the same configuration, event and window (or filter flag)."""

    session: int
    configuration: str
    event: int
    window: str  # s, of normal points
    noise: bool


@dataclass(eq=False)
class Laser:
    """What was read so far: columns of all rows, and their passes."""

    seconds: Any = field(default_factory=lambda: array("d"))
    flight: Any = field(default_factory=lambda: array("d"))
    group: Any = field(default_factory=lambda: array("i"))
    line: Any = field(default_factory=lambda: array("i"))
    sessions: list[Session] = field(default_factory=list)
    first: list[int] = field(default_factory=list)  # row of each pass
    groups: list[Group] = field(default_factory=list)
    weather: list[list[tuple[float, float, float, float]]] = field(default_factory=list)  # s, Pa, K, 0 to 1
    delays: list[dict[str, list[float]]] = field(default_factory=list)  # s, by configuration
    skipped: dict[str, int] = field(default_factory=dict)


def parse(lines: Iterable[bytes], name: str) -> Laser:
    """All records of a file, as they stand in it."""
    reader, laser = _Reader(), Laser()
    known: dict[tuple[bytes, ...], int] = {}
    put_seconds, put_flight, put_group, put_line = (
        column.append for column in (laser.seconds, laser.flight, laser.group, laser.line)
    )
    count, line = 0, b""
    try:
        for count, line in enumerate(lines, 1):
            if line[:3] in (b"10 ", b"11 "):
                kind, seconds, flight, configuration, event, what, *_ = line.split(None, 6)
                key = (kind, configuration, event, what)
                if (group := known.get(key, -1)) < 0:
                    group = known[key] = reader.group(laser, key)
                if b"_" in seconds or b"_" in flight:  # which float would read over
                    raise ValueError("no number")
                put_seconds(float(seconds))
                put_flight(float(flight))
                put_group(group)
                put_line(count)
            elif reader.other(laser, line.decode("latin-1").split(), count):
                known.clear()
        if reader.open:
            raise ValueError("the file ends before H8, within a pass: it was cut short")
    except ValueError as error:
        raise ValueError(f"{name}: line {count}: {_reason(line, error)}") from None
    if not laser.sessions:
        raise ValueError(f"{name}: line {count}: the file has no pass (H4)")
    return laser


def _reason(line: bytes, error: ValueError) -> str:
    """What is wrong with a line; of a range, the field that is no number."""
    if line[:3] in (b"10 ", b"11 ") and not str(error).startswith(("configuration", "epoch", "a range", "H4")):
        fields = line.decode("latin-1").split()
        if len(fields) < 6:
            return f"record {fields[0]} has {len(fields)} fields; it needs time, flight time, configuration, event and more"
        try:
            number(fields[1], "second of the day")
            number(fields[2], "flight time")
        except ValueError as other:
            return str(other)
    return str(error)


class _Reader:
    """Headers that hold until others come."""

    def __init__(self) -> None:
        self.version = 0
        self.station: Station | None = None
        self.target: Target | None = None
        self.open = False
        self.configuration: dict[str, tuple[str, ...]] = {}

    def group(self, laser: Laser, key: tuple[bytes, ...]) -> int:
        """A number for the rows of this pass that are of a kind."""
        if not self.open:
            raise ValueError("a range stands before H4, outside of a pass")
        kind, configuration, code, what = key
        if not (len(code) == 1 and code.isdigit() and int(code) < len(EVENTS)):
            raise ValueError(f"epoch event {code.decode('latin-1')[:20]!r} is not known; 0 to {len(EVENTS) - 1} are")
        event, session = int(code), laser.sessions[-1]
        one_way = event >= ONE_WAY
        if session.range_type in RANGE_TYPES[1:3] and (session.range_type == "one-way") != one_way:
            raise ValueError(f"H4 says {session.range_type} ranges, but epoch event {event} is that of {EVENTS[event]}")
        window = ""
        if kind == b"11":
            window = f"{number_or_nan(what.decode('latin-1'), 'length of the window'):g}"
        elif what not in (b"0", b"1", b"2"):
            raise ValueError(f"a range has filter flag {what.decode('latin-1')[:20]!r}; 0, 1 and 2 are known")
        noise = kind == b"10" and what == _NOISE
        laser.groups.append(Group(len(laser.sessions) - 1, configuration.decode("latin-1"), event, window, noise))
        return len(laser.groups) - 1

    def other(self, laser: Laser, fields: Sequence[str], line: int) -> bool:
        """Take a record that is no range; True where rows after it are of another pass."""
        if not fields:
            return False
        kind = fields[0].upper()
        if kind in _DATA:
            self._data(laser, kind, fields)
        elif kind[0] == "H":
            return self._header(laser, kind, fields, line)
        elif kind[0] == "C" and len(kind) == 2 and kind[1] in "01234567":
            self._configure(laser, kind, fields)
        elif kind != "00" and not (kind[0] == "9" and len(kind) == 2):
            raise ValueError(f"record {fields[0][:20]!r} is not known")
        return False

    def _header(self, laser: Laser, kind: str, fields: Sequence[str], line: int) -> bool:
        if kind in ("H8", "H9"):
            if kind == "H9" and self.open:
                raise ValueError("H9 ends the file within a pass; H8 is missing")
            self.open = False
        elif kind == "H5":
            if self.open:
                laser.sessions[-1] = replace(laser.sessions[-1], prediction=" ".join(fields[1:]))
        elif self.open:
            began = laser.sessions[-1].line
            raise ValueError(f"{one_line(kind, 20)} within the pass that began in line {began}; H8 is missing")
        elif kind == "H1":
            self.version, self.station, self.target, self.configuration = read_version(fields), None, None, {}
        elif not self.version:
            raise ValueError(f"{kind} stands before H1")
        elif kind == "H2":
            self.station = read_station(fields)
        elif kind == "H3":
            self.target = read_target(fields)
        elif kind == "H4":
            if self.station is None or self.target is None:
                raise ValueError(f"H4 stands before {'H2' if self.station is None else 'H3'}")
            session = read_session(fields, self.version, self.station, self.target, line)
            laser.sessions.append(replace(session, configuration={}, wavelengths={}))
            laser.first.append(len(laser.seconds))
            laser.weather.append([])
            laser.delays.append({})
            self.open = True
            return True
        else:
            raise ValueError(f"record {fields[0][:20]!r} is not known")
        return kind == "H8"

    def _configure(self, laser: Laser, kind: str, fields: Sequence[str]) -> None:
        if not self.open:
            raise ValueError(f"{kind} stands before H4, outside of a pass")
        session = laser.sessions[-1]
        name = fields[3 if kind == "C0" else 2] if len(fields) > 3 else ""
        if kind == "C0" and name:
            session.wavelengths[name] = 1e-9 * number(fields[2], "wavelength in C0")
            if not 1e-7 < session.wavelengths[name] < 1e-4:
                raise ValueError(f"wavelength {fields[2]} nm in C0 is none of a laser")
        session.configuration[f"{kind} {name}".strip()] = tuple(fields[2:])

    def _data(self, laser: Laser, kind: str, fields: Sequence[str]) -> None:
        if not self.open:
            if kind == "60":
                return
            raise ValueError(f"record {kind} stands before H4, outside of a pass")
        if kind == "20":
            if len(fields) < 5:
                raise ValueError(f"record 20 has {len(fields)} fields; it needs time, pressure, temperature and humidity")
            pressure, temperature, humidity = (
                value if (value := number_or_nan(text, name)) >= 0.0 else math.nan
                for text, name in zip(fields[2:5], ("pressure", "temperature", "humidity"), strict=True)
            )
            at = number(fields[1], "second of the day")
            laser.weather[-1].append((at, 100.0 * pressure, temperature, 0.01 * humidity))
        elif kind == "40" and len(fields) > 7:
            delay = number_or_nan(fields[7], "station delay")
            if math.isfinite(delay):
                laser.delays[-1].setdefault(fields[3], []).append(1e-12 * delay)
        elif kind == "30":
            laser.skipped["pointing angles"] = laser.skipped.get("pointing angles", 0) + 1
