"""Fields of text files as numbers and days; ValueError with the value for what is none."""

from __future__ import annotations

import contextlib
import datetime as dt
import math

_MISSING = frozenset(("na", "-na", "nan", "n/a", ""))
_UNIX = 40587 - 719163  # Modified Julian Day less the ordinal of the calendar


def number(text: str, what: str) -> float:
    """A finite number."""
    value = math.nan
    if "_" not in text:
        with contextlib.suppress(ValueError):
            value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{what} is {text[:40]!r}, which is no number")
    return value


def number_or_nan(text: str, what: str) -> float:
    """A number, NaN where the file says that there is none."""
    return math.nan if text.strip().lower() in _MISSING else number(text, what)


def integer(text: str, what: str) -> int:
    """A whole number."""
    try:
        if "_" in text or len(text) > 18:
            raise ValueError
        return int(text)
    except ValueError:
        raise ValueError(f"{what} is {text[:40]!r}, which is no whole number") from None


def second_of_day(hour: int, minute: int, second: float) -> float:
    """Seconds of a day that may end with a leap second."""
    if not (0 <= hour < 24 and 0 <= minute < 60 and 0.0 <= second < 61.0):
        raise ValueError(f"{hour}:{minute}:{second:g} is no time of a day")
    return 3600.0 * hour + 60.0 * minute + second


def calendar_day(year: int, month: int, day: int) -> int:
    """Modified Julian Day of a date."""
    try:
        return dt.date(year, month, day).toordinal() + _UNIX
    except (ValueError, OverflowError):
        raise ValueError(f"{year}-{month}-{day}: the calendar has no such day") from None


def day_of_year(year: int, day: int) -> int:
    """Modified Julian Day of the day of a year, 1 that of 1 January."""
    first = calendar_day(year, 1, 1)
    if not 1 <= day <= calendar_day(year, 12, 31) - first + 1:
        raise ValueError(f"the year {year} has no day {day}")
    return first + day - 1
