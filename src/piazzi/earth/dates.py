"""Dates as text, and back.  Every date has a scale; what has none is refused."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from piazzi.earth import scales
from piazzi.text import shown

_CALENDAR = r"(?P<year>\d{4})(?:(?P<mark>[-/])(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})|-(?P<doy>\d{3}))"
_CLOCK = r"(?:[T ](?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,](?P<fraction>\d+))?)?)?"
_SCALE = r"(?:\s*(?P<zone>Z|[+-]\d{2}:\d{2})|\s+\[?(?P<scale>[A-Za-z]\w*)\]?|\[(?P<bracket>[A-Za-z]\w*)\])?"
_DATE = re.compile(_CALENDAR + _CLOCK + _SCALE, re.ASCII)
_JULIAN = re.compile(r"(?P<kind>MJD|JD)\s*(?P<whole>\d+)(?P<fraction>\.\d*)?(?:\s+(?P<scale>[A-Za-z]\w*))?", re.ASCII)
HINT = f"add one of {', '.join(scales.SCALES)}, as in '2016-02-13T16:00:00 UTC' (Z is UTC)"
_ZERO_UNIX = 40587.0  # MJD of 1970-01-01


class Reading(NamedTuple):
    """What a clock of `scale` shows: Modified Julian Day, whole seconds of that day, and a fraction of a second."""

    scale: str
    day: float
    seconds: float
    fraction: float


def scale_named(name: str, text: str) -> str:
    """The scale of that name in any case; raises ValueError with the scales that there are."""
    known = name.upper()
    if known not in scales.SCALES:
        raise ValueError(f"date {shown(text)}: {name!r} is no time scale; there are {', '.join(scales.SCALES)}")
    return known


def read_date(text: str, scale: str | None = None) -> Reading:
    """The reading that a text gives; `scale` is that of dates that name none.

    Takes ``2016-02-13T16:00:00.5 UTC``, a blank instead of the T, a day of the year (``2016-044T16:00``), a date alone (0h),
    ``Z`` or ``+02:00`` for UTC, and ``JD 2457432.5 TT`` or ``MJD ...``.
    Raises ValueError with the text and what is wrong with it.
    """
    stripped = text.strip()
    julian = _JULIAN.fullmatch(stripped)
    match = julian or _DATE.fullmatch(stripped)
    if match is None:
        raise ValueError(f"date {shown(text)} cannot be read: write it as 2016-02-13T16:00:00 and {HINT.removeprefix('add ')}")
    found = match.groupdict()
    named = found.get("scale") or found.get("bracket") or ("UTC" if found.get("zone") else None)
    if named is None and scale is None:
        raise ValueError(f"date {shown(text)} has no time scale: {HINT}")
    kind = scale_named(named or str(scale), text)
    reading = _julian(found, kind) if julian else _calendar(found, kind, text)
    if kind == "UTC" and reading.day < scales.UTC_BEGINS:
        raise ValueError(f"date {shown(text)}: there is no UTC before 1960; give it in UT1 or TT")
    return reading


def _julian(found: dict[str, str | None], scale: str) -> Reading:
    whole, part = float(found["whole"] or 0), float("0" + (found["fraction"] or ""))
    if found["kind"] == "JD":
        whole, part = whole - 2400001.0, part + 0.5
        whole, part = whole + np.floor(part), part - np.floor(part)
    seconds = part * scales.DAY
    nearest = round(seconds * 1e9) / 1e9  # a day's fraction in doubles holds 1e-11 s
    return Reading(scale, float(whole), float(np.floor(nearest)), nearest - float(np.floor(nearest)))


def _calendar(found: dict[str, str | None], scale: str, text: str) -> Reading:
    year, hour, minute, second = (int(found[k] or 0) for k in ("year", "hour", "minute", "second"))
    day = _day(year, found, text)
    fraction = float("0." + (found["fraction"] or "0"))
    seconds = 3600 * hour + 60 * minute + second
    leap = scale == "UTC" and second == 60 and (hour, minute) == (23, 59)
    if hour > 24 or minute > 59 or (second > 59 and not leap) or (hour == 24 and (minute or second or fraction)):
        raise ValueError(f"date {shown(text)}: {found['hour']}:{found['minute']}:{found['second'] or '00'} is no time of a day")
    zone = found.get("zone")
    if zone and zone != "Z":
        seconds -= (60 * int(zone[1:3]) + int(zone[4:6])) * 60 * (-1 if zone[0] == "-" else 1)
        day, seconds = day + seconds // 86400, seconds % 86400
    if leap and seconds >= scales.length_of_day(np.array(float(day))):
        raise ValueError(f"date {shown(text)}: that day did not end with a leap second")
    return Reading(scale, float(day), float(seconds), fraction)


def _day(year: int, found: dict[str, str | None], text: str) -> int:
    import datetime

    try:
        if found["doy"]:
            first = datetime.date(year, 1, 1)
            date = first + datetime.timedelta(days=int(found["doy"]) - 1)
            if date.year != year:
                raise ValueError("day of the year out of range")
        else:
            date = datetime.date(year, int(found["month"] or 1), int(found["day"] or 1))
    except (ValueError, OverflowError):
        raise ValueError(f"date {shown(text)}: the calendar has no such day") from None
    return date.toordinal() - datetime.date(1970, 1, 1).toordinal() + int(_ZERO_UNIX)


def write_date(scale: str, day: float, seconds: float, fraction: float, digits: int = 9) -> str:
    """ISO 8601 with at most `digits` decimals, the closing zeros left out, and the scale: ``2016-02-13T16:00:00 UTC``."""
    from piazzi.earth.eop import mjd_text

    ticks = round(fraction * 10**digits)
    if ticks == 10**digits:
        seconds, ticks = seconds + 1.0, 0
        length = float(scales.length_of_day(np.array(day))) if scale == "UTC" else scales.DAY
        if seconds >= length:
            day, seconds = day + 1.0, 0.0
    of_day = int(seconds)
    hour, minute, second = min(of_day // 3600, 23), of_day // 60 % 60, of_day % 60
    if of_day >= 86400:
        minute, second = 59, of_day - 86340
    decimals = f".{ticks:0{digits}d}".rstrip("0").rstrip(".") if digits else ""
    return f"{mjd_text(day)}T{hour:02d}:{minute:02d}:{second:02d}{decimals} {scale}"
