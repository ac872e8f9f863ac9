"""Where another satellite is, of which measurements are made: a place that moves along an orbit of two bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.tabulated import DAY, Tabulated, with_rates
from piazzi.model.functions import STATION_TERMS
from piazzi.orbit.two_body import propagate_kepler
from piazzi.outside.evaluation import checksum
from piazzi.outside.pieces import Pieces
from piazzi.text import brief


@dataclass(frozen=True)
class OrbitPlace(Tabulated):
    """Position and velocity of a satellite on the axes of the GCRF (m, m/s): ``(t)`` to six, in place of a station's.

    Parameters
    ----------
    state : position and velocity at t = 0, m and m/s, GCRF
    epoch : the instant of t = 0, that of the problem
    gm : of what it goes about, m^3/s^2
    """

    TERMS: ClassVar[int] = STATION_TERMS
    LENGTH: ClassVar[float] = DAY / 192  # a twelfth of a low orbit's turn
    COLUMNS: ClassVar[int] = 6

    state: tuple[float, ...]
    epoch: Epoch
    gm: float

    __repr__ = brief

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("orbit", *self.state, self.epoch.whole, self.epoch.fraction, self.gm)

    def at(self, epochs: list[Epoch]) -> Array:
        """Positions at instants, (K, 3)."""
        t = np.array([epoch - self.epoch for epoch in epochs])
        return np.asarray(propagate_kepler(np.array(self.state[:3]), np.array(self.state[3:]), self.gm, t)[0])

    def pieces(self, first: float, last: float) -> Pieces:
        """Positions from the day of `first` to that of `last`, and velocities."""
        return with_rates(super().pieces(first, last))
