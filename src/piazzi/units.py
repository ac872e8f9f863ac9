"""Units of a scenario file, converted at the door: inside there are SI units and radians only."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from piazzi.text import nearest, one_line

DIMENSIONS = ("length", "angle", "time", "mass")
SI = ("m", "rad", "s", "kg")
_DEGREE = math.pi / 180

# name: (value in SI, exponents of length, angle, time and mass)
TABLE: Mapping[str, tuple[float, tuple[int, int, int, int]]] = {
    **{name: (value, (1, 0, 0, 0)) for name, value in {
        "m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "Mm": 1e6, "ft": 0.3048, "nmi": 1852.0, "au": 149597870700.0,
    }.items()},
    **{name: (value, (0, 1, 0, 0)) for name, value in {
        "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": _DEGREE, "arcmin": _DEGREE / 60, "arcsec": _DEGREE / 3600,
        "mas": _DEGREE / 3.6e6, "rev": 2 * math.pi,
    }.items()},
    **{name: (value, (0, 0, 1, 0)) for name, value in {
        "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0,
    }.items()},
    **{name: (value, (0, 0, 0, 1)) for name, value in {"kg": 1.0, "g": 1e-3, "t": 1e3}.items()},
    "Hz": (1.0, (0, 0, -1, 0)),
    "kHz": (1e3, (0, 0, -1, 0)),
    "MHz": (1e6, (0, 0, -1, 0)),
    "N": (1.0, (1, 0, -2, 1)),
    "mN": (1e-3, (1, 0, -2, 1)),
    "J": (1.0, (2, 0, -2, 1)),
    "W": (1.0, (2, 0, -3, 1)),
    "Pa": (1.0, (-1, 0, -2, 1)),
}  # fmt: skip

# Lengths of time as options and keys have them, such as 30s, 10min, 6h, 1d, "1 day"; a year is Julian.
_TIMES: Mapping[str, float] = {
    name: value
    for value, names in (
        (1.0, "s sec second seconds"), (60.0, "min minute minutes"), (3600.0, "h hr hour hours"), (86400.0, "d day days"),
        (604800.0, "week weeks"), (31557600.0, "yr year years"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"),
    )
    for name in names.split()
}  # fmt: skip
_DURATION = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z]*)", re.ASCII)

_FACTOR = re.compile(r"\s*(?:1|([A-Za-z]+)(?:\s*\^\s*([+-]?\d{1,2}(?:\.\d{1,3})?)|([2-9]))?)\s*")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z].*)", re.ASCII)


def is_quantity(value: object) -> bool:
    """Whether this is text of a number with a unit."""
    return isinstance(value, str) and _QUANTITY.fullmatch(value[:100]) is not None


def size_of(text: str) -> float:
    """The number of a text that `is_quantity`."""
    match = _QUANTITY.fullmatch(text)
    assert match is not None
    return float(match[1])


def duration(text: str, what: str, *, plain: bool = True) -> float:
    """A length of time in seconds, as 30s, 10min, 6h, 1d or "1 day"; a number alone is of seconds where that is `plain`.

    Raises
    ------
    ValueError
        With `what` and the text, where it is none.
    """
    match = _DURATION.fullmatch(str(text)[:100].strip())
    factor = None if match is None else _TIMES.get(match[2] or ("s" if plain else ""))
    if match is None or factor is None or not math.isfinite(value := float(match[1]) * factor):
        raise ValueError(f"{what} is {one_line(str(text), 60)!r}; write a length of time such as 60s, 10min, 6h or 3d")
    return value


def positive_duration(text: str, what: str, *, plain: bool = True) -> float:
    """A `duration` above zero."""
    value = duration(text, what, plain=plain)
    if value <= 0:
        raise ValueError(f"{what} is {one_line(str(text), 60)!r}; it must be a positive length of time")
    return value


@dataclass(frozen=True)
class Unit:
    """What turns numbers into SI, the exponents of length, angle, time and mass, and the name of the SI unit."""

    factor: float
    powers: tuple[Fraction, ...]
    label: str

    @property
    def is_angle(self) -> bool:
        return self.powers == (Fraction(0), Fraction(1), Fraction(0), Fraction(0))


ONE = Unit(1.0, (Fraction(0),) * 4, "")


@dataclass(frozen=True)
class Units:
    """What the words length, angle, time and mass mean in a file."""

    base: tuple[str, ...] = SI

    @classmethod
    def parse(cls, text: str) -> Units:
        """The units of a header such as "km, deg"; raises ValueError for unknown ones, or two of one dimension."""
        base = list(SI)
        seen: dict[int, str] = {}
        for word in text.split(","):
            name = word.strip()
            powers = TABLE[name][1] if name in TABLE else ()
            if sorted(powers) != [0, 0, 0, 1]:
                simple = [n for n, (_, p) in TABLE.items() if sorted(p) == [0, 0, 0, 1]]
                raise ValueError(f"{name[:40]!r} is no unit of {', '.join(DIMENSIONS)}{nearest(name[:40], simple)}")
            i = powers.index(1)
            if i in seen:
                raise ValueError(f"{seen[i]!r} and {name!r} are both units of {DIMENSIONS[i]}: give one")
            seen[i] = base[i] = name
        return cls(tuple(base))

    @property
    def declared(self) -> bool:
        """Whether numbers without a unit would be ambiguous."""
        return self.base != SI

    def unit(self, text: str) -> Unit:
        """The unit that a text such as "km/s", "length**3/time**2" or "1" stands for; "m/s2" is "m/s**2".

        Raises
        ------
        ValueError
            For an unknown unit, with the nearest, or a text that is no product of powers.
        """
        first, *rest = re.split(r"([*/])", text.replace("**", "^")) if len(text) <= 80 else [""]
        factor, powers = 1.0, [Fraction(0)] * 4
        for joint, part in zip(["*", *rest[::2]], [first, *rest[1::2]], strict=True):
            match = _FACTOR.fullmatch(part)
            if match is None:
                raise ValueError(f"{text[:80]!r} is no unit: write a product such as 'km/s' or 'length**3/time**2', or '1'")
            if match[1] is None:
                continue
            value, base = self._named(match[1])
            power = Fraction(match[2] or match[3] or 1) * (-1 if joint == "/" else 1)
            factor *= _power(value, power)
            powers = [p + power * b for p, b in zip(powers, base, strict=True)]
        if not 0 < factor < math.inf:
            raise ValueError(f"unit {text!r} is out of range")
        return Unit(factor, tuple(powers), label(powers))

    def quantity(self, text: str) -> tuple[float, Unit]:
        """Number and unit of a text such as "10 deg"; raises ValueError for what is none, or an unknown unit."""
        match = _QUANTITY.fullmatch(text) if len(text) <= 100 else None
        if match is None:
            raise ValueError(f"{text[:80]!r} is no number with a unit, such as '10 deg'")
        return float(match[1]), self.unit(match[2])

    def _named(self, name: str) -> tuple[float, tuple[int, int, int, int]]:
        if name in DIMENSIONS:
            return TABLE[self.base[DIMENSIONS.index(name)]]
        if name not in TABLE:
            raise ValueError(f"unknown unit {name[:40]!r}{nearest(name[:40], [*DIMENSIONS, *TABLE])}")
        return TABLE[name]

    def time(self) -> float:
        """Seconds in the file's unit of time."""
        return TABLE[self.base[2]][0]

    def length(self) -> float:
        """Metres in the file's unit of length."""
        return TABLE[self.base[0]][0]


def _power(value: float, power: Fraction) -> float:
    try:
        return float(value ** (int(power) if power.denominator == 1 else float(power)))
    except OverflowError:
        return math.inf


@dataclass(frozen=True)
class Labels(Units):
    """Units of numbers that are in SI already: whatever a text says, it is only a label."""

    def unit(self, text: str) -> Unit:
        return Unit(1.0, ONE.powers, text)


def label(powers: Sequence[Fraction]) -> str:
    """Name of the SI unit with these exponents, such as "m^3/s^2"; "" for none."""

    def product(sign: int) -> str:
        named = zip(("kg", "m", "rad", "s"), (powers[3], *powers[:3]), strict=True)
        used = [(name, sign * p) for name, p in named if sign * p > 0]
        return " ".join(name if p == 1 else f"{name}^{float(p):g}" for name, p in used)

    above, below = product(1), product(-1)
    if not below:
        return above
    return f"{above or '1'}/{below}" if " " not in below else f"{above or '1'}/({below})"
