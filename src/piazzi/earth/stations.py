"""Stations: where an instrument stands at a date, its axes up, north and east, and what it sees a place at.

Coordinates are those of the ITRF, which is tide-free: tides are added by `tides`.  They move with the plate, at a constant
velocity between two dates; the instrument stands off its marker by an eccentricity, up, north and east, which has dates too.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.geodetic import geodetic_to_position, position_to_geodetic
from piazzi.text import brief, nearest

YEAR = 365.25 * 86400.0  # s, the year of velocities in SINEX
LOWEST, HIGHEST = -550.0, 9000.0  # m above the ellipsoid: below the Dead Sea and above the Himalaya
J2000 = Epoch.at(0.0)


class StationWarning(UserWarning):
    """A station stands where none is likely to."""


@dataclass(frozen=True)
class Coordinates:
    """A marker in the ITRF between two dates.

    Parameters
    ----------
    position : m, at `reference`
    velocity : m/year of 365.25 days
    reference : the date of the position
    since, until : dates between which they hold; None is always
    point : the marker's letter, to which eccentricities belong
    """

    position: tuple[float, float, float]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reference: Epoch = J2000
    since: Epoch | None = None
    until: Epoch | None = None
    point: str = "A"

    def __post_init__(self) -> None:
        for name in ("position", "velocity"):
            values = tuple(float(v) for v in getattr(self, name))
            if len(values) != 3 or not np.all(np.isfinite(values)):
                raise ValueError(f"{name} is {values}; it must be three finite numbers")
            object.__setattr__(self, name, values)

    def at(self, seconds: Array) -> Array:
        """Position (..., 3) in metres at seconds of TT past J2000.0."""
        years = (seconds - _seconds(self.reference, 0.0)) / YEAR
        return np.asarray(np.asarray(self.position) + years[..., None] * np.asarray(self.velocity))


@dataclass(frozen=True)
class Eccentricity:
    """What is measured to, seen from the marker, in metres up, north and east, between two dates; None is always."""

    up: float
    north: float
    east: float
    since: Epoch | None = None
    until: Epoch | None = None
    point: str = "A"


@dataclass(frozen=True)
class Station:
    """An instrument on the ground.

    Parameters
    ----------
    name : what files call it
    coordinates : one set or more, each between two dates
    eccentricities : from the marker to the instrument, by date
    bias : known biases by kind of measurement (range in m, ...), in SI units
    sigma : standard deviations of measurements by kind, in SI units
    mask : lowest elevation that it measures at, in radians
    description : place, instrument
    source : file or list
    """

    name: str
    coordinates: tuple[Coordinates, ...]
    eccentricities: tuple[Eccentricity, ...] = ()
    bias: Mapping[str, float] = field(default_factory=dict, hash=False)
    sigma: Mapping[str, float] = field(default_factory=dict, hash=False)
    mask: float = 0.0
    description: str = ""
    source: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        if not self.coordinates:
            raise ValueError(f"station {self.name!r} has no coordinates")
        object.__setattr__(self, "coordinates", tuple(sorted(self.coordinates, key=_start)))
        object.__setattr__(self, "eccentricities", tuple(sorted(self.eccentricities, key=_start)))
        for kind, value in self.sigma.items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"station {self.name!r}: sigma of {kind} is {value!r}; it must be positive")
        for kind, value in self.bias.items():
            if not np.isfinite(value):
                raise ValueError(f"station {self.name!r}: bias of {kind} is {value!r}; it must be finite")
        if not -np.pi / 2 <= self.mask < np.pi / 2:
            raise ValueError(f"station {self.name!r}: mask is {np.degrees(self.mask):g} deg; it lies between -90 and 90")

    @classmethod
    def geodetic(
        cls,
        name: str,
        latitude: float,
        longitude: float,
        height: float,
        ellipsoid: str | tuple[float, float] = "WGS84",
        **others: Any,
    ) -> Station:
        """A station at a latitude and longitude (rad, north and east positive) and a height above an ellipsoid (m)."""
        position = geodetic_to_position(latitude, longitude, height, ellipsoid)
        return cls(name, (Coordinates(tuple(position)),), **others)

    def position(self, epoch: Epoch | Iterable[Epoch]) -> Array:
        """Where the instrument is at an instant or at K of them, in the ITRF, (3,) or (K, 3) in metres; without tides.

        The coordinates that hold are the last ones that began before the date, or the first ones; so are the eccentricities.
        """
        whole, fraction = pairs(epoch)
        seconds = whole + fraction
        result = np.empty((*seconds.shape, 3))
        chosen = _latest(self.coordinates, seconds)
        for i in distinct(chosen):
            here = chosen == i
            marker = self.coordinates[i]
            result[here] = self._instrument(marker.point, seconds[here], marker.at(seconds[here]))
        return result

    def _instrument(self, point: str, seconds: Array, marker: Array) -> Array:
        offsets = [e for e in self.eccentricities if e.point == point]
        if not offsets:
            return marker
        une = np.array([(e.up, e.north, e.east) for e in offsets])[_latest(offsets, seconds)]
        return np.asarray(marker + np.einsum("...ij,...i->...j", up_north_east(marker), une))

    def moved(self, up: float = 0.0, north: float = 0.0, east: float = 0.0) -> Station:
        """The station so many metres away."""
        une = np.array([up, north, east])
        there = [c.position + une @ up_north_east(np.array(c.position)) for c in self.coordinates]
        return replace(
            self, coordinates=tuple(replace(c, position=tuple(p)) for c, p in zip(self.coordinates, there, strict=True))
        )

    def place(self, epoch: Epoch = J2000, ellipsoid: str | tuple[float, float] = "WGS84") -> tuple[float, float, float]:
        """Latitude, longitude (rad) and height above the ellipsoid (m) of the instrument at a date."""
        latitude, longitude, height = position_to_geodetic(self.position(epoch), ellipsoid)
        return float(latitude), float(longitude), float(height)

    def look(self, target: Array, epoch: Epoch | Iterable[Epoch]) -> tuple[Array, Array, Array]:
        """Azimuth, elevation (rad) and range (m) of Earth-fixed places (3,) or (K, 3), as `azimuth_elevation_range`."""
        return azimuth_elevation_range(self.position(epoch), target)


@dataclass(frozen=True)
class StationList(Mapping[str, Station]):
    """Stations by name, and `notes`: what was added to what the files say, or left out of it."""

    stations: tuple[Station, ...]
    notes: tuple[str, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        names = [s.name for s in self.stations]
        twice = next((n for i, n in enumerate(names) if n in names[:i]), None)
        if twice is not None:
            raise ValueError(f"station {twice!r} is given twice")

    def __getitem__(self, name: str) -> Station:
        for station in self.stations:
            if station.name == name:
                return station
        raise KeyError(f"no station {name!r}{nearest(name, self)}")

    def __contains__(self, name: object) -> bool:
        return any(station.name == name for station in self.stations)

    def __iter__(self) -> Iterator[str]:
        return (station.name for station in self.stations)

    def __len__(self) -> int:
        return len(self.stations)


def up_north_east(position: Array) -> Array:
    """Unit vectors up, north and east, the rows of (..., 3, 3), at Earth-fixed positions (..., 3) in metres (WGS84)."""
    latitude, longitude, _ = position_to_geodetic(position)
    sp, cp, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    up = np.stack([cp * cl, cp * sl, sp], -1)
    north = np.stack([-sp * cl, -sp * sl, cp], -1)
    east = np.stack([-sl, cl, np.zeros_like(sl)], -1)
    return np.stack([up, north, east], -2)


def azimuth_elevation_range(origin: Array, target: Array) -> tuple[Array, Array, Array]:
    """Azimuth from north through east in [0, 2 pi), elevation (rad) and range (m) of a place seen from another, both ITRF."""
    line = np.asarray(target, dtype=float) - np.asarray(origin, dtype=float)
    up, north, east = np.moveaxis(np.einsum("...ij,...j->...i", up_north_east(origin), line), -1, 0)
    azimuth = np.arctan2(east, north) % (2.0 * np.pi)
    return azimuth, np.arctan2(up, np.hypot(north, east)), np.linalg.norm(line, axis=-1)


def _seconds(epoch: Epoch | None, without: float) -> float:
    return without if epoch is None else epoch.whole + epoch.fraction


def _start(item: Coordinates | Eccentricity) -> float:
    return _seconds(item.since, -np.inf)


def _latest(items: Iterable[Coordinates | Eccentricity], seconds: Array) -> Array:
    """Index of the last item that began before each time; the first one before all."""
    return np.maximum(np.searchsorted([_start(item) for item in items], seconds, side="right") - 1, 0)


def warn_of_place(station: Station, where: str = "") -> None:
    """Ask, by a StationWarning, about a station that stands inside the Earth or above all mountains."""
    beside = f"{where}: " if where else ""
    radius = float(np.linalg.norm(station.coordinates[-1].position))
    height = station.place()[2] if radius > 1e6 else radius - 6.37e6
    if height < LOWEST:
        kilometres = ": are the coordinates in km?" if 6300.0 < radius < 6400.0 else "; is that meant?"
        warnings.warn(
            f"{beside}station {station.name!r} is {-height:,.0f} m below the ellipsoid, inside the Earth{kilometres}",
            StationWarning,
            stacklevel=3,
        )
    elif height > HIGHEST:
        warnings.warn(
            f"{beside}station {station.name!r} is {height:,.0f} m above the ellipsoid, above any mountain; is that meant?",
            StationWarning,
            stacklevel=3,
        )
