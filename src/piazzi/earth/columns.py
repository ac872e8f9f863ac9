"""Many dates at once: a column of text to instants, all at the same time where they look alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.earth import scales
from piazzi.earth.dates import Reading, read_date
from piazzi.earth.epoch import Epoch, orientation
from piazzi.text import shown

_START = 19  # where decimals and the scale begin
_MOST_DECIMALS = 15  # which a double holds exactly as a whole number
_POWERS = np.array([float(10**k) for k in range(_MOST_DECIMALS + 1)])
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
    for value in distinct(tail[found]):
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


class Usual(NamedTuple):
    """Which dates have the usual form; day (MJD), hour, minute and second, decimals, their end, and whether they are exact."""

    sound: Array
    day: Array
    clock: tuple[Array, Array, Array]
    fraction: Array
    end: Array
    exact: Array


def padded(texts: Array) -> Array:
    """Letters of a column of bytes, (J, letters), with zeros behind them that a date without any end may have its tail in."""
    size = max(texts.dtype.itemsize, _START) + _TAIL + 1
    return texts.astype(f"S{size}").view(np.uint8).reshape(len(texts), size)


def usual(raw: Array, ordinal: bool = False) -> Usual:
    """What `padded` letters say as 2016-02-13T16:00:00 or, with a day of the year, 2016-044T16:00:00; decimals may follow."""
    at = 9 if ordinal else 11  # where the hour stands
    number = (raw - ord("0")).astype(np.int16)  # of what is no digit, some number beyond 9
    sound = (raw[:, at - 1] == ord("T")) | (raw[:, at - 1] == ord(" "))
    marks = {4: "-", at + 2: ":", at + 5: ":"} | ({} if ordinal else {7: "-"})
    for column in range(at + 8):
        if column in marks:
            sound &= raw[:, column] == ord(marks[column])
        elif column != at - 1:
            sound &= number[:, column] < 10
    date = ((0, 4), (5, 3)) if ordinal else ((0, 4), (5, 2), (8, 2))
    year, *days, hour, minute, second = (
        sum(number[:, a + i].astype(np.int64) * 10 ** (n - 1 - i) for i in range(n))
        for a, n in (*date, (at, 2), (at + 3, 2), (at + 6, 2))
    )
    month = np.ones_like(year) if ordinal else days[0]
    sound &= (month >= 1) & (month <= 12) & (year >= 1)
    day, within = _days(np.where(sound, year, 2000), np.where(sound, month, 1), days[-1], 12 if ordinal else 1)
    return Usual(sound & within, day, (hour, minute, second), *_decimals(raw, at + 8))


def _regular(texts: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Which dates have the usual form and a usual time of day; their day, seconds, fraction, and what stands behind."""
    raw = padded(texts)
    found = usual(raw)
    hour, minute, second = found.clock
    tail = np.take_along_axis(raw, found.end[:, None] + np.arange(_TAIL), axis=1)
    rest = np.ascontiguousarray(tail).view(np.uint64).reshape(len(texts))
    sound = found.sound & (hour < 24) & (minute < 60) & (second < 60) & found.exact
    sound &= found.end + _TAIL >= texts.dtype.itemsize
    return sound, found.day, (3600 * hour + 60 * minute + second).astype(float), found.fraction, rest


def _days(year: Array, month: Array, day: Array, months: int) -> tuple[Array, Array]:
    """Modified Julian Days of days from the first of a month on, and which are within so many months from there."""
    begin = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    first, after = (m.astype("datetime64[D]").astype(np.int64) for m in (begin, begin + months))
    return (first + day - 1).astype(float) + _ZERO_UNIX, (day >= 1) & (day <= after - first)


def _decimals(raw: Array, start: int) -> tuple[Array, Array, Array]:
    """Decimals of the seconds, where they end, and which of them are few enough to be exact; others are cut."""
    mark = (raw[:, start] == ord(".")) | (raw[:, start] == ord(","))
    inside, value, count = mark.copy(), np.zeros(len(raw), dtype=np.int64), np.zeros(len(raw), dtype=np.int64)
    for at in range(start + 1, raw.shape[1]):
        digit = raw[:, at] - ord("0")
        inside &= digit < 10
        if not inside.any():
            break
        if at <= start + _MOST_DECIMALS:
            value = np.where(inside, 10 * value + digit, value)
        count += inside
    exact = np.where(mark, (count > 0) & (count <= _MOST_DECIMALS), raw[:, start] - ord("0") >= 10)
    return value / _POWERS[np.minimum(count, _MOST_DECIMALS)], start + count + mark, exact
