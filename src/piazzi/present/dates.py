"""Dates on axes of time: what a clock shows so many seconds past an instant, and which of its readings are marked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.earth import scales
from piazzi.earth.epoch import Epoch, orientation
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

DAY = 86400.0
STEPS = (
    *(1, 2, 5, 10, 15, 30),
    *(60 * m for m in (1, 2, 5, 10, 15, 30)),
    *(3600 * h for h in (1, 2, 3, 6, 12)),
    *(86400 * d for d in (1, 2, 5, 10)),
)
_MONTHS = (1, 2, 3, 6, 12, 24, 60, 120, 240, 600, 1200)
_MONTH = 30.44 * DAY
_MJD_OF_1970 = 40587.0


@dataclass(frozen=True)
class Tick:
    """A mark on an axis of time: seconds past the epoch, its time or date, and what stands below: the day or the year."""

    t: float
    text: str
    below: str = ""


@dataclass(frozen=True)
class Calendar:
    """A clock of a time scale beside times in seconds past an epoch: by default UTC where there is UTC, before 1960 TT."""

    epoch: Epoch
    scale: str = ""

    def __post_init__(self) -> None:
        if not self.scale:
            object.__setattr__(self, "scale", str(self.epoch).rpartition(" ")[2])

    @property
    def label(self) -> str:
        """Of an axis."""
        return f"time [{self.scale}]"

    def readings(self, t: Any) -> Array:
        """Seconds that the clock has counted since 1970-01-01 at these times, days of 86400 s."""
        t = np.asarray(t, dtype=float)
        instants = scales.normalized(self.epoch.whole + np.floor(t), self.epoch.fraction + (t - np.floor(t)))
        day, seconds, fraction = scales.reading(self.scale, *instants, orientation(self.scale))
        return np.asarray((day - _MJD_OF_1970) * DAY + np.minimum(seconds, DAY - 1.0) + fraction)

    def times(self, readings: Any) -> Array:
        """When the clock shows these, in seconds past the epoch."""
        readings = np.asarray(readings, dtype=float)
        day = np.floor(readings / DAY)
        seconds = np.floor(readings - day * DAY)
        parts = day + _MJD_OF_1970, seconds, readings - day * DAY - seconds
        whole, fraction = scales.to_tt(self.scale, *parts, orientation(self.scale))
        return np.asarray((whole - self.epoch.whole) + (fraction - self.epoch.fraction))

    def ticks(self, low: float, high: float, most: int) -> list[Tick]:
        """At most so many marks at round readings between two times."""
        first, last = self.readings([low, high]).tolist()
        marks, text, below = _marked(first, last, max(most, 1))
        if not len(marks):
            return []
        inside = zip(self.times(marks).tolist(), marks, strict=True)
        found = [Tick(t, text(m), below(m)) for t, m in inside if low - 1e-4 <= t <= high + 1e-4]
        days = [tick.below for tick in found]
        new = [day if not i or day != days[i - 1] else "" for i, day in enumerate(days)]
        if len(new) > 1 and new[1]:
            new[0] = ""  # it would touch the next, which says as much
        return [replace(tick, below=day) for tick, day in zip(found, new, strict=True)]

    def to_dict(self, times: Array) -> dict[str, Any]:
        """What a page needs to do the same: the reading at the epoch in ms, the scale, and when seconds are inserted."""
        return {"scale": self.scale, "zero": 1e3 * float(self.readings(0.0)), "leaps": self._leaps(times)}

    def _leaps(self, times: Array) -> list[float]:
        if self.scale != "UTC" or not len(times):
            return []
        ends = np.floor(self.readings([times[0], times[-1]]) / DAY)
        midnights = np.arange(ends[0], ends[1] + 2.0)
        ahead = scales.tai_utc(midnights + _MJD_OF_1970, 0.0 * midnights)
        return [t - 1.0 for t in self.times(DAY * midnights[1:][np.diff(ahead) > 0.5]).tolist()]


def _marked(first: float, last: float, most: int) -> tuple[Sequence[float], Any, Any]:
    """Round readings, how each is written, and what stands below it."""
    span = last - first
    step = next((float(s) for s in STEPS if span / s <= most), None)
    if step is None and span < 70.0 * DAY:
        step = 20.0 * DAY
    if step is None:
        return _months(first, last, most)
    if span / most < 0.5:
        least = max(span / most, 1e-3)
        power = 10.0 ** np.floor(np.log10(least))
        step = power * next(m for m in (1.0, 2.0, 5.0, 10.0) if m * power >= 0.999 * least)
    begin = DAY * np.floor(first / DAY)
    marks = begin + step * np.arange(np.ceil((first - begin) / step - 1e-6), np.floor((last - begin) / step + 1e-6) + 1.0)
    if step >= DAY:
        marks = step * np.arange(np.ceil(first / step), np.floor(last / step) + 1.0)
        return marks.tolist(), _month_and_day, _year
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return marks.tolist(), lambda m: _clock(m, step, decimals), lambda m: str(np.datetime64(int((m + 1e-6) // DAY), "D"))


def _months(first: float, last: float, most: int) -> tuple[Sequence[float], Any, Any]:
    span = last - first
    step = next((m for m in _MONTHS if span / (m * _MONTH) <= most), _MONTHS[-1])
    months = [int(np.datetime64(int(end // DAY), "D").astype("datetime64[M]").astype(int)) for end in (first, last)]
    counted = [m for m in range(months[0], months[1] + 2) if (1970 * 12 + m) % step == 0]
    marks = [DAY * float(np.datetime64(m, "M").astype("datetime64[D]").astype(int)) for m in counted]
    if step >= 12:
        return marks, _year, lambda m: ""
    return marks, lambda m: _month_and_day(m)[:3], _year


def _clock(reading: float, step: float, decimals: int) -> str:
    """Hours and minutes, with seconds where marks are nearer together."""
    of_day = round((reading + 1e-6) % DAY, max(decimals, 3))
    hours, minutes, seconds = int(of_day // 3600), int(of_day % 3600 // 60), of_day % 60
    if step >= 60:
        return f"{hours:02d}:{minutes:02d}"
    return f"{hours:02d}:{minutes:02d}:{seconds:0{3 + decimals if decimals else 2}.{decimals}f}"


def _month_and_day(reading: float) -> str:
    """Three letters and the day, whatever language the machine speaks."""
    date = str(np.datetime64(int(reading // DAY), "D"))
    name = "JanFebMarAprMayJunJulAugSepOctNovDec"[3 * int(date[-5:-3]) - 3 :][:3]
    return f"{name} {int(date[-2:])}"


def _year(reading: float) -> str:
    return str(np.datetime64(int(reading // DAY), "D"))[:-6]
