"""Rows of tracking as vectors without light time, media and biases: what two-body fits of unknown orbits start from.

What a sensor adds to plain geometry hardly depends on the orbit.  It is taken from the sensor itself: where it would see a body
that stands still along the measured direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.earth import Epoch
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.earth.geodetic import position_to_geodetic
from piazzi.earth.rotation import rotation
from piazzi.earth.sensors.position import Turn
from piazzi.earth.sensors.turning import barycentric_velocity
from piazzi.model import Sensor
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, RATE, Rows
from piazzi.problem import Problem, Station, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import wrapped

FAR = 1e7  # m: where a body is put to ask a sensor what it adds
PLACES = (("position_x", "position_y", "position_z"), ("px", "py", "pz"))
PAIRS = (("azimuth", "elevation"), ("x_east", "y_north"), ("x_south", "y_east"), ("right_ascension", "declination"))
ROUNDS = 3
MOST_ROWS = 600  # of a station
LONG = 60 * 86400.0  # s: of rows spread more thinly each instant is worked out by itself


@dataclass(frozen=True, eq=False)
class Sights:
    """Who measured, and with what; `problem` is asked what its sensors add to geometry, None where it is not whole yet."""

    sensors: Sequence[Sensor]
    stations: Sequence[Station]
    epoch: Epoch
    problem: Problem | None = None

    def sensor(self, station: Station) -> Sensor:
        """That of a station."""
        return next(s for s in self.sensors if s.name == station.sensor)


def rows_of(problem: Problem, tracking: Tracking) -> tuple[Rows, Array]:
    """At most `MOST_ROWS` of each station as vectors, and for each the row of the tracking.

    Raises
    ------
    ValueError
        Where no sensor measures a distance, its rate, a direction or a position.
    """
    given = Sights(problem.model.sensors, problem.stations, problem.epoch, problem)
    return _joined(given, tracking, tracking.stations_of(problem))


def plain_rows(sensors: Sequence[Sensor], stations: Sequence[Station], epoch: Epoch, tracking: Tracking) -> tuple[Rows, Array]:
    """The same by geometry alone: axes and the annual aberration are taken out, air and biases are left in."""
    places = {station.name: s for s, station in enumerate(stations)}
    which = np.array([places[name] for name in tracking.row_stations])
    return _joined(Sights(sensors, stations, epoch), tracking, which)


def _joined(given: Sights, tracking: Tracking, which: Array) -> tuple[Rows, Array]:
    t, z = tracking.row_times, tracking.values
    found: list[tuple[Rows, Array]] = []
    for s, station in enumerate(given.stations):
        own = np.flatnonzero(which == s)
        if len(own) > MOST_ROWS:
            own = own[distinct(np.linspace(0, len(own) - 1, MOST_ROWS).astype(int))]
        if len(own):
            found += _of_station(given, station, t[own], z[own], own)
    if not found:
        sensors = ", ".join(s.name for s in given.sensors)
        raise ValueError(
            f"no sensor ({sensors}) measures distances, their rates, directions or positions: give an orbit to begin"
        )
    rows = [r for r, _ in found]
    names = ("t", "kind", "observer", "observer_velocity", "value", "sigma", "across", "shared")
    joined = Rows(**{name: np.concatenate([getattr(r, name) for r in rows]) for name in names})
    return joined, np.concatenate([j for _, j in found])


def _of_station(given: Sights, station: Station, t: Array, z: Array, own: Array) -> list[tuple[Rows, Array]]:
    sensor = given.sensor(station)
    at = {name: i for i, name in enumerate(sensor.components)}
    noise = np.asarray(station.noise)
    variance = np.diag(noise) if noise.ndim == 2 else noise
    sigma = np.sqrt(variance)
    for place in PLACES:
        if set(place) <= set(at):
            return _fixes(given.problem, station, t, z, own, [at[p] for p in place], sigma)
    if station.place is None:
        return []
    stands, velocity = observers(given.epoch, station, t)
    out: list[tuple[Rows, Array]] = []
    pair = next((p for p in PAIRS if set(p) <= set(at)), None)
    u = _directions(given, station, t, z, stands, pair, [at[p] for p in pair]) if pair else None
    if u is not None and pair is not None:
        i, j = (at[p] for p in pair)
        east, _ = _frame(u, _pole(given, station, t, pair), pair)
        on_sky = pair[0] in dict(getattr(sensor, "on_sky", ()) or ())
        first = np.full(len(t), sigma[i]) * (1.0 if on_sky else np.abs(np.cos(z[:, j])))
        out.append(_rows(DIRECTION, t, stands, velocity, u, np.stack([first, np.full(len(t), sigma[j])], -1), own, east))
    if "range" in at:
        up = stands / np.linalg.norm(stands, axis=1)[:, None]
        along = up if u is None else np.where(np.isfinite(u).all(axis=1, keepdims=True), u, up)
        i = at["range"]
        added = np.zeros(len(t))
        if given.problem is not None:
            state = _states(given.problem, stands + z[:, i : i + 1] * along)
            added = given.problem.measure(station.name, np.nan_to_num(state), t)[:, i] - z[:, i]
        value = np.zeros((len(t), 3))
        value[:, 0] = z[:, i] - np.where(np.abs(added) < 1e3, added, 0.0)
        out.append(_rows(RANGE, t, stands, velocity, value, np.full((len(t), 2), sigma[i]), own))
    for name in ("range_rate", "frequency", "returned_frequency"):
        if name in at:
            rate, scale, shared = _rates(station, name, t, z[:, at[name]])
            value = np.zeros((len(t), 3))
            value[:, 0] = rate
            rows, which = _rows(RATE, t, stands, velocity, value, np.full((len(t), 2), scale * sigma[at[name]]), own)
            out.append((replace(rows, shared=np.full(len(t), shared)), which))
    return [(rows.of(keep), own[keep]) for rows, keep in ((r, np.isfinite(r.value).all(axis=1)) for r, _ in out) if keep.any()]


def _rates(station: Station, name: str, t: Array, z: Array) -> tuple[Array, float, float]:
    """Range-rates that measurements mean, how many m/s a unit of these is, and 1 where they share an unknown constant.

    Of a frequency that the satellite sends the carrier is known to a millionth, which is hundreds of m/s.
    """
    if name == "range_rate":
        return z, 1.0, 0.0
    if name == "frequency":
        sent = float(np.nanmedian(z))
        return SPEED_OF_LIGHT * (1.0 - z / sent), SPEED_OF_LIGHT / sent, 1.0
    known: Any = station.numbers
    sent = known["turnaround"] * (known["transmit_frequency"] + known["transmit_rate"] * (t - known["since"]))
    scale = SPEED_OF_LIGHT / 2.0
    return scale * (1.0 - z / sent), scale / float(np.median(sent)), 0.0


def _rows(
    kind: int, t: Array, place: Array, velocity: Array, value: Array, sigma: Array, own: Array, across: Array | None = None
) -> tuple[Rows, Array]:
    J = len(t)
    return Rows(
        t=t, kind=np.full(J, float(kind)), observer=place, observer_velocity=velocity, value=value, sigma=sigma,
        across=np.tile([1.0, 0.0, 0.0], (J, 1)) if across is None else across, shared=np.zeros(J),
    ), own  # fmt: skip


def _fixes(
    problem: Problem | None, station: Station, t: Array, z: Array, own: Array, at: list[int], sigma: Array
) -> list[tuple[Rows, Array]]:
    """Positions on the axes of the problem: what the sensor makes of a body at the centre plus what was measured, undone."""
    keep = np.isfinite(z[:, at]).all(axis=1)
    if not keep.any():
        return []
    t, z, own = t[keep], z[keep], own[keep]
    nothing = np.zeros((len(t), 3))
    if problem is None:
        return [_rows(POSITION, t, nothing, nothing, z[:, at], np.full((len(t), 2), float(np.max(sigma[at]))), own)]
    columns = [problem.measure(station.name, _states(problem, np.tile(FAR * e, (len(t), 1))), t)[:, at] for e in np.eye(3)]
    turn = np.stack(columns, axis=-1) / FAR
    value = np.linalg.solve(turn, z[:, at][..., None])[..., 0]
    return [_rows(POSITION, t, nothing, nothing, value, np.full((len(t), 2), float(np.max(sigma[at]))), own)]


def observers(epoch: Epoch, station: Station, t: Array) -> tuple[Array, Array]:
    """Position and velocity (K, 3) of a station on the axes of the problem."""
    recipe: Any = station.place
    if not hasattr(recipe, "at"):  # in orbit: a table of both
        found = np.array([recipe.value(float(x)) for x in t])
        return found[:, :3], found[:, 3:]
    if len(t) and hasattr(recipe, "pieces") and np.ptp(t) < LONG:  # by the table that kernels will read
        found = recipe.arrays(t)
        return found[:, :3], found[:, 3:]
    half = 0.5
    before, here, after = (recipe.at([epoch + float(v) for v in t + shift]) for shift in (-half, 0.0, half))
    return here, (after - before) / (2 * half)


def _directions(
    given: Sights, station: Station, t: Array, z: Array, place: Array, pair: tuple[str, str], at: list[int]
) -> Array:
    """Unit vectors (K, 3) along which the sensor measures what was measured; NaN where nothing was."""
    good = np.isfinite(z[:, at]).all(axis=1)
    out = np.full((len(t), 3), np.nan)
    if not good.any():
        return out
    t, z, place = t[good], z[good], place[good]
    lon, lat = z[:, at[0]], z[:, at[1]]
    if pair[0] == "right_ascension":
        u = _from_the_equator(given, station, t, lon, lat)
    else:
        u = _from_horizon(given, station, t, lon, lat, pair)
    problem = given.problem
    if problem is None:
        out[good] = u
        return out
    which, pole = np.full(len(t), problem.station_index(station.name)), _pole(given, station, t, pair)
    for _ in range(ROUNDS):
        seen = problem.measure(station.name, _states(problem, place + FAR * u), t)
        full = np.full_like(z, np.nan)
        full[:, : seen.shape[1]] = z[:, : seen.shape[1]] - seen
        off = wrapped(problem, which, full)[:, at]
        east, north = _frame(u, pole, pair)
        u = u + (off[:, :1] * np.cos(lat)[:, None]) * east + off[:, 1:] * north
        u /= np.linalg.norm(u, axis=1)[:, None]
    out[good] = u
    return out


def _from_the_equator(given: Sights, station: Station, t: Array, lon: Array, lat: Array) -> Array:
    """Directions on the axes of the GCRF, as one who moves with the Earth, or about the Sun stands still, sees them."""
    u = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)
    epochs = [given.epoch + float(v) for v in t]
    makers = dict(getattr(given.sensor(station), "makers", ()))
    for maker in makers.values():
        if isinstance(maker, Turn):
            u = (rotation(maker.frame, "GCRF", epochs) @ u[..., None])[..., 0]
    if "earth_velocity" in makers:  # to first order: 1e-8 rad are left
        u = u + barycentric_velocity(epochs) / SPEED_OF_LIGHT
    return np.asarray(u / np.linalg.norm(u, axis=1)[:, None])


def _from_horizon(given: Sights, station: Station, t: Array, first: Array, second: Array, pair: tuple[str, str]) -> Array:
    """Directions on the axes of the GCRF: azimuths go from north through east and up, other mounts from the zenith."""
    turn, (east, north, up) = _horizon(given, station, t)
    begin, towards, pole = {"azimuth": (north, east, up), "x_east": (up, east, north), "x_south": (up, -north, east)}[pair[0]]
    local = (
        (np.cos(second) * np.sin(first))[:, None] * towards
        + (np.cos(second) * np.cos(first))[:, None] * begin
        + np.sin(second)[:, None] * pole
    )
    return np.asarray((turn @ local[..., None])[..., 0])


def _horizon(given: Sights, station: Station, t: Array) -> tuple[Array, tuple[Array, Array, Array]]:
    """Matrices (K, 3, 3) from the axes of the Earth to those of the problem, and east, north and up at the station."""
    recipe: Any = station.place
    epochs = [given.epoch + float(v) for v in t]
    latitude, longitude, _ = position_to_geodetic(recipe.station.position(epochs[:1])[0])
    c, s, cl, sl = np.cos(longitude), np.sin(longitude), np.cos(latitude), np.sin(latitude)
    axes = np.array([-s, c, 0.0]), np.array([-sl * c, -sl * s, cl]), np.array([cl * c, cl * s, sl])
    return rotation("ITRF", "GCRF", epochs, recipe.eop), axes


def _pole(given: Sights, station: Station, t: Array, pair: tuple[str, str]) -> Array:
    """Unit vectors (K, 3) towards which the second angle grows."""
    if pair[0] == "right_ascension":
        return np.tile([0.0, 0.0, 1.0], (len(t), 1))
    turn, (east, north, up) = _horizon(given, station, t)
    return np.asarray(turn @ {"azimuth": up, "x_east": north, "x_south": east}[pair[0]])


def _frame(u: Array, pole: Array, pair: tuple[str, str]) -> tuple[Array, Array]:
    """Unit vectors (K, 3) along which the first angle and the second grow."""
    first = np.cross(u, pole) if pair[0] == "azimuth" else np.cross(pole, u)
    first = first / np.maximum(np.linalg.norm(first, axis=1)[:, None], 1e-12)
    second = pole - np.sum(pole * u, axis=1)[:, None] * u
    return first, np.asarray(second / np.maximum(np.linalg.norm(second, axis=1)[:, None], 1e-12))


def _states(problem: Problem, position: Array) -> Array:
    """States (K, n) at rest there, constants at their means."""
    out = np.tile(problem.mean, (len(position), 1))
    out[:, :3], out[:, 3:6] = position, 0.0
    return out
