"""`Epoch`: an instant, exact to a nanosecond over centuries, that knows every time scale."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable
from dataclasses import dataclass
from functools import total_ordering
from typing import Any

import numpy as np

from piazzi.drawn import Shown
from piazzi.earth import scales
from piazzi.earth.dates import HINT, Reading, read_date, scale_named, write_date
from piazzi.earth.eop import tables
from piazzi.earth.scales import Orientation


@total_ordering
@dataclass(frozen=True, init=False, repr=False)
class Epoch(Shown):
    """An instant of time, kept as whole seconds and a fraction of TT past J2000.0.

    Parameters
    ----------
    when : text with its scale (``"2016-02-13T16:00:00 UTC"``, ``"... Z"``, ``"JD 2457432.5 TT"``), a `datetime`, a
        `numpy.datetime64`, an `astropy.time.Time`, or an Epoch
    scale : UTC, TAI, TT, TDB, TCG, GPS or UT1, for what does not name its own: a datetime without a zone, a datetime64

    Raises
    ------
    ValueError
        Where no scale is said, two are said that differ, the calendar has no such date, or UTC is asked for before 1960.
    TypeError
        Where `when` is none of these.

    Notes
    -----
    ``epoch - other`` is in seconds of TT, so leap seconds count; ``epoch + seconds`` moves along TT.  UT1 is by the tables of
    the IERS since 1962 and by a model of Delta T before (`piazzi.earth.delta_t`).  TDB is that of the geocentre, by the series
    of Fairhead and Bretagnon (1990).
    """

    whole: float
    fraction: float

    def __init__(self, when: Any, scale: str | None = None) -> None:
        if scale is not None:
            scale = scale_named(scale, str(when))
        if isinstance(when, Epoch):
            whole, fraction = when.whole, when.fraction
        else:
            reading = _reading(when, scale)
            if scale is not None and reading.scale != scale:
                raise ValueError(f"date {when!r} is in {reading.scale}, and {scale} was said beside it")
            day, seconds, part = (np.array(value) for value in reading[1:])
            one, two = scales.to_tt(reading.scale, day, seconds, part, orientation(reading.scale))
            whole, fraction = float(one), float(two)
        object.__setattr__(self, "whole", whole)
        object.__setattr__(self, "fraction", fraction)

    @classmethod
    def at(cls, whole: float, fraction: float = 0.0) -> Epoch:
        """The instant so many seconds of TT past J2000.0 (2000-01-01T12:00:00 TT), as a sum of two numbers."""
        if not (np.isfinite(whole) and np.isfinite(fraction)):
            raise ValueError(f"an instant is {whole!r} + {fraction!r} s past J2000.0; it must be finite")
        floor = float(np.floor(whole))
        one, two = scales.normalized(np.array(floor), np.array((whole - floor) + fraction))
        epoch = cls.__new__(cls)
        object.__setattr__(epoch, "whole", float(one))
        object.__setattr__(epoch, "fraction", float(two))
        return epoch

    @classmethod
    def from_jd(cls, one: float, two: float, scale: str) -> Epoch:
        """The instant whose Julian date in `scale` is the sum of two numbers (in UTC the quasi-Julian date of SOFA)."""
        scale = scale_named(scale, f"JD {one!r} + {two!r}")
        day_one, day_two = float(np.floor(one)), float(np.floor(two))
        part = (one - day_one) + (two - day_two) + 0.5
        day = day_one + day_two - 2400001.0 + float(np.floor(part))
        part -= float(np.floor(part))
        length = float(scales.length_of_day(np.array(day))) if scale == "UTC" else scales.DAY
        seconds = part * length
        reading = np.array(day), np.array(np.floor(seconds)), np.array(seconds - np.floor(seconds))
        if scale == "UTC" and day < scales.UTC_BEGINS:
            raise ValueError(f"JD {one!r} + {two!r}: there is no UTC before 1960; give it in UT1 or TT")
        one_tt, two_tt = scales.to_tt(scale, *reading, orientation(scale))
        return cls.at(float(one_tt), float(two_tt))

    def reading(self, scale: str, eop: Orientation | None = None) -> Reading:
        """Day (MJD), whole seconds of the day and fraction that a clock of `scale` shows."""
        scale = scale_named(scale, str(scale))
        if scale == "UTC" and self.whole < -1262347200.0 + 30.0:
            raise ValueError(f"{self.to('TT')}: there is no UTC before 1960; ask for UT1 or TT")
        instant = np.array(self.whole), np.array(self.fraction)
        day, seconds, fraction = scales.reading(scale, *instant, orientation(scale, eop))
        return Reading(scale, float(day), float(seconds), float(fraction))

    def to(self, scale: str, eop: Orientation | None = None, digits: int = 9) -> str:
        """The date in a scale, ISO 8601 with at most `digits` decimals and the scale's name, as `Epoch` reads it."""
        return write_date(*self.reading(scale, eop), digits)

    def exact(self) -> str:
        """The shortest text that `Epoch` reads back to the same instant in all bits: in UTC, or in TT with all decimals."""
        text = str(self)
        if Epoch(text) == self:
            return text
        _, day, seconds, fraction = self.reading("TT")
        whole = write_date("TT", day, seconds, 0.0).removesuffix(" TT")
        return f"{whole}{np.format_float_positional(fraction, trim='-').removeprefix('0')} TT"

    def jd(self, scale: str = "TT", eop: Orientation | None = None) -> tuple[float, float]:
        """Julian date in a scale as two numbers, the first that of 0h; in UTC the quasi-Julian date of SOFA."""
        _, day, seconds, fraction = self.reading(scale, eop)
        length = float(scales.length_of_day(np.array(day))) if scale.upper() == "UTC" else scales.DAY
        return 2400000.5 + day, (seconds + fraction) / length

    def datetime(self) -> dt.datetime:
        """The time in UTC, to the nearest microsecond; ValueError within a leap second, which datetime does not have."""
        text = self.to("UTC", digits=6).removesuffix(" UTC")
        if ":60" in text:
            raise ValueError(f"{text} UTC lies in a leap second, which datetime cannot express")
        return dt.datetime.fromisoformat(text).replace(tzinfo=dt.UTC)

    def since(self, other: Epoch) -> tuple[float, float]:
        """Seconds of TT from `other` to here, as a whole number and a fraction in [0, 1): exact to 1e-9 s at any span."""
        whole, fraction = scales.normalized(np.array(self.whole - other.whole), np.array(self.fraction - other.fraction))
        return float(whole), float(fraction)

    def __add__(self, seconds: float | tuple[float, float]) -> Epoch:
        whole, fraction = (seconds, 0.0) if not isinstance(seconds, tuple) else seconds
        try:
            floor = float(np.floor(whole))
            return Epoch.at(self.whole + floor, self.fraction + ((float(whole) - floor) + float(fraction)))
        except TypeError:
            return NotImplemented

    __radd__ = __add__

    def __sub__(self, other: Epoch | float) -> Any:
        if isinstance(other, Epoch):
            return (self.whole - other.whole) + (self.fraction - other.fraction)
        return self + (-other)

    def __lt__(self, other: Epoch) -> bool:
        if not isinstance(other, Epoch):
            return NotImplemented
        return (self.whole, self.fraction) < (other.whole, other.fraction)

    def __str__(self) -> str:
        return self.rounded(9)

    def rounded(self, digits: int) -> str:
        """The date in UTC, before 1960 in TT, with at most so many decimals."""
        return self.to("UTC" if self.whole >= -1262304000.0 else "TT", digits=digits)

    def __repr__(self) -> str:
        return f"Epoch({str(self)!r})"


