"""Readings of clocks: how far TT is ahead of each time scale, for whole arrays of instants.

An instant is a pair of doubles: whole seconds of TT past J2000.0 TT (2000-01-01T12:00:00 TT), and a fraction in [0, 1).  A
reading of a scale is a Modified Julian Day (0h to 0h), whole seconds of that day, and a fraction.  The sums on offsets that are
whole or have a few decimals are exact, so that hours between two times in UTC come out as 3600 s and nothing else.

Sources: IERS Conventions 2010, ch. 10 (TT, TCG, TDB); IAU SOFA Time Scale and Calendar Tools, through ERFA; Espenak and Meeus
2006 for Delta T before 1962 (`delta_t`).
"""

from __future__ import annotations

import warnings
from typing import NamedTuple, Protocol

import numpy as np

from piazzi.arrays import Array

SCALES = ("UTC", "TAI", "TT", "TDB", "TCG", "GPS", "UT1")
DAY = 86400.0
UTC_BEGINS = 36934.0  # 1960-01-01, the first day that UTC has
STEADY = 41317.0  # 1972-01-01: since then UTC is whole seconds from TAI
TT_TAI = 32.184
_BEHIND_TT = {"TT": (0.0, 0.0), "TAI": (32.0, 0.184), "GPS": (51.0, 0.184)}  # whole seconds and the rest
_TCG_EPOCH = 43144.0 + TT_TAI / DAY  # MJD of TT at which TT, TCG and TDB agreed: 1977-01-01T00:00:00 TAI
_L_G = 6.969290134e-10  # IAU 2000 resolution B1.9


class Pole(NamedTuple):
    """Pole `xp`, `yp` and offsets `dx`, `dy` of the celestial pole, in radians, with their rates in rad/s."""

    values: Array
    rates: Array


class Orientation(Protocol):
    """What time scales and rotations ask for: UT1 - TAI in seconds, its rate, and the pole, at instants."""

    def ut1_tai(self, whole: Array, fraction: Array) -> Array: ...
    def ut1_rate(self, whole: Array, fraction: Array) -> Array: ...
    def pole(self, whole: Array, fraction: Array) -> Pole: ...


def normalized(whole: Array, fraction: Array) -> tuple[Array, Array]:
    """The same number of seconds with a fraction in [0, 1)."""
    carry = np.floor(fraction)
    fraction = fraction - carry
    full = fraction >= 1.0  # a negative fraction of less than an ulp of 1
    return whole + carry + full, np.where(full, 0.0, fraction)


def days(whole: Array, fraction: Array) -> tuple[Array, Array]:
    """Julian date of TT as two numbers, of which the first is whole or half."""
    day = np.floor(whole / DAY)
    return 2451545.0 + day, (whole - day * DAY + fraction) / DAY


def tai_utc(day: Array, of_day: Array) -> Array:
    """TAI - UTC in seconds at `of_day` seconds of a day of UTC; before 1972 it drifts within the day."""
    import erfa

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # "dubious year": leap seconds to come are not known to anybody
        year, month, day_of_month, _ = erfa.jd2cal(2400000.5, day)
        return np.asarray(erfa.dat(year, month, day_of_month, np.clip(of_day / DAY, 0.0, 1.0 - 1e-12)))


def length_of_day(day: Array) -> Array:
    """Seconds that a day of UTC has: 86401 where it ends with a leap second, 86400.1 at some steps before 1972."""
    midnight, noon, next_midnight = tai_utc(day, 0.0 * day), tai_utc(day, 0.0 * day + DAY / 2), tai_utc(day + 1.0, 0.0 * day)
    return np.asarray(DAY + np.round(next_midnight - (2.0 * noon - midnight), 9))  # the drift within the day is no step


def to_tt(
    scale: str, day: Array, seconds: Array, fraction: Array, orientation: Orientation | None = None
) -> tuple[Array, Array]:
    """The instants of readings of `scale`; UT1 needs an `orientation`."""
    whole = (day - 51544.0) * DAY - DAY / 2 + seconds
    if scale in ("TDB", "TCG", "UT1"):
        guess = normalized(whole, fraction)
        for _ in range(3):  # the offset changes by 1e-8 of itself at the most
            guess = normalized(whole, fraction + offset(scale, *guess, orientation))
        return guess
    if scale == "UTC":
        ahead = tai_utc(day, seconds + fraction)
        full = np.floor(ahead)
        return normalized(whole + full + 32.0, fraction + (ahead - full) + 0.184)
    steps, rest = _BEHIND_TT[scale]
    return normalized(whole + steps, fraction + rest)


def reading(scale: str, whole: Array, fraction: Array, orientation: Orientation | None = None) -> tuple[Array, Array, Array]:
    """Day (Modified Julian), whole seconds of the day and fraction that a clock of `scale` shows at instants."""
    if scale == "UTC":
        return _utc(*_since_midnight(*normalized(whole - 32.0, fraction - 0.184)))
    if scale in _BEHIND_TT:
        steps, rest = _BEHIND_TT[scale]
        return _since_midnight(*normalized(whole - steps, fraction - rest))
    return _since_midnight(*normalized(whole, fraction - offset(scale, whole, fraction, orientation)))


def _since_midnight(whole: Array, fraction: Array) -> tuple[Array, Array, Array]:
    day = np.floor((whole + DAY / 2) / DAY)
    return day + 51544.0, whole + DAY / 2 - day * DAY, fraction


def _utc(day: Array, seconds: Array, fraction: Array) -> tuple[Array, Array, Array]:
    """A reading of TAI as one of UTC: the day is that of TAI or the one before, whose last minute may have 61 seconds."""
    ahead = _ahead(day, seconds, fraction)
    before = seconds + fraction < ahead
    if before.any():
        day = np.where(before, day - 1.0, day)
        seconds = np.where(before, seconds + DAY, seconds)
        ahead = np.where(before, _ahead(day, seconds, fraction), ahead)
    steps = np.floor(ahead)
    return day, *normalized(seconds - steps, fraction - (ahead - steps))


def _ahead(day: Array, seconds: Array, fraction: Array) -> Array:
    """TAI - UTC on a day of UTC at a reading of TAI."""
    ahead = tai_utc(day, seconds)
    drifts = day < STEADY
    for _ in range(3 if drifts.any() else 0):
        ahead = np.where(drifts, tai_utc(day, seconds + fraction - ahead), ahead)
    return ahead


def offset(scale: str, whole: Array, fraction: Array, orientation: Orientation | None = None) -> Array:
    """TT minus TDB, TCG or UT1 at instants, in seconds."""
    import erfa

    jd, part = days(whole, fraction)
    if scale == "TCG":
        since = (jd - 2400000.5 - _TCG_EPOCH) * DAY + part * DAY
        return np.asarray(-_L_G / (1.0 - _L_G) * since)
    if scale == "TDB":
        return np.asarray(-erfa.dtdb(jd, part, np.mod(part + 0.5, 1.0), 0.0, 0.0, 0.0))  # at the geocentre
    assert orientation is not None
    return np.asarray(TT_TAI - orientation.ut1_tai(whole, fraction))
