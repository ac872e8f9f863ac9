"""Precise orbits of satellites: SP3 files of versions a to d, positions (and velocities) with clocks and accuracies.

Source: S. Hilla, The Extended Standard Product 3 Orbit Format (SP3-d), 2016; SP3-c, 2010; sp3_docu.txt for SP3-a.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from piazzi.formats.conventions import Conventions
from piazzi.formats.dates import Readings, instants
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.fields import calendar_day, integer, number, second_of_day

# scales that the header names, and seconds to add to their readings to have those of the scale beside it
_SCALES = {"GPS": ("GPS", 0.0), "GAL": ("GPS", 0.0), "QZS": ("GPS", 0.0), "IRN": ("GPS", 0.0), "BDT": ("GPS", 14.0)}
_SCALES |= {"UTC": ("UTC", 0.0), "GLO": ("UTC", 0.0), "TAI": ("TAI", 0.0), "ccc": ("GPS", 0.0), "": ("GPS", 0.0)}
_FIXED = re.compile(r"(ITR|IGS|IGb|IGR|SLR|ECF|ECEF|WGS|PZ|GTR|CGC|BTR|NTR|U)", re.IGNORECASE)
_SPACE_FIXED = {"GCRF": "GCRF", "ICRF": "GCRF", "J2000": "EME2000", "EME00": "EME2000", "EME20": "EME2000"}
_NOTHING = 999999.0  # what stands where there is no value, in the unit of the file
MOST_DIGITS = 15  # of a standard deviation in mm
_FLAGS = ((74, "E", "clock event"), (75, "P", "predicted clock"), (78, "M", "manoeuvre"), (79, "P", "predicted"))


@dataclass
class _States:
    """What was read of one satellite: which epoch, m, s, m/s, s/s, m."""

    epochs: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    position: list[tuple[float, ...]] = field(default_factory=list)
    clock: list[float] = field(default_factory=list)
    velocity: list[tuple[float, ...]] = field(default_factory=list)
    clock_rate: list[float] = field(default_factory=list)
    sigma: list[tuple[float, ...]] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)


@dataclass
class _File:
    """What was read so far."""

    said: dict[str, str] = field(default_factory=dict)
    scale: str | None = None
    base: float = 0.0  # of the exponents of each position's standard deviation, in mm
    names: list[str] = field(default_factory=list)
    codes: list[int] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    days: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    states: dict[str, _States] = field(default_factory=dict)
    last: _States | None = None  # the one that a line of velocities or correlations belongs to; None where it was missing
    left_out: dict[str, int] = field(default_factory=dict)


def read(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """One arc for each satellite that has positions; ValueError with file, line and reason."""
    file, line = _File(), 0
    try:
        for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
            if _take(file, text.rstrip("\r"), line):
                break
        else:
            raise ValueError("the file ends without EOF: it was cut short")
        if not file.states:
            raise ValueError("the file has no positions")
        return _ephemeris(file, name)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _take(file: _File, text: str, line: int) -> bool:
    """Read one line; True at the end of the file."""
    if line == 1:
        _first(file, text)
    elif text[:1] == "P" and file.days:
        _position(file, text, line)
    elif text[:1] == "V" and file.last is not None:
        _velocity(file.last, text)
    elif text[:2] == "EP" and file.last is not None:
        file.last.sigma[-1] = tuple(1e-3 * number(cell, "standard deviation") for cell in text.split()[1:4])
    elif text[:1] in ("V", "E") and file.days and text[:2] != "EO":
        pass  # of a position that is missing, or correlations of velocities
    elif text[:1] == "*":
        _epoch(file, text)
    elif text[:3] == "EOF":
        return True
    elif text[:2] == "/*":
        file.comments.append(text[2:].strip())
    elif not file.days and text[:2] in ("+ ", "++", "%c", "%f", "%i", "##"):
        _header(file, text)
    elif text.strip():
        raise ValueError(f"no line begins with {text[:3]!r} {'after the first epoch' if file.days else 'in the header'}")
    return False


def _first(file: _File, text: str) -> None:
    if not re.fullmatch(r"#[a-d][PV]", text[:3]):
        raise ValueError(f"the file begins with {text[:3]!r}; SP3 begins with #, a version of a to d, and P or V")
    _date(text)
    integer(text[32:39].strip(), "number of epochs")
    ends = {"version": (1, 2), "epochs": (32, 39), "data": (40, 45), "frame": (46, 51), "orbit": (52, 55), "agency": (56, 60)}
    file.said |= {key: text[a:b].strip() for key, (a, b) in ends.items()}


def _header(file: _File, text: str) -> None:
    cells = [text[i : i + 3].strip() for i in range(9, min(len(text), 60), 3)]
    match text[:2]:
        case "+ ":
            file.names += [_satellite(cell) for cell in cells if cell.strip("0")]
        case "++":
            file.codes += [integer(cell or "0", "accuracy code") for cell in cells]
        case "%c" if file.scale is None:
            file.scale = text[9:12].strip()
            if file.scale not in _SCALES:
                raise ValueError(f"time scale {file.scale!r} is not known; there are {', '.join(filter(None, _SCALES))}")
        case "%f" if not file.base:
            file.base = number(text[3:13].strip() or "0", "base of standard deviations")


def _satellite(cell: str) -> str:
    """Name of a satellite; version a has numbers alone, all of GPS."""
    name = cell.replace(" ", "0")
    return f"G{int(name):02d}" if name.isdecimal() and name.isascii() else name


def _date(text: str) -> tuple[float, float]:
    """Modified Julian Day and second of it."""
    year, month, day, hour, minute = (
        integer(text[a:b].strip(), "date") for a, b in ((3, 7), (8, 10), (11, 13), (14, 16), (17, 19))
    )
    second = number(text[20:31].strip(), "second")
    seconds = second_of_day(hour, minute, second)
    return float(calendar_day(year, month, day)), seconds


def _epoch(file: _File, text: str) -> None:
    day, seconds = _date(text)
    if file.days and (day, seconds) <= (file.days[-1], file.seconds[-1]):
        raise ValueError("the epoch is not later than the one before it")
    file.days.append(day)
    file.seconds.append(seconds)
    file.last = None


def _position(file: _File, text: str, line: int) -> None:
    name = _satellite(text[1:4].strip())
    place = tuple(1e3 * number(text[a : a + 14].strip(), f"position of {name!r}") for a in (4, 18, 32))
    if not any(place) or all(abs(value) > 1e3 * _NOTHING for value in place):
        file.last = None
        file.left_out["positions that are missing"] = file.left_out.get("positions that are missing", 0) + 1
        return
    file.last = states = file.states.setdefault(name, _States())
    if states.epochs and states.epochs[-1] == len(file.days) - 1:
        raise ValueError(f"{name} has a second position at this epoch")
    states.epochs.append(len(file.days) - 1)
    states.lines.append(line)
    states.position.append(place)
    states.clock.append(_clock(text, 1e-6))
    states.velocity.append((math.nan,) * 3)
    states.clock_rate.append(math.nan)
    states.sigma.append(tuple(_deviation(file, name, text[a : a + 2].strip()) for a in (61, 64, 67)))
    states.flags.append(" ".join(word for column, letter, word in _FLAGS if text[column : column + 1] == letter))


def _velocity(states: _States, text: str) -> None:
    speed = tuple(0.1 * number(text[a : a + 14].strip(), "velocity") for a in (4, 18, 32))
    if any(speed) and not all(abs(value) > 0.1 * _NOTHING for value in speed):
        states.velocity[-1] = speed
    states.clock_rate[-1] = _clock(text, 1e-10)


def _clock(text: str, unit: float) -> float:
    cell = text[46:60].strip()
    value = number(cell, "clock") if cell else _NOTHING
    return math.nan if abs(value) >= _NOTHING else unit * value


def _deviation(file: _File, name: str, cell: str) -> float:
    """Standard deviation of a coordinate in m: by its own exponent, else by the satellite's code; NaN for neither."""
    if cell and file.base > 0.0:
        power = integer(cell, "exponent of a standard deviation")
        if abs(power * math.log10(file.base)) > MOST_DIGITS:
            raise ValueError(f"a standard deviation of {file.base:g}**{power} mm is no length")
        return float(1e-3 * file.base**power)
    code = file.codes[file.names.index(name)] if name in file.names[: len(file.codes)] else 0
    return 1e-3 * 2.0**code if 0 < code < 60 else math.nan