def orientation(scale: str, eop: Orientation | None = None) -> Orientation | None:
    """The tables of the IERS where UT1 is asked for and nothing else is given; nobody else waits for them."""
    return tables() if scale == "UT1" and eop is None else eop


def _reading(when: Any, scale: str | None) -> Reading:
    if isinstance(when, str):
        return read_date(when, scale)
    if isinstance(when, dt.datetime):
        if when.tzinfo is None:
            return _of_parts(when, scale)
        return _of_parts(when.astimezone(dt.UTC).replace(tzinfo=None), "UTC")
    if isinstance(when, np.datetime64):
        if np.isnat(when):
            raise ValueError("NaT is no date")
        return read_date(str(when.astype("datetime64[ns]")), scale)
    if all(hasattr(when, name) for name in ("jd1", "jd2", "scale")):  # astropy's Time, which need not be installed
        return _of_days(when, scale)
    kind = type(when).__name__
    raise TypeError(
        f"an Epoch is made of text with its scale, a datetime, a numpy.datetime64 or an astropy Time, not of {kind}"
    )


def _of_parts(when: dt.datetime, scale: str | None) -> Reading:
    if scale is None:
        raise ValueError(f"datetime {when.isoformat()} has neither zone nor time scale: {HINT}")
    return read_date(when.isoformat(), scale)


def _of_days(when: Any, scale: str | None) -> Reading:
    if np.ndim(when.jd1):
        raise TypeError(f"an Epoch is one instant; this Time has {np.size(when.jd1)}")
    named = scale_named(str(when.scale), str(when))
    return Epoch.from_jd(float(when.jd1), float(when.jd2), named).reading(named)


def pairs(epochs: Epoch | Iterable[Epoch]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Whole seconds and fractions of one epoch, shape (), or of several, (K,): what `scales` works on."""
    if isinstance(epochs, Epoch):
        return np.array(epochs.whole), np.array(epochs.fraction)
    listed = list(epochs)
    return np.array([e.whole for e in listed]), np.array([e.fraction for e in listed])
