"""The density of the air by NRLMSIS 2.1 about a nominal arc, as a table over time: what kernels read instead of the model.

The logarithm of the density is a polynomial in the height beside that of the arc, within a reach of three scale heights; its
coefficients are polynomials of time by pieces.  Pieces begin with the three hours for which an ap stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.earth.epoch import Epoch
from piazzi.earth.fields import gravity_field
from piazzi.earth.force_air import AIR_TERMS
from piazzi.earth.geodetic import position_to_geodetic
from piazzi.earth.rotation import rotation
from piazzi.earth.space_weather import SpaceWeather, read_space_weather
from piazzi.earth.tabulated import DAY, Tabulated
from piazzi.outside.evaluation import checksum
from piazzi.text import brief

SCALE_HEIGHTS = 3.0
REMAKE = 0.2  # scale heights by which an orbit may leave the arc before the table is made again
VERSION = 2.1
POWERS = 5
_STEP = 60.0  # s, of the arc
_SPAN = 10e3  # m, over which the scale height is taken
_NODES = np.cos(np.pi * (np.arange(11) + 0.5) / 11)
LOWEST = 100e3  # m, of an arc


@dataclass(frozen=True)
class Thermosphere(Tabulated):
    """Logarithm of density about an arc, as `POWERS` coefficients, then the arc's height and the reach (m): ``(t)`` to seven.

    Parameters
    ----------
    epoch : the instant of t = 0, that of the problem
    orbit : x, y, z, vx, vy, vz (m, m/s, GCRF) at `orbit_time`; the arc goes from there with the flattening of the Earth alone
    weather : a file of CelesTrak with F10.7 and Ap, or what `read_space_weather` gives
    orbit_time : s after the epoch, when the orbit is there

    Raises
    ------
    ValueError
        Where `pymsis` is missing (``pip install 'piazzi[msis]'``), or the space weather does not have a date.
    """

    TERMS: ClassVar[int] = AIR_TERMS
    LENGTH: ClassVar[float] = DAY / 288
    COLUMNS: ClassVar[int] = POWERS + 2

    epoch: Epoch
    orbit: Sequence[float]
    weather: SpaceWeather | str | Path
    orbit_time: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        orbit = tuple(float(value) for value in self.orbit)
        if len(orbit) != 6 or not np.isfinite(orbit).all():
            raise ValueError(f"orbit of a thermosphere is {orbit}; it must be x, y, z, vx, vy, vz at the epoch")
        object.__setattr__(self, "orbit", orbit)
        if not isinstance(self.weather, SpaceWeather):
            object.__setattr__(self, "weather", read_space_weather(self.weather))

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        indices = np.column_stack([self._weather.mjd, self._weather.f107, self._weather.f107_average, self._weather.ap3])
        arc = np.array([*self.orbit, self.orbit_time])
        return checksum("thermosphere", self.epoch.whole, self.epoch.fraction, arc, indices)

    @property
    def _weather(self) -> SpaceWeather:
        assert isinstance(self.weather, SpaceWeather)
        return self.weather

    def at(self, epochs: list[Epoch]) -> Array:
        """The columns at instants, (K, 7)."""
        t = np.array([epoch - self.epoch for epoch in epochs])
        latitude, longitude, height = _geodetic(self._arc(t), epochs)
        if not height.min() > LOWEST:
            t, low = t[np.argmin(height)], height.min() / 1e3
            raise ValueError(f"the arc of the thermosphere comes down to {low:.0f} km at t = {t:.0f} s: give a better orbit")
        given = self._given(epochs, latitude, longitude)
        edges = _log_density(given, height[:, None] + [[-_SPAN, _SPAN]])
        reach = SCALE_HEIGHTS * 2.0 * _SPAN / (edges[:, 0] - edges[:, 1])
        logs = _log_density(given, height[:, None] + reach[:, None] * _NODES)
        powers = np.linalg.lstsq(np.vander(_NODES, POWERS, increasing=True), logs.T, rcond=None)[0].T
        return np.column_stack([powers, height, reach])

    def left(self, t: float, position: Sequence[float]) -> float:
        """By how many scale heights a place (m, GCRF) is off the arc's height; beyond `REMAKE`, make the table anew from it."""
        height = _geodetic(np.array([position], dtype=float), [self.epoch + t])[2][0]
        arc_height, reach = self.value(t)[POWERS:]
        return float((height - arc_height) / reach * SCALE_HEIGHTS)

    def _given(self, epochs: list[Epoch], latitude: Array, longitude: Array) -> tuple[Array, ...]:
        """What the model takes beside heights: date, longitude and latitude (deg), F10.7, its average and ap: K rows."""
        indices = [self._weather.at(epoch) for epoch in epochs]
        dates = [np.datetime64(epoch.to("UTC", digits=3).removesuffix(" UTC").replace(":60", ":59")) for epoch in epochs]
        flux = [i.f107 for i in indices], [i.f107_average for i in indices], [i.ap for i in indices]
        return tuple(np.asarray(a) for a in (dates, np.degrees(longitude), np.degrees(latitude), *flux))

    def _arc(self, t: Array) -> Array:
        """Places of the nominal arc, (K, 3), by cubics through places and velocities a minute apart."""
        t = t - self.orbit_time
        day = np.floor(t / DAY)
        out = np.empty((len(t), 3))
        for k in distinct(day):
            rows = day == k
            states = _day_of_arc(tuple(self.orbit), int(k))
            s = (t[rows] - k * DAY) / _STEP
            i = np.minimum(s.astype(int), len(states) - 2)
            u = (s - i)[:, None]
            a, b = states[i], states[i + 1]
            pull_a, pull_b = a[:, 3:] * _STEP, b[:, 3:] * _STEP
            rise = b[:, :3] - a[:, :3]
            out[rows] = a[:, :3] + u * (pull_a + u * (3 * rise - 2 * pull_a - pull_b + u * (pull_a + pull_b - 2 * rise)))
        return out


