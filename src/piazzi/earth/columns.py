"""Many dates at once: a column of text to instants, all at the same time where they look alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.dates import Reading, read_date
from piazzi.earth.epoch import Epoch, orientation
from piazzi.text import shown

_DIGITS = (0, 1, 2, 3, 5, 6, 8, 9, 11, 12, 14, 15, 17, 18)  # of 2016-02-13T16:00:00
_MARKS = ((4, b"-"), (7, b"-"), (13, b":"), (16, b":"))
_START = 19  # where decimals and the scale begin
_MOST_DECIMALS = 15  # which a double holds exactly as a whole number
_TAIL = 8  # bytes that a scale takes with what is around it
_MOST_WEEKS = 10_000
_WEEK = 604800.0  # s
_ZERO_UNIX = 40587.0  # MJD of 1970-01-01


class Instants(NamedTuple):
    """Instants as whole seconds of TT past J2000.0 and a fraction, and the scale that all were given in."""

    scale: str
    whole: Array
    fraction: Array


def read_dates(texts: Array, scale: str | None = None, place: Callable[[int], str] = "row {}: ".format) -> Instants:
    """What `Epoch` makes of every text of a column, in all bits.

    Parameters
    ----------
    texts : (J,) of bytes, ASCII
    scale : that of dates that name none
    place : what a message about entry i begins with

    Raises
    ------
    ValueError
        With the place and the text, for what is no date, has no scale, or is in another scale than those before.
    """
    J = len(texts)
    found, day, seconds, fraction, tail = _regular(texts)
    kinds = np.zeros(J, dtype=np.int64)
    known: list[str] = []
    for value in np.unique(tail[found]):
        rows = np.flatnonzero(found & (tail == value))
        text = _text(texts[rows[0]])
        if text.rstrip()[-6:-5] in ("+", "-") and text.rstrip()[-3:-2] == ":":
            found[rows] = False  # behind or ahead of UTC, which is for the careful way
            continue
        kinds[rows] = _code(known, _one(text, scale, place(int(rows[0]))).scale)
    utc = kinds == known.index("UTC") if "UTC" in known else np.zeros(J, dtype=bool)
    found &= ~(utc & (day < scales.UTC_BEGINS))
    for i in np.flatnonzero(~found).tolist():
        reading = _one(_text(texts[i]), scale, place(i))
        kinds[i], day[i], seconds[i], fraction[i] = _code(known, reading.scale), *reading[1:]
    other = np.flatnonzero(kinds != kinds[0])
    if other.size:
        i = int(other[0])
        here, before = known[kinds[i]], known[kinds[0]]
        date = shown(_text(texts[i]))
        raise ValueError(f"{place(i)}date {date} is in {here}, those before in {before}; one file has one scale")
    kind = known[int(kinds[0])]
    return Instants(kind, *scales.to_tt(kind, day, seconds, fraction, orientation(kind)))


def read_weeks(week: Array, second: Array, place: Callable[[int], str] = "row {}: ".format) -> Instants:
    """Instants of weeks of GPS since 1980 and seconds of them; raises ValueError, with the place, for what is neither."""
    bad = ~((week >= 0) & (week < _MOST_WEEKS) & (week == np.floor(week)))
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"{place(i)}the week is {week[i]:g}; it must be a whole number below {_MOST_WEEKS:,}")
    bad = ~((second >= 0) & (second < _WEEK))
    if bad.any():
        i = int(np.argmax(bad))
        raise ValueError(f"{place(i)}the second of the week is {second[i]:g}; it must be from 0 to 604800")
    first, whole = Epoch("1980-01-06T00:00:00 GPS"), np.floor(second)
    return Instants("GPS", first.whole + week * _WEEK + whole, first.fraction + (second - whole))


def _one(text: str, scale: str | None, place: str) -> Reading:
    try:
        reading = read_date(text, scale)
        if scale is not None and reading.scale != scale.upper():
            raise ValueError(f"date {shown(text)} is in {reading.scale}, and {scale} was said beside it")
    except ValueError as error:
        raise ValueError(f"{place}{error}") from None
    return reading


def _text(cell: bytes) -> str:
    return cell.decode("ascii")


def _code(known: list[str], kind: str) -> int:
    if kind not in known:
        known.append(kind)
    return known.index(kind)


def _regular(texts: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Which dates have the usual form and a usual time of day; their day, seconds, fraction, and what stands behind."""
    J, width = len(texts), texts.dtype.itemsize
    size = max(width, _START) + _TAIL + 1
    raw = texts.astype(f"S{size}").view(np.uint8).reshape(J, size)
    number = (raw - ord("0")).astype(np.int16)  # of what is no digit, some number beyond 9
    sound = np.ones(J, dtype=bool)
    for at in _DIGITS:
        sound &= raw[:, at] - ord("0") < 10
    for at, mark in _MARKS:
        sound &= raw[:, at] == mark[0]
    sound &= (raw[:, 10] == ord("T")) | (raw[:, 10] == ord(" "))
    year, month, day_of_month, hour, minute, second = (
        sum(number[:, a + i].astype(np.int64) * 10 ** (n - 1 - i) for i in range(n))
        for a, n in ((0, 4), (5, 2), (8, 2), (11, 2), (14, 2), (17, 2))
    )
    sound &= (hour < 24) & (minute < 60) & (second < 60) & (month >= 1) & (month <= 12) & (year >= 1)
    day, within = _days(np.where(sound, year, 2000), np.where(sound, month, 1), day_of_month)
    fraction, end, short = _decimals(raw, width)
    tail = np.take_along_axis(raw, end[:, None] + np.arange(_TAIL), axis=1)
    rest = np.ascontiguousarray(tail).view(np.uint64).reshape(J)
    sound &= within & short & (end + _TAIL >= width)
    return sound, day, (3600 * hour + 60 * minute + second).astype(float), fraction, rest


def _days(year: Array, month: Array, day: Array) -> tuple[Array, Array]:
    """Modified Julian Days of calendar dates, and which of them there are."""
    months = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    first, after = (m.astype("datetime64[D]").astype(np.int64) for m in (months, months + 1))
    return (first + day - 1).astype(float) + _ZERO_UNIX, (day >= 1) & (day <= after - first)


def _decimals(raw: Array, width: int) -> tuple[Array, Array, Array]:
    """Decimals of the seconds, where they end, and which of them are few enough to be exact."""
    mark = (raw[:, _START] == ord(".")) | (raw[:, _START] == ord(","))
    inside, value, count = mark.copy(), np.zeros(len(raw), dtype=np.int64), np.zeros(len(raw), dtype=np.int64)
    for at in range(_START + 1, min(width, _START + 1 + _MOST_DECIMALS)):
        digit = raw[:, at] - ord("0")
        inside &= digit < 10
        if not inside.any():
            break
        value = np.where(inside, 10 * value + digit, value)
        count += inside
    end = _START + count + mark
    more = np.take_along_axis(raw, end[:, None], axis=1)[:, 0] - ord("0") < 10
    return value / 10.0**count, end, ~more & (~mark | (count > 0))
