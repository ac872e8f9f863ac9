"""Positions of satellites by visual observers: the IOD, UK and RDE forms of reports.

Sources: G. Lewis, IOD Observation Format Description, 1998, 2002; The Reporting of Satellite Observations, Slough, 1973 (UK);
R. D. Eberst's abridged form of it (RDE).  Times are of UTC; the epoch of the star chart names the axes.  Reports stand in
letters and lists with words around them: those are counted, and what looks like a report out of its columns is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from piazzi.formats.conventions import Conventions
from piazzi.formats.crd_headers import cospar
from piazzi.formats.fields import calendar_day, integer, number, second_of_day
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

_EPOCHS = {"1": "B1855", "2": "B1875", "3": "B1900", "4": "B1950", "5": "EME2000", "6": "J2050"}
_UNITS = {"s": 3600.0, "m": 60.0, "d": 1.0}  # of the last figures of an angle, to the degree
_WITHOUT = "reports without a position"
_TEXT = "lines of text between reports"
_END = "999"  # of a list
_IOD = re.compile(r"[ \d]{5} [ \d]{2} [ \d]{3}[A-Z ]{3} \d{4} [A-Z ] \d{8}")
_UK = re.compile(r"\d{5}\w{2}\d{10}")
_RDE = re.compile(r"\d{4} \d{4} \d\.\d{3} [ \d]{4}$")
_POSITION = re.compile(r"\d\d\s*[-+]\s*\d|\d{4}")
_DAMAGED = re.compile(r"\d{6,7}\s?[-+]\d{4}|(?<!\d)\d{14,}")  # a position, or a date with a time
_BLANK = (40, 43, 46, 61)  # between the parts of an IOD report


class _Angles(NamedTuple):
    """How angles of a code are written: which, figures after the whole hours or degrees of each, and unit of their accuracy."""

    kinds: tuple[str, str]
    first: str
    second: str
    unit: str


_EQUATOR, _HORIZON = ("right_ascension", "declination"), ("azimuth", "elevation")
_CODES = {
    "1": _Angles(_EQUATOR, "s", "s", "s"), "2": _Angles(_EQUATOR, "m", "m", "m"), "3": _Angles(_EQUATOR, "m", "d", "d"),
    "4": _Angles(_HORIZON, "s", "s", "s"), "5": _Angles(_HORIZON, "m", "m", "m"), "6": _Angles(_HORIZON, "d", "d", "d"),
    "7": _Angles(_EQUATOR, "s", "d", "d"),
}  # fmt: skip


def read_iod(data: bytes, name: str, told: Conventions) -> Observations:
    """Positions of IOD reports; ValueError with file, line and reason."""
    return _read(data, name, _IOD, _iod)


def read_uk(data: bytes, name: str, told: Conventions) -> Observations:
    """Positions of UK reports; ValueError with file, line and reason."""
    return _read(data, name, _UK, _uk)


def _read(data: bytes, name: str, begins: re.Pattern[str], take: Callable[[Rows, str, int], None]) -> Observations:
    rows, line = Rows(), 0
    try:
        for line, text in _lines(data):
            if begins.match(text):
                take(rows, text, line)
            else:
                _words(rows, text)
        return _table(rows, name)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Lines with anything in them, and their numbers."""
    for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
        if text.strip():
            yield line, text.rstrip()


def _words(rows: Rows, text: str) -> None:
    """Count a line between reports; raises ValueError where it looks like a report that is out of its columns."""
    if text.strip() == _END:
        return
    if not text.startswith("#") and _DAMAGED.search(text):
        raise ValueError(f"{text.strip()[:40]!r} looks like a report, and does not stand in its columns; put # before remarks")
    rows.skip(_TEXT)


def _table(rows: Rows, name: str) -> Observations:
    left_open = []
    if "right_ascension" in rows.kinds:
        left_open.append("what directions are reduced to: --angles astrometric, --angles geocentric or --angles apparent")
        if any(segment.frame is None for segment in rows.segments):
            left_open.append("the axes of right ascension and declination: --frame EME2000")
    return rows.table(name, (), tuple(left_open))


