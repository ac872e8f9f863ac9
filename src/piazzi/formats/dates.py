"""Many dates at once: readings of clocks from columns of text, and instants from readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, scales


class Readings(NamedTuple):
    """What clocks show: Modified Julian Days, whole seconds of the day, fractions of a second."""

    day: Array
    seconds: Array
    fraction: Array


class Instants(NamedTuple):
    """Time zero, and seconds of TT past it."""

    epoch: Epoch
    t: Array


def instants(scale: str, readings: Readings, epoch: Epoch | None = None) -> Instants:
    """Readings of one scale as seconds past an epoch: by default the first without its fraction of a second.

    Raises
    ------
    ValueError
        For UTC before 1960, with the row.
    """
    if scale == "UTC" and len(readings.day) and readings.day.min() < scales.UTC_BEGINS:
        raise ValueError(f"row {int(np.argmin(readings.day))}: there is no UTC before 1960; give it in UT1 or TT")
    orientation = None
    if scale == "UT1":
        from piazzi.earth.eop import tables

        orientation = tables()
    whole, fraction = scales.to_tt(scale, *readings, orientation)
    if epoch is None:
        first = scales.to_tt(scale, readings.day[:1], readings.seconds[:1], 0.0 * readings.day[:1], orientation)
        epoch = Epoch.at(float(first[0][0]), float(first[1][0])) if len(whole) else Epoch.at(0.0)
    return Instants(epoch, (whole - epoch.whole) + (fraction - epoch.fraction))


def _two(digits: Array, column: int) -> Array:
    return np.asarray(digits[:, column] * 10 + digits[:, column + 1])


def read_dates(texts: Array) -> tuple[Readings, Array]:
    """Readings of a column of ISO dates without scale, and which of them are none.

    Parameters
    ----------
    texts : (J,) of bytes (dtype ``S``)
        ``2005-06-08T17:41:00.25`` or ``2005-159T17:41:00``, a blank instead of the T, a ``Z`` or nothing at the end.

    Returns
    -------
    Readings of (J,), and a mask (J,) of those that cannot be read, whose readings mean nothing.
    """
    rows, width = len(texts), texts.dtype.itemsize
    letters = np.zeros((rows, max(width, 32)), dtype=np.uint8)
    letters[:, :width] = np.ascontiguousarray(texts).view(np.uint8).reshape(rows, width)
    by_day_of_year = letters[:, 8] == ord("T")
    day, seconds, fraction = np.zeros(rows), np.zeros(rows), np.zeros(rows)
    bad = np.ones(rows, dtype=np.bool_)
    for ordinal in (False, True):
        chosen = np.flatnonzero(by_day_of_year == ordinal)
        if len(chosen) == rows:
            day, seconds, fraction, bad = _parsed(letters, ordinal)
        elif len(chosen):
            day[chosen], seconds[chosen], fraction[chosen], bad[chosen] = _parsed(letters[chosen], ordinal)
    return Readings(day, seconds, fraction), bad


def _parsed(letters: Array, ordinal: bool) -> tuple[Array, Array, Array, Array]:
    """Day, seconds, fraction and which are bad, of dates with a day of the year or with month and day."""
    clock = 9 if ordinal else 11  # where the hour stands
    fixed = {4: "-", clock - 1: "T ", clock + 2: ":", clock + 5: ":"} | ({} if ordinal else {7: "-"})
    digits = letters.astype(np.int16) - ord("0")
    bad = np.zeros(len(letters), dtype=np.bool_)
    for column in range(clock + 8):
        if column in fixed:
            bad |= np.all([letters[:, column] != ord(c) for c in fixed[column]], axis=0)
        else:
            bad |= (digits[:, column] < 0) | (digits[:, column] > 9)
    hour, minute, second = (_two(digits, clock + shift) for shift in (0, 3, 6))
    day, wrong = _days(digits, ordinal)
    fraction, odd = _fractions(letters, digits, clock + 8)
    leap = (second == 60) & (minute == 59) & (hour == 23)
    if leap.any():
        with np.errstate(all="ignore"):
            leap[leap] = scales.length_of_day(np.clip(day[leap], 41317.0, 1e5)) > scales.DAY
    bad |= wrong | odd | (hour > 23) | (minute > 59) | ((second > 59) & ~leap)
    seconds = hour.astype(np.float64) * 3600 + minute * 60.0 + second
    return day, seconds, fraction, bad


def _days(digits: Array, ordinal: bool) -> tuple[Array, Array]:
    """Modified Julian Days, and which the calendar does not have."""
    year = np.clip(_two(digits, 0).astype(np.int64) * 100 + _two(digits, 2), 1, 9999)
    january = (year - 1970).astype("M8[Y]")
    if ordinal:
        count = digits[:, 5].astype(np.int64) * 100 + _two(digits, 6)
        first, last = january.astype("M8[D]"), (january + 1).astype("M8[D]")
    else:
        month, count = _two(digits, 5).astype(np.int64), _two(digits, 8).astype(np.int64)
        months = january.astype("M8[M]") + (np.clip(month, 1, 12) - 1)
        first, last = months.astype("M8[D]"), (months + 1).astype("M8[D]")
    wrong = (count < 1) | (count > (last - first).astype(np.int64))
    if not ordinal:
        wrong |= (month < 1) | (month > 12)
    day = first.astype(np.int64) + count - 1 + 40587
    return day.astype(np.float64), wrong


def _fractions(letters: Array, digits: Array, start: int) -> tuple[Array, Array]:
    """Fractions of a second behind a point at `start`, and which rows have something else there."""
    length = np.count_nonzero(letters, axis=1)
    length = length - (letters[np.arange(len(letters)), length - 1] == ord("Z"))
    point = (letters[:, start] == ord(".")) | (letters[:, start] == ord(","))
    bad = (length != start) & ~(point & (length > start + 1))
    numerator, scale = np.zeros(len(letters)), np.ones(len(letters))
    for column in range(start + 1, int(length.max(initial=0))):
        inside, digit = column < length, digits[:, column]
        bad |= inside & ((digit < 0) | (digit > 9))
        if column < start + 16:  # a double holds no more
            numerator, scale = np.where(inside, numerator * 10 + digit, numerator), np.where(inside, scale * 10, scale)
    return numerator / scale, bad
