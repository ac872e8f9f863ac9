"""Orientation, bodies and stations as functions of equations: tables over time, made day by day from the same routines.

Each is a polynomial by pieces of equal length that begin at multiples of it past 0h UTC of the epoch's day, so that values do
not depend on the span that was asked for.  Days count 86400 s: behind a leap second, pieces begin a second before midnight,
where the rate of UT1 steps (by 1e-14 rad/s at the most).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import floor
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.bodies import body
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.rotation import FRAMES, frame_named, rotation
from piazzi.earth.scales import Orientation
from piazzi.earth.stations import Station
from piazzi.earth.subdaily import SubdailyEOP
from piazzi.earth.tides import station_displacement
from piazzi.model.functions import STATION_TERMS, Signature
from piazzi.outside.evaluation import check_count, checksum, derivatives, value
from piazzi.outside.pieces import Pieces, fitted
from piazzi.text import brief

DAY = scales.DAY
DAYS = (
    8192  # that are kept, of all tables: years of a problem with a few, at most 10 kB each; fewer, and none would be met again
)
AROUND = 256  # whose block is kept too, for values one by one
_UTC_FROM = -1262304000.0  # s past J2000.0: 1960; before it days begin at 0h TT


class _Daily(Protocol):
    """A recipe whose values are known at any instants."""

    epoch: Epoch
    TERMS: ClassVar[int]
    LENGTH: ClassVar[float]

    def __hash__(self) -> int: ...
    def at(self, epochs: list[Epoch]) -> Array: ...


class Tabulated:
    """What functions made of tables over time have in common; they give the `COLUMNS` of one at a time `t`."""

    TERMS: ClassVar[int] = 10
    LENGTH: ClassVar[float] = DAY
    COLUMNS: ClassVar[int] = 3
    epoch: Epoch

    @property
    def signature(self) -> Signature:
        """The form of the function."""
        return Signature.of_table(self.COLUMNS, self.TERMS)

    @property
    def span(self) -> None:
        """Known at any time."""
        return

    @property
    def table(self) -> Any:
        """The recipe that has the same table, of all that do."""
        return self

    def pieces(self, first: float, last: float) -> Pieces:
        """The polynomials from the day of `first` to that of `last` (s)."""
        midnight = -sum(_of_day(self.epoch))
        a, b = day_of(self.epoch, first), day_of(self.epoch, last)
        coefficients = np.concatenate([_day(self.table, k) for k in range(a, b + 1)])
        zero = np.zeros(coefficients.shape[2])
        return Pieces(midnight + a * DAY, self.LENGTH, coefficients, zero, zero)

    def block(self, first: float, last: float) -> Array:
        """The data for these times, as kernels read them."""
        return self.pieces(first, last).block

    def value(self, *t: float) -> tuple[float, ...]:
        """The columns at `t`."""
        check_count(self.signature, t)
        return value(self.signature, _around(self, *t), *t)

    def derivatives(self, *t: float) -> Array:
        """The rates of the columns at `t`, (columns, 1)."""
        check_count(self.signature, t)
        return derivatives(self.signature, _around(self, *t), *t)

    def arrays(self, t: Array) -> Array:
        """Values at times (K,), a row for each."""
        return self.pieces(float(t.min()), float(t.max()))(t)[0]


@lru_cache(maxsize=DAYS)
def _of_day(epoch: Epoch) -> tuple[float, float]:
    """Seconds of the day of UTC, whole and the rest."""
    seconds, fraction = epoch.reading("UTC" if epoch.whole > _UTC_FROM else "TT")[2:]
    return seconds, fraction


@lru_cache(maxsize=DAYS)
def _day(recipe: _Daily, number: int) -> Array:
    """Coefficients of all pieces of one day, counted from that of the epoch."""
    seconds, fraction = _of_day(recipe.epoch)
    midnight = Epoch.at(recipe.epoch.whole - seconds + number * DAY, recipe.epoch.fraction - fraction)
    count = round(DAY / recipe.LENGTH)
    found = fitted(lambda times: recipe.at([midnight + t for t in times.tolist()]), 0.0, recipe.LENGTH, count, recipe.TERMS)
    coefficients = found.coefficients
    coefficients.flags.writeable = False
    return coefficients


def day_of(epoch: Epoch, t: float) -> int:
    """The day of `t`, counted from that of the epoch."""
    return floor((t + sum(_of_day(epoch))) / DAY)


def _around(recipe: Tabulated, t: float) -> Array:
    """The data of the day of `t`: checks at the door ask for many values of the same."""
    return _block_of_day(recipe, day_of(recipe.epoch, t))


@lru_cache(maxsize=AROUND)
def _block_of_day(recipe: Tabulated, number: int) -> Array:
    noon = (number + 0.5) * DAY - sum(_of_day(recipe.epoch))
    return recipe.block(noon, noon)


@dataclass(frozen=True)
class Rotation(Tabulated):
    """Turns components in one frame into those in another at a time: ``(t, x, y, z)`` to three.

    Both directions between two frames read one table of nine numbers.  It differs from `rotation` by less than 1e-11 rad.

    Parameters
    ----------
    from_, to : names of frames
    epoch : the instant of t = 0, that of the problem
    eop : orientation of the Earth; default the tables of the IERS
    """

    TERMS: ClassVar[int] = 10
    LENGTH: ClassVar[float] = DAY / 12

    from_: str
    to: str
    epoch: Epoch
    eop: Orientation | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("from_", "to"):
            object.__setattr__(self, name, frame_named(getattr(self, name)))

    @property
    def frames(self) -> tuple[str, str]:
        """The frames in the order of the table."""
        first, last = sorted((self.from_, self.to), key=FRAMES.index)
        return first, last

    @cached_property
    def table(self) -> Rotation:
        """That from the first of both frames to the second."""
        return self if (self.from_, self.to) == self.frames else Rotation(*self.frames, self.epoch, self.eop)

    @cached_property
    def signature(self) -> Signature:
        """The form of the function."""
        partials = tuple((i, j) for i in range(3) for j in range(4))
        back = self.frames != (self.from_, self.to)
        return Signature("rotation", 4, 3, partials, self.TERMS, transposed=back, shared=" ".join(self.frames))

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("rotation", self.frames, self.epoch.whole, self.epoch.fraction, orientation_key(self.eop))

    def at(self, epochs: list[Epoch]) -> Array:
        """The nine numbers, by rows, at instants, (K, 9)."""
        return rotation(*self.frames, epochs, self.eop).reshape(-1, 9)

    def matrix(self, t: float) -> tuple[Array, Array]:
        """The matrix and its time derivative."""
        table, data = Signature.of_table(9, self.TERMS), _around(self, t)
        R = np.array(value(table, data, t)).reshape(3, 3)
        rate = derivatives(table, data, t).reshape(3, 3)
        return (R.T, rate.T) if self.signature.transposed else (R, rate)

    def arrays(self, t: Array, *vector: Array) -> Array:
        """The components along the other axes at times and vectors, (K, 3)."""
        R = super().arrays(t).reshape(-1, 3, 3)
        return np.asarray(np.einsum("kji,jk->ki" if self.signature.transposed else "kij,jk->ki", R, np.stack(vector)))

    def value(self, *arguments: float) -> tuple[float, ...]:
        """The components along the other axes, at t, x, y, z."""
        check_count(self.signature, arguments)
        return tuple((self.matrix(arguments[0])[0] @ np.array(arguments[1:])).tolist())

    def derivatives(self, *arguments: float) -> Array:
        """The derivatives by t, x, y, z, (3, 4)."""
        check_count(self.signature, arguments)
        R, rate = self.matrix(arguments[0])
        return np.column_stack([rate @ np.array(arguments[1:]), R])


@dataclass(frozen=True)
class Body(Tabulated):
    """Where Sun, Moon or a planet is seen from the centre of the Earth, m on the axes of the GCRF: ``(t)`` to three.

    Parameters
    ----------
    name : of a body, as `body` takes it
    epoch : the instant of t = 0, that of the problem
    kernel : a kernel of JPL; default the series
    center : the body that it is seen from
    scale : "TT" or "TDB", whose seconds `t` counts
    """

    name: str
    epoch: Epoch
    kernel: str | Path | None = None
    center: str = "earth"
    scale: str = "TT"

    __repr__ = brief

    def __post_init__(self) -> None:
        if self.kernel is None:
            body(self.name, self.epoch, self.center)

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        where = None if self.kernel is None else str(self.kernel)
        return checksum("body", self.name, self.center, where, self.epoch.whole, self.epoch.fraction, self.scale)

    def at(self, epochs: list[Epoch]) -> Array:
        """Positions at instants, (K, 3)."""
        epochs = in_tdb(self.epoch, epochs) if self.scale == "TDB" else epochs
        return body(self.name, epochs, self.center, self.kernel)[0]


@dataclass(frozen=True)
class Place(Tabulated):
    """Position and velocity of a station on the axes of the GCRF (m, m/s): ``(t)`` to six.

    The plate's motion, and with `tides` those of the solid Earth and the pole, are in it.

    Parameters
    ----------
    station : an `earth.Station`; None is the centre of the Earth
    epoch : the instant of t = 0, that of the problem
    eop : orientation of the Earth; default the tables of the IERS
    tides : whether tides move it
    about : "earth", or "sun" for where it is seen from the centre of the Sun (the Earth by its series, `SERIES_ERROR`)
    """

    TERMS: ClassVar[int] = STATION_TERMS
    LENGTH: ClassVar[float] = DAY / 6
    COLUMNS: ClassVar[int] = 6

    station: Station | None
    epoch: Epoch
    eop: Orientation | None = None
    tides: bool = True
    about: str = "earth"

    __repr__ = brief

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        of = (self.station.coordinates, self.station.eccentricities) if self.station else ("centre of the Earth",)
        about = () if self.about == "earth" else (self.about,)
        return checksum("station", *of, self.epoch.whole, self.epoch.fraction, orientation_key(self.eop), self.tides, *about)

    def at(self, epochs: list[Epoch]) -> Array:
        """Positions at instants, (K, 3)."""
        place = self._from_the_earth(epochs)
        return place + body("earth", epochs, "sun")[0] if self.about == "sun" else place

    def _from_the_earth(self, epochs: list[Epoch]) -> Array:
        if self.station is None:
            return np.zeros((len(epochs), 3))
        place = self.station.position(epochs)
        if self.tides:
            place = place + station_displacement(place, epochs, self.eop)
        return np.asarray((rotation("ITRF", "GCRF", epochs, self.eop) @ place[..., None])[..., 0])

    def pieces(self, first: float, last: float) -> Pieces:
        """Positions from the day of `first` to that of `last`, and velocities, which are their derivatives."""
        return with_rates(super().pieces(first, last))


def with_rates(places: Pieces) -> Pieces:
    """Positions and beside them velocities, which are their derivatives."""
    c = places.coefficients
    powers = np.arange(c.shape[1] - 1, 0, -1)[:, None] * (2.0 / places.length)
    rates = np.concatenate([np.zeros_like(c[:, :1]), powers * c[:, :-1]], axis=1)
    zero = np.zeros(2 * c.shape[2])
    return Pieces(places.start, places.length, np.concatenate([c, rates], axis=2), zero, zero)


def in_tdb(start: Epoch, epochs: list[Epoch]) -> list[Epoch]:
    """Instants that are as many seconds of TDB past the first as these are of TT."""
    whole, fraction = pairs([start, *epochs])
    behind = scales.offset("TDB", whole, fraction)  # TT - TDB, whose own change within it is nothing
    return [epoch + float(shift) for epoch, shift in zip(epochs, behind[1:] - behind[0], strict=True)]


def orientation_key(eop: Orientation | None) -> Iterable[Any]:
    """What tells one orientation of the Earth from another."""
    if isinstance(eop, SubdailyEOP):
        return ("subdaily", *orientation_key(eop.eop))
    daily = getattr(eop, "daily_ut1_tai", None)
    return (repr(eop),) if daily is None else (getattr(eop, "source", ""), daily.tobytes().hex())