def _angle(text: str, whole: int, figures: str, what: str) -> float:
    """Hours or degrees of digits without points: ``whole`` of them, then minutes, seconds or decimals, as many as there are."""
    sign, digits = (-1.0 if text[:1] == "-" else 1.0), text.lstrip("+-").rstrip()
    if not (digits.isdecimal() and digits.isascii() and len(digits) >= whole):
        raise ValueError(f"{what} is {text[:20]!r}, which is no angle")
    head, rest = float(digits[:whole]), digits[whole:]
    if figures == "d":
        return sign * (head + float(f"0.{rest or '0'}"))
    if figures == "m":
        minutes, seconds = float(f"{rest[:2] or '0'}.{rest[2:] or '0'}"), 0.0
    else:
        minutes, seconds = float(rest[:2] or "0"), float(f"{rest[2:4] or '0'}.{rest[4:] or '0'}")
    if minutes >= 60.0 or seconds >= 60.0:
        raise ValueError(f"{what} is {text[:20]!r}, with 60 minutes or seconds and more")
    return sign * (head + minutes / 60.0 + seconds / 3600.0)


def _add(rows: Rows, row: Row, angles: _Angles, first: str, second: str, accuracy: float) -> None:
    """Two rows of a position; `accuracy` is in the unit of its angles, NaN for none."""
    hours = angles.kinds == _EQUATOR
    around = _angle(first, 2 if hours else 3, angles.first, angles.kinds[0]) * (15.0 if hours else 1.0)
    up = _angle(second, 2, angles.second, angles.kinds[1])
    if around >= 360.0 or abs(up) > 90.0:
        raise ValueError(f"{angles.kinds[0]} {around:g} deg, {angles.kinds[1]} {up:g} deg is on no sphere")
    sigma = math.radians(accuracy / _UNITS[angles.unit]) if accuracy > 0.0 else math.nan
    rows.add(row, angles.kinds[0], math.radians(around), sigma)
    rows.add(row, angles.kinds[1], math.radians(up), sigma)


def _mantissa(text: str, what: str) -> float:
    """M times ten to the power X - 8 of two digits MX; NaN for blanks."""
    text = text.strip()
    if not text:
        return math.nan
    if not (len(text) == 2 and text.isdecimal() and text.isascii()):
        raise ValueError(f"{what} is {text[:10]!r}; it has two digits")
    return int(text[0]) * 10.0 ** (int(text[1]) - 8)


def _of_day(text: str) -> float:
    """Seconds of the day of HHMMSSsss, with as many figures as there are."""
    digits = text.strip()
    if not (digits.isdecimal() and digits.isascii() and len(digits) >= 4):
        raise ValueError(f"time is {text[:20]!r}; it has hours and minutes, seconds and decimals")
    return second_of_day(int(digits[:2]), int(digits[2:4]), float(f"{digits[4:6] or '0'}.{digits[6:] or '0'}"))


def _segment(rows: Rows, kinds: tuple[str, str], epoch: str) -> int:
    frame = _EPOCHS.get(epoch) if kinds == _EQUATOR else None
    return rows.segment((kinds, frame), scale="UTC", frame=frame, tag="receive")


def _iod(rows: Rows, text: str, line: int) -> None:
    text = text.ljust(64)
    if not _POSITION.search(text[43:61]):
        rows.skip(_WITHOUT)
        return
    for at in _BLANK:
        if text[at] != " ":
            raise ValueError(f"column {at + 1} has {text[at]!r} where there is a blank between two parts of a report")
    angles = _CODES.get(text[44])
    if angles is None:
        raise ValueError(f"angle format {text[44]!r} in column 45 is not known; there are {', '.join(_CODES)}")
    day = calendar_day(*(integer(text[a:b], "date") for a, b in ((23, 27), (27, 29), (29, 31))))
    target = text[:5].strip().lstrip("0") or text[6:15].strip()
    row = Row(
        day, _of_day(text[31:40]), text[16:20].strip(), target, _segment(rows, angles.kinds, text[45]), line,
        time_sigma=_mantissa(text[41:43], "accuracy of the time"),
    )  # fmt: skip
    _add(rows, row, angles, text[47:54], text[54:61], _mantissa(text[62:64], "accuracy of the position"))


