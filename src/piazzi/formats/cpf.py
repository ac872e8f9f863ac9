"""Predictions for laser stations: files in the Consolidated Prediction Format, versions 1 and 2.

Source: Consolidated Laser Ranging Prediction Format, versions 1.01 (2006) and 2.00 (2018), International Laser Ranging Service.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from piazzi.formats.conventions import Conventions
from piazzi.formats.crd_headers import cospar
from piazzi.formats.dates import Readings, instants
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.fields import calendar_day, integer, number

FRAMES = ("ITRF", "TOD", "EME2000")
_LIGHT_TIME = "positions with light time, which are no orbit"


@dataclass
class _File:
    """What was read so far: readings of UTC, m and m/s."""

    said: dict[str, str] = field(default_factory=dict)
    frame: str | None = None
    days: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    position: list[tuple[float, ...]] = field(default_factory=list)
    velocity: list[tuple[float, ...]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    direction: int = -1  # of the last record 10
    left_out: dict[str, int] = field(default_factory=dict)


def read(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The arc that is predicted: positions of the centre of mass or of the reflector, as `said` has it.

    Raises ValueError with file, line and reason.
    """
    file, line = _File(), 0
    try:
        for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
            fields = text.split()
            if fields and _take(file, fields, line):
                break
        else:
            raise ValueError("the file ends without record 99: it was cut short")
        if not file.days:
            raise ValueError(f"the file has no {'orbit: all its ' + _LIGHT_TIME if file.left_out else 'positions'}")
        return _ephemeris(file, name)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _take(file: _File, fields: Sequence[str], line: int) -> bool:
    """Read one record; True at the end of the file."""
    kind = fields[0].upper()
    if not file.said and kind not in ("H1", "00"):
        raise ValueError(f"record {fields[0][:20]!r} stands before H1")
    match kind:
        case "H1":
            _first(file, fields)
        case "H2":
            _second(file, fields)
        case "H5":
            file.said["centre of mass of a sphere"] = fields[1] if len(fields) > 1 else ""
        case "10":
            _position(file, fields, line)
        case "20":
            if len(fields) < 5:
                raise ValueError(f"record 20 has {len(fields)} fields; it needs the direction and three velocities")
            if file.direction == 0 and integer(fields[1], "direction") == 0:
                file.velocity[-1] = tuple(number(text, "velocity") for text in fields[2:5])
        case "99":
            return True
        case "H3" | "H4" | "H9" | "00" | "30" | "40" | "50" | "60" | "70":
            pass
        case _:
            raise ValueError(f"record {fields[0][:20]!r} is not known")
    return False


def _first(file: _File, fields: Sequence[str]) -> None:
    if file.said:
        raise ValueError("a second H1: one file holds one prediction")
    if len(fields) < 9 or fields[1].upper() != "CPF":
        raise ValueError(
            f"H1 has {len(fields)} fields, the second {fields[1] if len(fields) > 1 else ''!r}; it needs CPF and 7 more"
        )
    version = integer(fields[2], "version in H1")
    if version not in (1, 2):
        raise ValueError(f"CPF version {version} is not known; 1 and 2 are")
    at = 8 + version  # version 2 has the number within the day as well
    if len(fields) <= at:
        raise ValueError(f"H1 has {len(fields)} fields; it needs {at + 1}")
    year, month, day = (integer(text, "date in H1") for text in fields[4:7])
    calendar_day(year, month, day)
    file.said |= {"version": str(version), "source": fields[3], "made": f"{year}-{month:02d}-{day:02d}T{fields[7]}h"}
    file.said |= {"sequence": " ".join(fields[8:at]), "target": fields[at]}


def _second(file: _File, fields: Sequence[str]) -> None:
    if len(fields) < 22:
        raise ValueError(f"H2 has {len(fields)} fields; it needs 22")
    frame, offset = integer(fields[19], "reference frame in H2"), integer(fields[21], "centre of mass in H2")
    if not 0 <= frame < len(FRAMES):
        raise ValueError(f"reference frame {frame} in H2 is not known; 0 to {len(FRAMES) - 1} are")
    file.frame = FRAMES[frame]
    file.said |= {"cospar": cospar(fields[1]), "sic": fields[2], "norad": fields[3], "step": fields[16]}
    file.said["positions of"] = "the reflector" if offset else "the centre of mass"


def _position(file: _File, fields: Sequence[str], line: int) -> None:
    if file.frame is None:
        raise ValueError("record 10 stands before H2")
    if len(fields) < 8:
        raise ValueError(f"record 10 has {len(fields)} fields; it needs direction, day, second, leap second, x, y and z")
    file.direction = integer(fields[1], "direction")
    if file.direction not in (0, 1, 2):
        raise ValueError(f"direction {file.direction} is not known; 0 to 2 are")
    day, second = integer(fields[2], "Modified Julian Day"), number(fields[3], "second of the day")
    if not 0.0 <= second < 86401.0:
        raise ValueError(f"the second of the day is {second:g}")
    leap = integer(fields[4], "leap second")
    if leap not in (0, 1):
        raise ValueError(f"leap second {leap}; it is 0, or 1 for positions after it, whose readings go on without it")
    place = tuple(number(text, "position") for text in fields[5:8])
    if file.direction:
        file.left_out[_LIGHT_TIME] = file.left_out.get(_LIGHT_TIME, 0) + 1
        return
    if leap:  # the first second of the old count is 23:59:60
        day, second = (day - 1, second + 86400.0) if second < 1.0 else (day, second - 1.0)
    if file.days and (day, second) <= (file.days[-1], file.seconds[-1]):
        raise ValueError("the position is not later than the one before it")
    file.days.append(float(day))
    file.seconds.append(second)
    file.position.append(place)
    file.velocity.append((math.nan,) * 3)
    file.lines.append(line)


def _ephemeris(file: _File, name: str) -> Ephemeris:
    seconds = np.array(file.seconds)
    whole = np.floor(seconds)
    epoch, t = instants("UTC", Readings(np.array(file.days), whole, seconds - whole))
    arc = Arc(
        name=file.said["target"],
        identifier=file.said["cospar"],
        centre="EARTH",
        frame=file.frame,
        scale="UTC",
        epoch=epoch,
        t=t,
        position=np.array(file.position),
        velocity=np.array(file.velocity),
        lines=np.array(file.lines),
    )
    return Ephemeris(arcs=(arc,), file=name, format="CPF", said=tuple(file.said.items()), left_out=tuple(file.left_out.items()))