def _log_density(given: tuple[Array, ...], heights: Array) -> Array:
    """Logarithm of density (kg/m^3) at K places and several heights (m), (K, heights)."""
    try:
        import pymsis
    except ModuleNotFoundError:
        raise ValueError("drag 'msis' needs pymsis: pip install 'piazzi[msis]'") from None
    dates, longitudes, latitudes, *indices = (np.repeat(a, heights.shape[1], axis=0) for a in given)
    km = np.maximum(heights.ravel() / 1e3, 50.0)
    out = pymsis.calculate(
        dates, longitudes, latitudes, km, *indices, version=VERSION, geomagnetic_activity=-1
    )  # indices are always given: without them it would fetch a file
    return np.asarray(np.log(np.asarray(out, dtype=float)[:, 0]).reshape(heights.shape))


def _geodetic(position: Array, epochs: list[Epoch]) -> tuple[Array, Array, Array]:
    fixed = np.einsum("kij,kj->ki", rotation("GCRF", "ITRF", epochs), position)
    latitude, longitude, height = position_to_geodetic(fixed)
    return latitude, longitude, height


@lru_cache(maxsize=512)
def _day_of_arc(orbit: tuple[float, ...], day: int) -> Array:
    """States a minute apart from the start of a day, counted from the epoch, to its end, (1441, 6)."""
    if day > 0:
        start, step = _day_of_arc(orbit, day - 1)[-1], _STEP
    elif day < -1:
        start, step = _day_of_arc(orbit, day + 1)[0], -_STEP
    else:
        start, step = np.array(orbit), _STEP if day == 0 else -_STEP
    states = [tuple(start.tolist())]
    for _ in range(round(DAY / _STEP)):
        states.append(_runge_kutta(states[-1], step))
    return np.array(states if step > 0.0 else states[::-1])


def _runge_kutta(x: tuple[float, ...], h: float) -> tuple[float, ...]:
    a = _rates(x)
    b = _rates(tuple(p + 0.5 * h * q for p, q in zip(x, a, strict=True)))
    c = _rates(tuple(p + 0.5 * h * q for p, q in zip(x, b, strict=True)))
    d = _rates(tuple(p + h * q for p, q in zip(x, c, strict=True)))
    return tuple(p + h / 6.0 * (k + 2.0 * (m + n) + o) for p, k, m, n, o in zip(x, a, b, c, d, strict=True))


def _rates(state: tuple[float, ...]) -> tuple[float, ...]:
    """Two bodies and the flattening, about the axis of the GCRF."""
    gm, radius, j2 = _shape()
    x, y, z, vx, vy, vz = state
    r2 = x * x + y * y + z * z
    pull, flat, high = -gm / r2**1.5, 1.5 * j2 * radius**2 / r2, 5.0 * z * z / r2
    across = pull * (1.0 + flat * (1.0 - high))
    return vx, vy, vz, across * x, across * y, pull * (1.0 + flat * (3.0 - high)) * z


@lru_cache(maxsize=1)
def _shape() -> tuple[float, float, float]:
    field = gravity_field("EGM2008")
    return field.gm, field.radius, float(-field.c[2, 0] * np.sqrt(5.0))