def _year(text: str) -> int:
    year = integer(text, "year")
    return year + (1900 if year >= 57 else 2000)


def _uk(rows: Rows, text: str, line: int) -> None:
    text = text.ljust(80)
    angles = _CODES.get(text[33])
    if not text[34:50].strip():
        rows.skip(_WITHOUT)
        return
    if angles is None or text[33] == "7":
        raise ValueError(f"coordinate system {text[33]!r} in column 34 is not read; 1 to 6 are")
    day = calendar_day(_year(text[11:13]), integer(text[13:15], "month"), integer(text[15:17], "day"))
    row = Row(
        day, _of_day(text[17:27]), text[7:11].strip(), cospar(text[:7].strip()), _segment(rows, angles.kinds, text[54]), line,
        time_sigma=_shifted(text[27:32], 1, "accuracy of the time"),
    )  # fmt: skip
    points = {"s": 3, "m": 2, "d": 1}
    accuracy = _shifted(text[50:54], points[angles.unit], "accuracy of the position")
    second = text[42:50] if angles.kinds == _EQUATOR else text[42:50].lstrip()  # elevations need no sign
    _add(rows, row, angles, text[34:42], second, accuracy)


def _shifted(text: str, whole: int, what: str) -> float:
    """A number whose point stands after so many columns; NaN for blanks and zero."""
    if not text.strip():
        return math.nan
    return number(f"{text[:whole].strip() or '0'}.{text[whole:].strip() or '0'}", what) or math.nan


def read_rde(data: bytes, name: str, told: Conventions) -> Observations:
    """Positions of RDE reports: a line of the site and month, one of each day, then a line each; 999 ends a report.

    Raises ValueError with file, line and reason.
    """
    rows, line = Rows(), 0
    report: list[str] = []
    day = 0
    try:
        for line, text in _lines(data):
            fields = text.split()
            if fields == [_END]:
                report, day = [], 0
            elif not report and not _RDE.match(text):
                _words(rows, text)
            elif not report:
                report = _report(fields)
            elif len(fields) == 1 and len(fields[0]) <= 2:
                month = report[1]
                day = calendar_day(_year(month[:2]), integer(month[2:], "month"), integer(fields[0], "day"))
            elif not day:
                raise ValueError("a position before the line of its day")
            else:
                _rde(rows, report, day, fields, line)
        return _table(rows, name)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _report(fields: Sequence[str]) -> list[str]:
    """Site, year and month, accuracy of times with two codes, accuracy of positions with the code of the epoch."""
    if len(fields) != 4 or len(fields[1]) != 4 or len(fields[2]) < 5 or len(fields[3]) < 2:
        raise ValueError("a report begins with site, year and month, and accuracies with codes, as in 2420 0405 0.211 1204")
    if fields[2][4] != "1":
        raise ValueError(f"positions of code {fields[2][4]!r} are not read; 1 (HHMMSS+DDMMSS) is")
    return list(fields)


def _rde(rows: Rows, report: Sequence[str], day: int, fields: Sequence[str], line: int) -> None:
    if len(fields) < 3 or len(fields[2]) < 9:
        raise ValueError("a position has object, time HHMMSS.ss and HHMMSS+DDMMSS")
    row = Row(
        day, _of_day(fields[1].replace(".", "", 1)), report[0], cospar(fields[0]), _segment(rows, _EQUATOR, report[3][-1]),
        line,
        time_sigma=number(report[2][:3], "accuracy of the time") or math.nan,
    )  # fmt: skip
    at = max(fields[2].find("+"), fields[2].find("-"))
    if at < 4:
        raise ValueError(f"the position is {fields[2][:20]!r}; it is written as HHMMSS+DDMMSS")
    accuracy = number(report[3][:-1], "accuracy of the position")
    _add(rows, row, _CODES["1"], fields[2][:at], fields[2][at:], accuracy or math.nan)
