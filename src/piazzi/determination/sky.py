"""Where an orbit about the Sun is seen on the sky, with the ellipse of its covariance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.determination.orbit import Orbit
from piazzi.earth import Epoch, Place, Station
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.orbit import propagate_kepler
from piazzi.problem.checks import Array

ROUNDS = 4  # of light time, each a ten thousandth of the one before


@dataclass(frozen=True, eq=False)
class Sight:
    """An astrometric place.

    Attributes
    ----------
    epoch : of reception
    right_ascension, declination : rad, on the axes of the ICRF
    distance : m, that light went
    covariance : (2, 2), rad^2, along the circle of declination eastwards (on the sky) and northwards
    """

    epoch: Epoch
    right_ascension: float
    declination: float
    distance: float
    covariance: Array

    def off(self, right_ascension: float, declination: float) -> Array:
        """Another place seen from this one (2,), rad on the sky: east and north."""
        ours, east, north = _axes(self.right_ascension, self.declination)
        there, _, _ = _axes(right_ascension, declination)
        flat = np.array([east @ there, north @ there])
        size = float(np.linalg.norm(flat))
        return flat * (np.arctan2(size, ours @ there) / size) if size else flat

    def chi_square(self, right_ascension: float, declination: float) -> float:
        """Squared distance of another place in sigma: it is inside the ellipse of 95 % below 5.99."""
        off = self.off(right_ascension, declination)
        return float(off @ np.linalg.solve(self.covariance, off))


def sight(orbit: Orbit, epoch: Any, station: Station | None = None) -> Sight:
    """The place of an orbit about the Sun, at a date of reception, from a station or from the centre of the Earth.

    The covariance is that of sigma points of the orbit where it stands (Julier and Uhlmann 2004, Proceedings of the IEEE 92,
    401), which a path that bends over a wide ellipse is in; what two bodies do to them is added to the orbit itself.
    """
    when, own = Epoch(epoch), orbit.to(orbit.centre.frame)
    here = Place(station, when, about="sun").at([when])[0]
    delay = 0.0
    for _ in range(ROUNDS):
        line = own.at(when + -delay)[:3] - here
        delay = float(np.linalg.norm(line)) / SPEED_OF_LIGHT
    distance = float(np.linalg.norm(line))
    right_ascension = float(np.arctan2(line[1], line[0])) % (2 * np.pi)
    declination = float(np.arcsin(line[2] / distance))
    centre = Sight(when, right_ascension, declination, distance, np.zeros((2, 2)))
    spread = _spread(own, (when - orbit.epoch) - delay)
    off = np.array([centre.off(*_angles(line + one)) for one in spread])
    return replace(centre, covariance=off.T @ off / len(off))


def _spread(own: Orbit, dt: float) -> Array:
    """By how much (12, 3) sigma points are off the orbit a time after its epoch."""
    mean, root = own.at(), own.root() * np.sqrt(6.0)
    points = mean + np.vstack([root.T, -root.T])
    mu = own.centre.mu
    there = propagate_kepler(points[:, :3], points[:, 3:], mu, dt)[0]
    return np.asarray(there - propagate_kepler(mean[:3], mean[3:], mu, dt)[0])


def _angles(line: Array) -> tuple[float, float]:
    return float(np.arctan2(line[1], line[0])), float(np.arcsin(line[2] / np.linalg.norm(line)))


def _axes(right_ascension: float, declination: float) -> tuple[Array, Array, Array]:
    """Unit vectors towards a place, east and north there."""
    c, s, cd, sd = np.cos(right_ascension), np.sin(right_ascension), np.cos(declination), np.sin(declination)
    return np.array([cd * c, cd * s, sd]), np.array([-s, c, 0.0]), np.array([-sd * c, -sd * s, cd])
