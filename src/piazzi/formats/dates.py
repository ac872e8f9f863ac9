"""Many dates at once: readings of clocks from columns of text, and instants from readings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, scales
from piazzi.earth.columns import padded, usual
from piazzi.earth.epoch import orientation


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
    eop = orientation(scale)
    whole, fraction = scales.to_tt(scale, *readings, eop)
    if epoch is None:
        first = scales.to_tt(scale, readings.day[:1], readings.seconds[:1], 0.0 * readings.day[:1], eop)
        epoch = Epoch.at(float(first[0][0]), float(first[1][0])) if len(whole) else Epoch.at(0.0)
    return Instants(epoch, (whole - epoch.whole) + (fraction - epoch.fraction))


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
    letters = padded(texts)
    by_day_of_year = letters[:, 8] == ord("T")
    out, bad = Readings(*np.zeros((3, len(texts)))), np.ones(len(texts), dtype=np.bool_)
    for ordinal in (False, True):
        own = np.flatnonzero(by_day_of_year == ordinal)
        if len(own):
            out.day[own], out.seconds[own], out.fraction[own], bad[own] = _parsed(letters[own], ordinal)
    return out, bad


def _parsed(letters: Array, ordinal: bool) -> tuple[Array, Array, Array, Array]:
    """Day, seconds, fraction and which are bad, of dates with a day of the year or with month and day."""
    found = usual(letters, ordinal)
    hour, minute, second = found.clock
    leap = found.sound & (second == 60) & (minute == 59) & (hour == 23)
    if leap.any():
        with np.errstate(all="ignore"):
            leap[leap] = scales.length_of_day(np.clip(found.day[leap], 41317.0, 1e5)) > scales.DAY
    start = 17 if ordinal else 19  # where decimals begin
    length = np.count_nonzero(letters, axis=1)
    end = length - (letters[np.arange(len(letters)), length - 1] == ord("Z"))
    bad = ~found.sound | (found.end != end) | (found.end == start + 1)
    bad |= (hour > 23) | (minute > 59) | ((second > 59) & ~leap)
    return found.day, hour * 3600.0 + minute * 60.0 + second, found.fraction, bad
