"""What a station sees of an orbit: the sensors of tracking at any times, with what the orbit's covariance makes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.determination.course import Course
from piazzi.determination.sites import oriented, sites_of, station_named
from piazzi.determination.words import pairs, quantity
from piazzi.earth import Epoch, Place, Station, body, rotation, sensors
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.earth.geodetic import ELLIPSOIDS
from piazzi.earth.sensors import Instrument
from piazzi.earth.stations import up_north_east
from piazzi.orbit import propagate_kepler
from piazzi.problem import Problem
from piazzi.problem import Station as Instruments
from piazzi.problem.checks import Array

SUN_RADIUS = 6.957e8  # m, IAU 2015 resolution B3
DIFFERENCE = 1e-4  # of the time in which an orbit turns by a radian: between the two looks of a rate
LONGEST = 60.0  # s, in which the Earth turns by a quarter of a degree
SAMPLES = 120  # states in a turn of the orbit, between which cubics do
LIT = ("sunlit", "penumbra", "umbra")
DIRECTION, MOUNT, RANGE, RATE, FREQUENCY = "sky_direction", "sky_mount", "sky_range", "sky_range_rate", "sky_frequency"
APPARENT = "sky_apparent"
ROUNDS = 4  # of light time, each a ten thousandth of the one before


@lru_cache(maxsize=16)
def instruments(angles: str, axes: str, about: str) -> tuple[Instrument, ...]:
    """Sensors whose rows are dated at the reception: direction, azimuth and elevation, range, range-rate, frequency.

    About the Sun there are directions only, from which `FromTheSun` makes the others.
    """
    direction = sensors.right_ascension_declination(angles, name=DIRECTION, axes=axes, about=about)
    if about == "sun":
        return direction, sensors.right_ascension_declination("apparent", name=APPARENT, about=about)
    return (
        direction,
        sensors.azimuth_elevation(name=MOUNT),
        sensors.range("one-way", name=RANGE, relativity=True),
        sensors.range_rate("one-way", name=RATE),
        sensors.frequency(1.0, name=FREQUENCY, parameters=()),
    )


@dataclass(frozen=True, eq=False)
class Observer:
    """A station that looks at an orbit.

    Attributes
    ----------
    course, station : what is seen from where
    problem : the forces of the orbit, which light time needs, with the sensors
    frequency : that the satellite sends at, Hz; NaN for none
    """

    course: Course
    station: Station
    problem: Problem
    frequency: float

    def measure(self, sensor: str, t: Array, states: Array) -> Array:
        """What a sensor measures of states (K, 6), (K, m)."""
        return self.problem.measure(sensor, self._whole(states), t)

    def mount_between(self, t: Array) -> Callable[[Array], Array]:
        """Azimuth and elevation (K, 2) as a function of times, by cubics through the states at increasing times (K,).

        With `SAMPLES` of them in a turn a cubic is within decimetres.
        """
        states = self.course.beliefs(t)[0]
        r, v = states[:, :3], states[:, 3:]

        def mount(at: Array) -> Array:
            k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
            h = (t[k + 1] - t[k])[:, None]
            s = (at - t[k])[:, None] / h
            step, mean = r[k + 1] - r[k], h * (v[k] + v[k + 1])
            bend, twist = 3.0 * step - mean - h * v[k], mean - 2.0 * step
            place = r[k] + s * (h * v[k] + s * (bend + s * twist))
            speed = v[k] + (s / h) * (2.0 * bend + 3.0 * s * twist)
            return self.measure(MOUNT, at, np.hstack([place, speed]))

        return mount

    def _whole(self, states: Array) -> Array:
        out = np.tile(self.problem.mean, (len(states), 1))
        out[:, :6] = states
        return out

    def spread(self, t: Array, states: Array, P: Array) -> Array:
        """Covariances (K, 2, 2) of the direction on the sky: to the east and to the north."""
        H = self.problem.measurement_jacobian(DIRECTION, self._whole(states), t)[:, :, :6].copy()
        H[:, 0] *= np.cos(self.measure(DIRECTION, t, states)[:, 1])[:, None]
        return np.asarray(H @ P @ np.swapaxes(H, 1, 2))


@dataclass(frozen=True, eq=False)
class FromTheSun(Observer):
    """A station that looks at an orbit about the Sun."""

    def measure(self, sensor: str, t: Array, states: Array) -> Array:
        """What a sensor measures of states (K, 6) from the Sun, (K, m)."""
        if sensor == MOUNT:
            return self._mount(t, super().measure(APPARENT, t, states))
        if sensor not in (RANGE, RATE):
            return super().measure(sensor, t, states)
        line, speed, late = self._line(t, states)
        distance = np.linalg.norm(line, axis=1)
        if sensor == RANGE:
            return np.asarray(distance[:, None])
        u = line / distance[:, None]
        along, own = np.sum(u * late, axis=1), np.sum(u * speed, axis=1)
        return np.asarray(((along - own) / (1.0 + along / SPEED_OF_LIGHT))[:, None])

    def _line(self, t: Array, states: Array) -> tuple[Array, Array, Array]:
        """The line (K, 3) that light came along, the velocity of the station, and that of the body when it sent it."""
        place = Place(self.station, self.course.epoch, about="sun")
        here, speed = np.split(np.array([place.value(float(x)) for x in t]), 2, axis=1)
        delay = np.zeros(len(t))
        for _ in range(ROUNDS):
            r, v = propagate_kepler(states[:, :3], states[:, 3:], self.course.centre.mu, -delay)
            delay = np.linalg.norm(r - here, axis=1) / SPEED_OF_LIGHT
        return np.asarray(r - here), speed, v

    def _mount(self, t: Array, apparent: Array) -> Array:
        """Azimuth and elevation (K, 2) of apparent directions, without refraction."""
        epochs = [self.course.epoch + float(x) for x in t]
        lon, lat = apparent.T
        u = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)
        axes = up_north_east(self.station.position(epochs))
        local = (axes @ rotation("GCRF", "ITRF", epochs) @ u[..., None])[..., 0]
        return np.stack([np.arctan2(local[:, 2], local[:, 1]), np.arcsin(np.clip(local[:, 0], -1.0, 1.0))], -1)


def observer(course: Course, station: Station, *, angles: str, axes: str, frequency: float | None) -> Observer:
    """The observer of an orbit; raises ValueError for angles or axes that there are not."""
    about = course.centre.name
    if about == "sun" and frequency is not None:
        raise ValueError("frequency is that of a satellite of the Earth, and the orbit goes about the Sun")
    own, epoch, base = instruments(angles, axes, about), course.epoch, course.problem
    needed = {name: value for sensor in own for name, value in sensor.functions(epoch).items()}
    signatures = {name: value for sensor in own for name, value in sensor.signatures.items()}
    model = replace(base.model, sensors=own, functions={**dict(base.model.functions), **signatures})
    sent = 1.0 if frequency is None else frequency
    told: dict[str, dict[str, Any]] = {FREQUENCY: {"carrier": sent - 1.0}}
    if about == "sun":
        told = {name: {"place": Place(station, epoch, about="sun")} for name in (DIRECTION, APPARENT)}
    places = [
        sensor.at(None if about == "sun" else station, epoch, 1.0, name=sensor.name, **told.get(sensor.name, {}))
        for sensor in own
    ]
    eop = getattr(base.functions.get("fixed"), "eop", None)
    stations = [Instruments(**{**place, "place": oriented(place.get("place"), eop)}) for place in places]
    needed = {name: oriented(data, eop) for name, data in needed.items()}
    problem = replace(base, model=model, stations=stations, functions={**base.functions, **needed})
    kind = FromTheSun if about == "sun" else Observer
    return kind(course, station, problem, np.nan if frequency is None else frequency)


def seen(given: Observer, t: Array) -> dict[str, Array]:
    """Columns (K,) of what is seen at times, SI and radians, by name."""
    states, P = given.course.beliefs(t)
    direction, mount = given.measure(DIRECTION, t, states), given.measure(MOUNT, t, states)
    epochs = [given.course.epoch + float(x) for x in t]
    east, north = _motion(given, t, states)
    sun, moon = (elevation_of(name, given.station, epochs) for name in ("sun", "moon"))
    out = {
        "right_ascension": direction[:, 0] % (2.0 * np.pi), "declination": direction[:, 1],
        "azimuth": mount[:, 0] % (2.0 * np.pi), "elevation": mount[:, 1],
        "range": given.measure(RANGE, t, states)[:, 0], "range_rate": given.measure(RATE, t, states)[:, 0],
        "rate": np.hypot(east, north), "position_angle": np.arctan2(east, north) % (2.0 * np.pi),
        "sun_elevation": sun, "moon_elevation": moon,
    }  # fmt: skip
    if given.course.centre.name == "sun":
        out["elongation"] = elongation(states[:, :3], epochs)
    else:
        out["shadow"] = shadow(states[:, :3], epochs)
    if np.isfinite(given.frequency):
        out["frequency"] = given.measure(FREQUENCY, t, states)[:, 0]
    if P is not None:
        out |= _ellipse(given.spread(t, states, P))
        along = states[:, 3:] / np.linalg.norm(states[:, 3:], axis=1, keepdims=True)
        variance = np.einsum("ki,kij,kj->k", along, P[:, :3, :3], along)
        out["along_track_sigma"] = np.sqrt(np.maximum(variance, 0.0)) / np.linalg.norm(states[:, 3:], axis=1)
    return out


def _motion(given: Observer, t: Array, states: Array) -> tuple[Array, Array]:
    """Rates of the direction to the east and to the north, rad/s: by two looks, at the same orbit a little later and before."""
    r, v = states[:, :3], states[:, 3:]
    distance = np.linalg.norm(r, axis=1, keepdims=True)
    mu = given.course.centre.mu
    h = min(DIFFERENCE * float(np.sqrt(distance.min() ** 3 / mu)), LONGEST)
    pull = -mu * r / distance**3  # the same before and after: what it lacks leaves the difference as it is
    before, after = (given.measure(DIRECTION, t + s, np.hstack([r + s * v + s * s / 2 * pull, v + s * pull])) for s in (-h, h))
    turned = (after[:, 0] - before[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
    return turned * np.cos((after[:, 1] + before[:, 1]) / 2) / (2 * h), (after[:, 1] - before[:, 1]) / (2 * h)


def _ellipse(spread: Array) -> dict[str, Array]:
    """Semi-axes of three sigma, and the position angle of the longer one from north through east."""
    values, vectors = np.linalg.eigh(spread)
    axes = 3.0 * np.sqrt(np.maximum(values, 0.0))
    longest = vectors[:, :, 1]
    return {
        "ellipse_major": axes[:, 1], "ellipse_minor": axes[:, 0],
        "ellipse_position_angle": np.arctan2(longest[:, 0], longest[:, 1]) % np.pi,
    }  # fmt: skip


def elevation_of(name: str, station: Station, epochs: Sequence[Epoch]) -> Array:
    """Elevation (K,) of the Sun or the Moon at a station, without refraction."""
    here = station.position(epochs)
    turned = rotation("GCRF", "ITRF", epochs) @ body(name, epochs)[0][..., None]
    line = turned[..., 0] - here
    up = up_north_east(here)[..., 0, :]
    return np.asarray(np.arcsin(np.sum(line * up, axis=-1) / np.linalg.norm(line, axis=-1)))


def elongation(position: Array, epochs: Sequence[Epoch]) -> Array:
    """Angles (K,) between the Sun and positions (K, 3) from it, seen from the centre of the Earth."""
    here = body("earth", epochs, "sun")[0]
    line = position - here
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(line, -here), axis=1), -np.sum(line * here, axis=1)))


def shadow(position: Array, epochs: Sequence[Epoch]) -> Array:
    """Places (K,) in `LIT`: whether the Earth, a sphere, hides nothing, a part or all of the Sun from positions (K, 3)."""
    to_sun = body("sun", epochs)[0] - position
    distance, away = np.linalg.norm(position, axis=1), np.linalg.norm(to_sun, axis=1)
    cosine = -np.sum(position * to_sun, axis=1) / (distance * away)
    apart = np.arccos(np.clip(cosine, -1.0, 1.0))
    earth, sun = np.arcsin(np.minimum(ELLIPSOIDS["WGS84"][0] / distance, 1.0)), np.arcsin(SUN_RADIUS / away)
    return np.where(apart >= earth + sun, 0, np.where(apart >= earth - sun, 1, 2))


def where(name: Any, places: Any) -> Station:
    """The station by its name, or ``"lat=50.1deg lon=8.6deg height=100m"``; raises ValueError where there is none."""
    if isinstance(name, Station):
        return name
    if "=" in name:
        example = '"lat=50.1deg lon=8.6deg height=100m"'
        found = pairs(name, "--from", ("lat", "lon", "height", "mask"), example)
        if not {"lat", "lon"} <= {*found}:
            raise ValueError(f"--from {name!r}: a place has lat and lon, as in {example}")
        latitude, longitude = (quantity(found[key], "deg", f"--from: {key}") for key in ("lat", "lon"))
        height, mask = (quantity(found.get(k, f"0{u}"), u, f"--from: {k}") for k, u in (("height", "m"), ("mask", "deg")))
        if abs(latitude) > np.pi / 2:
            raise ValueError(f"--from: lat is {found['lat']}; it lies between -90deg and 90deg")
        return Station.geodetic("place", latitude, longitude, height, mask=mask)
    return station_named(name, sites_of(places if places else "ilrs"))
