"""Radar and optical observations of space surveillance, one in 75 columns or more (B3): types 1 to 5, 8 and 9, 0 and 6 too.

A minus sign is punched over the last digit of a number (J to R stand for -1 to -9, } for -0).  Ranges have a decimal exponent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from piazzi.formats.conventions import Conventions
from piazzi.formats.fields import day_of_year, integer, second_of_day
from piazzi.formats.kinds import asked_sigmas
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

# what each type measures: directions (horizon or equator), range, range rate, place of the observer
_TYPES = {
    "0": ("", False, True), "1": ("horizon", False, False), "2": ("horizon", True, False), "3": ("horizon", True, True),
    "4": ("horizon", True, True), "5": ("equator", False, False), "6": ("", True, False), "8": ("horizon", True, False),
    "9": ("equator", True, False),
}  # fmt: skip
_FASTEST = 12e3  # m/s that a range changes by
_PASS = 600.0  # s without a range after which another pass begins
_NEGATIVE = {letter: str(k) for k, letter in enumerate("}JKLMNOPQR")}
_POSITIVE = {letter: str(k) for k, letter in enumerate("{ABCDEFGHI")}


class _Range(NamedTuple):
    line: int
    who: tuple[str, str]  # sensor and object
    time: float  # s, of days and seconds
    value: float  # m


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Ranges, range rates and directions; km and degrees turned to SI.

    Ranges whose exponent contradicts their neighbours are told and not to be used; ``repair="exponent"`` mends them.
    Raises ValueError with file, line and reason.
    """
    lines = data.decode("latin-1").split("\n")
    moving = any(line[74:75] in ("8", "9") for line in lines)
    rows, number_of_line = Rows(("place_axes",) if moving else ()), 0
    try:
        shifts = contradictions(_ranges(lines))
        mend = told.option("repair") == "exponent"
        for number_of_line, line in enumerate(lines, 1):
            if line.strip():
                _observation(rows, line.rstrip(), number_of_line, shifts.get(number_of_line, 0), mend)
        return rows.table(name, *said_of(rows, shifts, mend, told))
    except ValueError as error:
        raise ValueError(f"{name}: line {number_of_line}: {error}") from None


