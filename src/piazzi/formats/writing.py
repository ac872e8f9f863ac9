"""Numbers and dates as text that is read back as the same."""

from __future__ import annotations

import datetime as dt
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, scales
from piazzi.earth.epoch import orientation


def in_unit(values: Any, factor: float, offset: float = 0.0) -> Array:
    """Numbers x with ``x * factor + offset`` equal to `values` to the last bit, wherever there is such an x near by.

    Values that were read from a file have one; others are off by half a unit in the last place.
    """
    values = np.asarray(values, dtype=float)
    if factor == 1.0:
        return np.asarray(values - offset)
    out = nearest = (values - offset) / factor
    wrong = out * factor + offset != values
    for away in (np.inf, -np.inf):
        candidate = nearest
        for _ in range(3):
            candidate = np.nextafter(candidate, away)
            better = wrong & (candidate * factor + offset == values)
            out = np.where(better, candidate, out)
            wrong = wrong & ~better
    return np.asarray(out)


def number(value: float) -> str:
    """A number with 17 digits, which are as many as a double has."""
    return f"{value:.16e}"


def dates(scale: str, epoch: Epoch, t: Any, digits: int = 9) -> list[str]:
    """ISO dates in a scale, without its name, of seconds past an epoch, with `digits` decimals."""
    t = np.atleast_1d(np.asarray(t, dtype=float))
    if not len(t):
        return []
    floor = np.floor(t)
    whole, fraction = scales.normalized(epoch.whole + floor, epoch.fraction + (t - floor))
    day, seconds, part = scales.reading(scale, whole, fraction, orientation(scale))
    ticks = np.round(part * 10.0**digits).astype(np.int64)
    carried = ticks == 10**digits
    ticks, seconds = np.where(carried, 0, ticks), seconds + carried
    length = scales.length_of_day(day) if scale == "UTC" else np.full(len(day), scales.DAY)
    over = seconds >= length
    day, seconds = day + over, np.where(over, 0.0, seconds)
    of_day = seconds.astype(np.int64)
    leap = of_day >= 86400
    hour, minute = np.where(leap, 23, of_day // 3600), np.where(leap, 59, of_day // 60 % 60)
    second = np.where(leap, of_day - 86340, of_day % 60)
    calendar = np.datetime_as_string((day.astype(np.int64) - 40587).astype("M8[D]")).tolist()
    clocks = zip(calendar, hour.tolist(), minute.tolist(), second.tolist(), ticks.tolist(), strict=True)
    return [f"{d}T{h:02d}:{m:02d}:{s:02d}.{tick:0{digits}d}" for d, h, m, s, tick in clocks]


def date(scale: str, epoch: Epoch) -> str:
    """One ISO date in a scale, without its name."""
    return epoch.to(scale).removesuffix(f" {scale}")


def now() -> str:
    """The present in UTC, for the dates when messages were made."""
    return dt.datetime.now(dt.UTC).strftime("%Y-%m-%dT%H:%M:%S")


def plain(text: str) -> str:
    """A name as one word of a message may have it: on one line, without marks at its ends."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