def _ephemeris(file: _File, name: str) -> Ephemeris:
    scale, ahead = _SCALES[file.scale or ""]
    days, seconds = np.array(file.days), np.array(file.seconds) + ahead
    whole = np.floor(seconds)
    epoch, t = instants(scale, Readings(days, whole, seconds - whole))
    said = file.said["frame"]
    frame, assumed = _SPACE_FIXED.get(said, "ITRF"), []
    if not _FIXED.match(said) and said not in _SPACE_FIXED:
        assumed.append(f"axes {said!r} are those of the ITRF")
    if not file.scale or file.scale == "ccc":
        assumed.append("dates are in GPS time")
    arcs = tuple(
        Arc(
            name=satellite,
            identifier=satellite,
            centre="EARTH",
            frame=frame,
            scale=scale,
            epoch=epoch,
            t=t[states.epochs],
            position=np.array(states.position),
            velocity=np.array(states.velocity),
            clock=np.array(states.clock),
            clock_rate=np.array(states.clock_rate),
            sigma=np.array(states.sigma),
            flags=tuple(states.flags) if any(states.flags) else (),
            lines=np.array(states.lines),
        )
        for satellite, states in file.states.items()
    )
    header = (*file.said.items(), ("scale", file.scale or ""), *(("comment", text) for text in file.comments if text))
    return Ephemeris(
        arcs=arcs, file=name, format="SP3", said=header, assumed=tuple(assumed), left_out=tuple(file.left_out.items())
    )
