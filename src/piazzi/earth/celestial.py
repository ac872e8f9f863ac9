"""Tables over time of what the forces about the Sun, and of the Sun on the Earth's axes, need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.bodies import asteroid, body
from piazzi.earth.constants import GM, SPEED_OF_LIGHT
from piazzi.earth.epoch import Epoch
from piazzi.earth.tabulated import Tabulated, in_tdb
from piazzi.outside.evaluation import checksum


@dataclass(frozen=True)
class Asteroid(Tabulated):
    """Where an asteroid is seen from the Sun, m on the axes of the ICRF, over seconds of TDB: ``(t)`` to three.

    Parameters
    ----------
    number : of the minor planet
    epoch : the instant of t = 0, that of the problem
    kernel : of JPL, that has it
    """

    number: int
    epoch: Epoch
    kernel: str | Path

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("asteroid", self.number, str(self.kernel), self.epoch.whole, self.epoch.fraction)

    def at(self, epochs: list[Epoch]) -> Array:
        """Positions at instants, (K, 3)."""
        return asteroid(self.number, in_tdb(self.epoch, epochs), self.kernel)


@dataclass(frozen=True)
class GeodesicPrecession(Tabulated):
    """The rate (rad/s) at which the Sun's field turns axes that go with the Earth, along those of the GCRF: ``(t)`` to three.

    Parameters
    ----------
    epoch : the instant of t = 0, that of the problem
    """

    epoch: Epoch

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("geodesic", self.epoch.whole, self.epoch.fraction)

    def at(self, epochs: list[Epoch]) -> Array:
        """Rates at instants, (K, 3); eq. 10.12 of the IERS Conventions 2010."""
        sun, velocity = body("sun", epochs)
        size = 1.5 * GM["sun"] / SPEED_OF_LIGHT**2 / np.linalg.norm(sun, axis=-1, keepdims=True) ** 3
        return np.asarray(-size * np.cross(velocity, sun))  # the Earth's place and velocity have both signs turned
