"""How fast axes turn, and how fast the Earth moves, as functions of time."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.epoch import Epoch
from piazzi.earth.rotation import frame_named, rotation_rate
from piazzi.earth.scales import Orientation
from piazzi.earth.tabulated import DAY, Tabulated, orientation_key
from piazzi.outside.evaluation import checksum


@dataclass(frozen=True)
class Spin(Tabulated):
    """Angular velocity of axes, rad/s along the axes of the GCRF.

    Parameters
    ----------
    frame : whose axes
    epoch : the instant of t = 0, that of the problem
    eop : orientation of the Earth; default the tables of the IERS
    """

    LENGTH: ClassVar[float] = DAY / 12

    frame: str
    epoch: Epoch
    eop: Orientation | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "frame", frame_named(self.frame))

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("spin", self.frame, self.epoch.whole, self.epoch.fraction, orientation_key(self.eop))

    def at(self, epochs: list[Epoch]) -> Array:
        """At instants, (K, 3)."""
        R, rate = rotation_rate("GCRF", self.frame, epochs, self.eop)
        W = np.swapaxes(rate, -1, -2) @ R  # d(R^T)/dt R = omega x
        return np.stack([W[..., 2, 1], W[..., 0, 2], W[..., 1, 0]], -1)


@dataclass(frozen=True)
class EarthVelocity(Tabulated):
    """Velocity of the Earth about the Sun's system, m/s along the axes of the GCRF.

    Parameters
    ----------
    epoch : the instant of t = 0, that of the problem
    """

    epoch: Epoch

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("earth velocity", self.epoch.whole, self.epoch.fraction)

    def at(self, epochs: list[Epoch]) -> Array:
        """At instants, (K, 3)."""
        return barycentric_velocity(epochs)


def barycentric_velocity(epochs: list[Epoch]) -> Array:
    """Velocity of the Earth seen from the barycentre of the solar system, (K, 3), m/s."""
    import erfa

    one, two = np.array([epoch.jd("TDB") for epoch in epochs]).T
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", erfa.ErfaWarning)  # of dates before 1900: 1801 is good to mm/s, as `bodies` has it
        pv = erfa.epv00(one, two)[1]
    return np.asarray(pv["v"]) * (149597870700.0 / DAY)
