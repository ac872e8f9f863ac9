"""States from ranges: with directions from one station, and from three stations at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array


def direction(longitude: Any, latitude: Any) -> Array:
    """Unit vectors (..., 3) towards right ascension and declination, or any other pair of such angles, in rad."""
    lon, lat = np.broadcast_arrays(np.asarray(longitude, dtype=float), np.asarray(latitude, dtype=float))
    return np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)


def direction_rate(longitude: Any, latitude: Any, longitude_rate: Any, latitude_rate: Any) -> Array:
    """How fast these unit vectors change, (..., 3), per unit of time of the rates."""
    lon, lat, dlon, dlat = np.broadcast_arrays(
        *(np.asarray(a, dtype=float) for a in (longitude, latitude, longitude_rate, latitude_rate))
    )
    east = np.stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)], -1)
    north = np.stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)], -1)
    return np.asarray((np.cos(lat) * dlon)[..., None] * east + dlat[..., None] * north)


def range_to_state(
    distance: Any, unit: Any, observer: Any, range_rate: Any, unit_rate: Any, observer_velocity: Any
) -> tuple[Array, Array]:
    """Position and velocity (..., 3) from one full radar plot: range and direction with the rates of both.

    Parameters
    ----------
    distance, range_rate : (...) from observer to body
    unit, unit_rate : (..., 3) direction and how it changes (`direction`, `direction_rate`)
    observer, observer_velocity : (..., 3) in the axes of the directions; both inertial, or both fixed to the Earth, where the
        answer is fixed to the Earth too

    Raises
    ------
    ValueError
        Where a range is not positive, a direction has not the length 1, or a rate of it is along it.

    Notes
    -----
    Range, range-rate and direction alone are four numbers of six: without rates of the direction take three plots and `gibbs`
    or `herrick_gibbs`, or two and `lambert`.  Source: Vallado (2013), algorithm 51 (site-track).
    """
    rho, rate = (np.asarray(a, dtype=float)[..., None] for a in (distance, range_rate))
    L, dL = np.asarray(unit, dtype=float), np.asarray(unit_rate, dtype=float)
    if not (rho > 0.0).all():
        raise ValueError(f"range is {rho[~(rho > 0.0)].flat[0]:g}; it must be positive")
    length = np.linalg.norm(L, axis=-1)
    if not (np.abs(length - 1.0) < 1e-9).all():
        raise ValueError(f"a direction has the length {length.flat[np.argmax(np.abs(length - 1.0))]:g}; it must be 1")
    if not (np.abs(np.sum(L * dL, axis=-1)) <= 1e-9 * np.linalg.norm(dL, axis=-1)).all():
        raise ValueError("the rate of a direction has a part along it: a direction keeps its length")
    R, V = np.asarray(observer, dtype=float), np.asarray(observer_velocity, dtype=float)
    return R + rho * L, V + rate * L + rho * dL


def three_ranges(
    ranges: Any, stations: Any, range_rates: Any = None, station_velocities: Any = None
) -> tuple[tuple[Array, Array | None], ...]:
    """Positions (3,), and velocities, from ranges of three stations at one time: the two that are mirrors of each other.

    Parameters
    ----------
    ranges : (3,) distances
    stations : (3, 3) positions
    range_rates : (3,), positive when receding; without, velocities are None
    station_velocities : (3, 3); default at rest

    Returns
    -------
    ((r, v), (r, v)) : first the one on the side of the stations' plane that is away from the centre of the axes

    Raises
    ------
    ValueError
        For another number of stations, stations on one line, or ranges that do not meet.
    """
    rho, R = np.asarray(ranges, dtype=float), np.asarray(stations, dtype=float)
    if rho.shape != (3,) or R.shape != (3, 3):
        two = "two ranges leave a circle of positions; " if rho.shape == (2,) else ""
        raise ValueError(f"{two}ranges have shape {rho.shape} and stations {R.shape}; they must be (3,) and (3, 3)")
    if not (np.isfinite(rho).all() and np.isfinite(R).all() and (rho > 0.0).all()):
        raise ValueError(f"ranges are {rho}; they must be positive, and stations finite")
    a, b = R[1] - R[0], R[2] - R[0]
    n = np.cross(a, b)
    size = np.linalg.norm(n)
    if not size > 1e-12 * np.linalg.norm(a) * np.linalg.norm(b):
        raise ValueError("the three stations are on one line: positions around it are all alike")
    n = n / size * (1.0 if n @ R[0] >= 0.0 else -1.0)
    u = a / np.linalg.norm(a)
    w = np.cross(n, u)
    c, d, e = np.linalg.norm(a), b @ u, b @ w
    x = ((rho[0] - rho[1]) * (rho[0] + rho[1]) + c * c) / (2.0 * c)
    y = ((rho[0] - rho[2]) * (rho[0] + rho[2]) + d * d + e * e - 2.0 * x * d) / (2.0 * e)
    square = rho[0] ** 2 - x * x - y * y
    if square < 0.0:
        raise ValueError(f"the three ranges do not meet: they miss one another by {np.sqrt(-square):.4g}")
    answers: list[tuple[Array, Array | None]] = []
    for height in (np.sqrt(square), -np.sqrt(square)):
        r = R[0] + x * u + y * w + height * n
        answers.append((r, None if range_rates is None else _velocity(r, R, range_rates, station_velocities)))
    return tuple(answers)


def _velocity(r: Array, R: Array, range_rates: Any, station_velocities: Any) -> Array:
    rates = np.asarray(range_rates, dtype=float)
    V = np.zeros((3, 3)) if station_velocities is None else np.asarray(station_velocities, dtype=float)
    if rates.shape != (3,) or V.shape != (3, 3):
        raise ValueError(f"range rates have shape {rates.shape} and velocities {V.shape}; they must be (3,) and (3, 3)")
    L = (r - R) / np.linalg.norm(r - R, axis=1)[:, None]
    if not abs(np.linalg.det(L)) > 1e-12:
        raise ValueError("the body is in the plane of the stations: range rates leave the velocity across it open")
    return np.asarray(np.linalg.solve(L, rates + np.sum(L * V, axis=1)))
