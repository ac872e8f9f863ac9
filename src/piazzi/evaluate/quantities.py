"""Numbers as people read them: km and degrees instead of metres and radians, and no digits that mean nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor, inf, isfinite, log10, pi, sqrt

NOTHING = "-"
# SI unit -> unit for large values, the factor to it, and the size from which it is used
_LARGE = {"m": ("km", 1e-3, 1e4), "m/s": ("km/s", 1e-3, 1e3), "m^2/s": ("km^2/s", 1e-6, 1e9)}
_FINE = pi / 180 / 36  # a hundred seconds of arc
_ALWAYS = {"rad": ("deg", 180 / pi), "rad/s": ("deg/s", 180 / pi)}


@dataclass(frozen=True)
class Display:
    """A unit to show values in: shown = value * factor."""

    unit: str
    factor: float = 1.0

    @property
    def suffix(self) -> str:
        """The unit after a space, or nothing."""
        return f" {self.unit}" if self.unit else ""

    def label(self, what: str) -> str:
        """`what` with the unit in brackets, for axes and headings."""
        return f"{what} [{self.unit}]" if self.unit else what


def display_of(unit: str, values: Iterable[float | None] = ()) -> Display:
    """The unit to show SI values of this unit in: degrees always, kilometres where the largest of them is large."""
    if unit in _ALWAYS:
        return Display(*_ALWAYS[unit])
    largest = max((abs(v) for v in values if v is not None and isfinite(v)), default=0.0)
    name, factor, start = _LARGE.get(unit, (unit, 1.0, inf))
    return Display(name, factor) if largest >= start else Display(unit)


def fine(unit: str, size: float) -> Display:
    """The unit to show differences of about this size in: small angles in seconds of arc."""
    if unit == "rad" and 0.0 < abs(size) < _FINE:
        return Display("arcsec", 3600.0 * 180.0 / pi)
    return display_of(unit, [size])


def displays(
    units: Sequence[str], values: Sequence[Iterable[float | None]], groups: Iterable[Sequence[int]] = ()
) -> list[Display]:
    """For each quantity the unit to show it in: one for all of a group of them; those in no group, by what their unit is.

    Parameters
    ----------
    units, values : of every quantity, SI
    groups : places of quantities that are shown alike, such as the components of a position
    """
    of = {i: n for n, group in enumerate(groups) for i in group}
    together: dict[tuple[int, str], list[float | None]] = {}
    keys = [(of.get(i, -1), unit) for i, unit in enumerate(units)]
    for key, own in zip(keys, values, strict=True):
        together.setdefault(key, []).extend(own)
    return [display_of(unit, together[key]) for key, unit in zip(keys, units, strict=True)]


def number(value: float | None, digits: int = 4) -> str:
    """The value to so many significant digits, without an exponent where it is of ordinary size; "-" for None."""
    if value is None:
        return NOTHING
    if not isfinite(value):
        return str(value)
    if value == 0:
        return "0"
    scientific = f"{value:.{digits - 1}e}"
    rounded, exponent = float(scientific), int(scientific.partition("e")[2])
    if not -4 <= exponent < max(digits, 6):
        return scientific
    return f"{rounded:.{max(digits - 1 - exponent, 0)}f}"


def with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """A value and its standard deviation with the same decimals: as many as show two digits of the deviation."""
    if not (isfinite(value) and isfinite(sigma)) or sigma <= 0:
        return number(value, 6), number(sigma, 2)
    decimals = 1 - floor(log10(float(f"{sigma:.1e}")))
    if decimals > 12:
        return number(value, 6), number(sigma, 2)
    if abs(value) >= 1e12 or sigma >= 1e9:
        digits = decimals + 1 + floor(log10(abs(value))) if value else 2
        return number(value, min(max(digits, 2), 16)), number(sigma, 2)
    return f"{value:z.{max(decimals, 0)}f}", f"{sigma:.{max(decimals, 0)}f}"


def duration(seconds: float | None) -> str:
    """Seconds with the prefix that suits them: 1.05 ms; longer spans as minutes, hours or days."""
    if seconds is None or not isfinite(seconds):
        return NOTHING
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (120.0, "min")):
        if seconds >= (2 * size if unit != "min" else size):
            return f"{number(seconds / (60 if unit == 'min' else size), 3)} {unit}"
    for factor, unit in ((1.0, "s"), (1e3, "ms")):
        if seconds * factor >= 1:
            return f"{number(seconds * factor, 3)} {unit}"
    return f"{number(seconds * 1e6, 3)} us" if seconds > 0 else "0 s"


def finite(value: float | None) -> float | None:
    """The number, None where it is not finite: JSON has no other."""
    return float(value) if value is not None and isfinite(value) else None


def unit_of(units: Iterable[str]) -> str:
    """The unit that all of these are, "" where they differ."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""


def ends(values: Iterable[float | None]) -> tuple[float, ...]:
    """The smallest and the largest of the values that there are, to three digits: one where they are the same."""
    found = sorted({float(f"{v:.3g}") for v in values if v is not None})
    return tuple(dict.fromkeys((found[0], found[-1]))) if found else ()


def ideal(values: Iterable[float | None]) -> str:
    """What a mean NEES or NIS should be, in words, where estimators differ from the smallest to the largest."""
    return f"ideal {' to '.join(f'{v:g}' for v in ends(values)) or NOTHING}"


def sigma_factor(mean_squared: float, expected: float) -> float:
    """How many times larger errors are than their covariance says, from a mean NEES or NIS and its expectation."""
    return sqrt(mean_squared / expected)