def said_of(rows: Rows, shifts: dict[int, int], mend: bool, told: Conventions) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What is assumed, and what is left open."""
    assumed, left_open = [], []
    measured = list(rows.kinds)
    if "range" in measured:
        assumed.append("ranges are half of the way there and back")
    if shifts:
        count = f"{len(shifts)} range{'s' if len(shifts) > 1 else ''}"
        where = f"with an exponent that contradicts the neighbours, as in line {min(shifts)}"
        if mend:
            assumed.append(f"{count} {where}: mended")
        else:
            left_open.append(f"{count} {where}: not used; --repair exponent mends what is wrong")
    if "right_ascension" in measured:
        left_open.append("what directions are reduced to: --angles astrometric, --angles geocentric or --angles apparent")
        left_open.append("the axes of right ascension and declination: --frame EME2000")
    left_open.append(asked_sigmas(measured))
    return tuple(assumed), tuple(left_open)


def overpunched(text: str, what: str) -> int | None:
    """A whole number with its sign over the last digit; None for blanks."""
    text = text.strip()
    if not text:
        return None
    sign = -1 if text[-1] in _NEGATIVE or text[0] == "-" else 1
    digits = text[:-1].lstrip("+-") + _NEGATIVE.get(text[-1], _POSITIVE.get(text[-1], text[-1]))
    if not (digits.isdecimal() and digits.isascii()):
        raise ValueError(f"{what} is {text!r}, which is no number")
    return sign * int(digits)


def _date(line: str) -> tuple[int, float]:
    year = integer(line[9:11], "year")
    day = day_of_year(year + (1900 if year >= 57 else 2000), integer(line[11:14], "day of the year"))
    hour, minute, milli = integer(line[14:16], "hour"), integer(line[16:18], "minute"), integer(line[18:23], "second")
    return day, second_of_day(hour, minute, milli / 1e3)


def _range(line: str) -> float | None:
    """Range in m; None where there is none."""
    mantissa, exponent = line[38:45].strip(), line[45:46].strip()
    if not mantissa.strip("0"):
        return None
    return integer(mantissa, "range") * 10.0 ** (integer(exponent or "0", "exponent of the range") - 2)


def _ranges(lines: Sequence[str]) -> list[_Range]:
    """Ranges of lines that can be read, for a look at their neighbours; the others are refused later."""
    out = []
    for number_of_line, line in enumerate(lines, 1):
        try:
            day, seconds = _date(line)
            value = _range(line) if _TYPES.get(line[74:75], ("", False, False))[1] else None
        except ValueError:
            continue
        if value:
            out.append(_Range(number_of_line, (line[6:9], line[1:6]), 86400.0 * day + seconds, value))
    return out


def contradictions(ranges: Sequence[_Range]) -> dict[int, int]:
    """Powers of ten by which ranges have to grow to go with the rest of their pass, by line.

    Within a pass a range changes by no more than a satellite flies.  Where it jumps, and a power of ten would close the gap,
    the parts before and after have different exponents; the one that most of the pass has is right.
    """
    passes: dict[tuple[str, str], list[_Range]] = {}
    for found in sorted(ranges, key=lambda found: found.time):
        passes.setdefault(found.who, []).append(found)
    out: dict[int, int] = {}
    for rows in passes.values():
        starts = [0, *(k for k in range(1, len(rows)) if rows[k].time - rows[k - 1].time > _PASS), len(rows)]
        for a, b in pairwise(starts):
            out |= _within_pass(rows[a:b])
    return out


def _within_pass(rows: Sequence[_Range]) -> dict[int, int]:
    powers = [0]  # that make each range go with the first
    for before, after in pairwise(rows):
        room = _FASTEST * (after.time - before.time) + 1e3
        fits = [p for p in (0, 1, -1, 2, -2) if abs(after.value * 10.0 ** (p - powers[-1]) - before.value) <= room]
        powers.append(min(fits, key=lambda p: abs(p - powers[-1])) if fits else powers[-1])
    usual = max(set(powers), key=lambda p: (powers.count(p), p == 0))
    return {row.line: power - usual for row, power in zip(rows, powers, strict=True) if power != usual}


def _observation(rows: Rows, line: str, number_of_line: int, shift: int, mend: bool) -> None:
    if len(line) < 75:
        raise ValueError(f"an observation has 75 columns and more; this line has {len(line)}")
    kind = line[74]
    if kind not in _TYPES:
        raise ValueError(f"type {kind!r} in column 75 is not known; there are {', '.join(_TYPES)}")
    directions, has_range, has_rate = _TYPES[kind]
    day, seconds = _date(line)
    sensor, target = line[6:9].strip(), line[1:6].strip().lstrip("0")
    if not sensor or not target:
        raise ValueError("the observation has no sensor (columns 7 to 9) or no object (2 to 6)")
    segment = rows.segment(directions, scale="UTC", way="two-way", range_is="half")
    row = Row(day, seconds, sensor, target, segment, number_of_line, _place(rows, line) if kind in "89" else -1)
    if has_range and (found := _range(line)) is not None:
        _add(rows, row, "range", found * 10.0 ** (shift if mend else 0), mend or not shift)
    if has_rate:
        rate = _rate(line[46:54])
        if rate is not None:
            _add(rows, row, "range_rate", rate)
        elif kind == "0":
            raise ValueError("an observation of type 0 without a range rate")
    if directions:
        _directions(rows, row, line, directions)


def _add(rows: Rows, row: Row, kind: str, value: float, used: bool = True) -> None:
    rows.add(row, kind, value, used=used, extra={"place_axes": "ITRF" if row.place >= 0 else ""})


def _rate(text: str) -> float | None:
    """Range rate in m/s: km/s with five decimals; a point before the digits stands for a minus sign."""
    text = text.strip()
    if text.startswith("."):
        return -1e-2 * integer(text[1:], "range rate")
    value = overpunched(text, "range rate")
    return None if value is None else 1e-2 * value


def _directions(rows: Rows, row: Row, line: str, directions: str) -> None:
    up = overpunched(line[23:29], "elevation or declination")
    around = line[30:37].strip()
    if up is None or not around:
        raise ValueError("an angle is missing (columns 24 to 29 and 31 to 37)")
    if abs(up) > 900000:
        raise ValueError(f"elevation or declination {1e-4 * up:g} deg is on no sphere")
    if directions == "horizon":
        azimuth = 1e-4 * integer(around, "azimuth")
        if not 0.0 <= azimuth <= 360.0:
            raise ValueError(f"azimuth {azimuth:g} deg is on no circle")
        _add(rows, row, "azimuth", math.radians(azimuth))
        _add(rows, row, "elevation", math.radians(1e-4 * up))
        return
    padded = line[30:37].replace(" ", "0")
    hours, minutes, tenths = integer(padded[:2], "hours"), integer(padded[2:4], "minutes"), integer(padded[4:], "seconds")
    if not (0 <= hours < 24 and 0 <= minutes < 60 and 0 <= tenths < 600):
        raise ValueError(f"right ascension is {around!r}")
    _add(rows, row, "right_ascension", math.radians(15.0 * (hours + minutes / 60.0 + tenths / 36000.0)))
    _add(rows, row, "declination", math.radians(1e-4 * up))


def _place(rows: Rows, line: str) -> int:
    """Index of the observer's Earth-fixed place, which is in metres; -1 for none."""
    cells = [overpunched(line[a : a + 9], "place of the sensor") for a in (46, 55, 64)]
    found = [float(cell) for cell in cells if cell is not None]
    if len(found) < 3:
        return -1
    rows.places.append((found[0], found[1], found[2]))
    return len(rows.places) - 1
