"""What tides change in the coefficients of degree 2, over time: the part that depends on frequency, and the tide of the pole.

IERS Conventions 2010, 6.2.1 (eqs. 6.6 to 6.8, Tables 6.3 and 6.5) and 6.4 (eq. 6.22), with the secular pole of their update of
2018.  The tide that the forces have as text has one Love number; here is what Love numbers of the other orders, their imaginary
parts and the lines near to the free core nutation (K1 and its neighbours) add to it.  Degrees 3 and 4 are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.bodies import body
from piazzi.earth.constants import GM, LOVE_K2, LOVE_K21, LOVE_K22
from piazzi.earth.eop import tables
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.rotation import rotation
from piazzi.earth.scales import Orientation
from piazzi.earth.tabulated import DAY, Tabulated, orientation_key
from piazzi.earth.tides import RADIUS, wobble
from piazzi.outside.evaluation import checksum

# Tables 6.5b, a, c: multiples of the arguments l, l', F, D, Omega; then 1e-12 in phase and out of phase
_ZONAL = np.array([
    [0, 0, 0, 0, 1, 16.6, -6.7], [0, 0, 0, 0, 2, -0.1, 0.1], [0, -1, 0, 0, 0, -1.2, 0.8], [0, 0, -2, 2, -2, -5.5, 4.3],
    [0, 0, -2, 2, -1, 0.1, -0.1], [0, -1, -2, 2, -2, -0.3, 0.2], [1, 0, 0, -2, 0, -0.3, 0.7], [-1, 0, 0, 0, -1, 0.1, -0.2],
    [-1, 0, 0, 0, 0, -1.2, 3.7], [-1, 0, 0, 0, 1, 0.1, -0.2], [1, 0, -2, 0, -2, 0.1, -0.2], [0, 0, 0, -2, 0, 0, 0.6],
    [-2, 0, 0, 0, 0, 0, 0.3], [0, 0, -2, 0, -2, 0.6, 6.3], [0, 0, -2, 0, -1, 0.2, 2.6], [0, 0, -2, 0, 0, 0, 0.2],
    [1, 0, -2, -2, -2, 0.1, 0.2], [-1, 0, -2, 0, -2, 0.4, 1.1], [-1, 0, -2, 0, -1, 0.2, 0.5], [0, 0, -2, -2, -2, 0.1, 0.2],
    [-2, 0, -2, 0, -2, 0.1, 0.1],
])  # fmt: skip
_DIURNAL = np.array([
    [2, 0, 2, 0, 2, -0.1, 0], [0, 0, 2, 2, 2, -0.1, 0], [1, 0, 2, 0, 1, -0.1, 0], [1, 0, 2, 0, 2, -0.7, 0.1],
    [-1, 0, 2, 2, 2, -0.1, 0], [0, 0, 2, 0, 1, -1.3, 0.1], [0, 0, 2, 0, 2, -6.8, 0.6], [0, 0, 0, 2, 0, 0.1, 0],
    [1, 0, 2, -2, 2, 0.1, 0], [-1, 0, 2, 0, 1, 0.1, 0], [-1, 0, 2, 0, 2, 0.4, 0], [1, 0, 0, 0, 0, 1.3, -0.1],
    [1, 0, 0, 0, 1, 0.3, 0], [-1, 0, 0, 2, 0, 0.3, 0], [-1, 0, 0, 2, 1, 0.1, 0], [0, 1, 2, -2, 2, -1.9, 0.1],
    [0, 0, 2, -2, 1, 0.5, 0], [0, 0, 2, -2, 2, -43.4, 2.9], [0, -1, 2, -2, 2, 0.6, 0], [0, 1, 0, 0, 0, 1.6, -0.1],
    [-2, 0, 2, 0, 1, 0.1, 0], [0, 0, 0, 0, -2, 0.1, 0], [0, 0, 0, 0, -1, -8.8, 0.5], [0, 0, 0, 0, 0, 470.9, -30.2],
    [0, 0, 0, 0, 1, 68.1, -4.6], [0, 0, 0, 0, 2, -1.6, 0.1], [-1, 0, 0, 1, 0, 0.1, 0], [0, -1, 0, 0, -1, -0.1, 0],
    [0, -1, 0, 0, 0, -20.6, -0.3], [0, 1, -2, 2, -2, 0.3, 0], [0, -1, 0, 0, 1, -0.3, 0], [-2, 0, 0, 2, 0, -0.2, 0],
    [-2, 0, 0, 2, 1, -0.1, 0], [0, 0, -2, 2, -2, -5.0, 0.3], [0, 0, -2, 2, -1, 0.2, 0], [0, -1, -2, 2, -2, -0.2, 0],
    [1, 0, 0, -2, 0, -0.5, 0], [1, 0, 0, -2, 1, -0.1, 0], [-1, 0, 0, 0, -1, 0.1, 0], [-1, 0, 0, 0, 0, -2.1, 0.1],
    [-1, 0, 0, 0, 1, -0.4, 0], [0, 0, 0, -2, 0, -0.2, 0], [-2, 0, 0, 0, 0, -0.1, 0], [0, 0, -2, 0, -2, -0.6, 0],
    [0, 0, -2, 0, -1, -0.4, 0], [0, 0, -2, 0, 0, -0.1, 0], [-1, 0, -2, 0, -2, -0.1, 0], [-1, 0, -2, 0, -1, -0.1, 0],
])  # fmt: skip
_SEMIDIURNAL = np.array([[1, 0, 2, 0, 2, -0.3, 0], [0, 0, 2, 0, 2, -1.2, 0]])
_POLE = 1.333e-9  # eq. 6.22, for m1 and m2 in seconds of arc
_LAG = 0.0115


@dataclass(frozen=True)
class TidalHarmonics(Tabulated):
    """What a tide adds to C20, C21, S21, C22 and S22, fully normalised, in the axes of the ITRF: ``(t)`` to five.

    Parameters
    ----------
    kind : "k1", what depends on order and frequency, or "pole"
    epoch : the instant of t = 0, that of the problem
    eop : orientation of the Earth; default the tables of the IERS
    """

    TERMS: ClassVar[int] = 10
    LENGTH: ClassVar[float] = DAY / 6
    COLUMNS: ClassVar[int] = 5

    kind: str
    epoch: Epoch
    eop: Orientation | None = None

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("tide", self.kind, self.epoch.whole, self.epoch.fraction, orientation_key(self.eop))

    def at(self, epochs: list[Epoch]) -> Array:
        """The five coefficients at instants, (K, 5)."""
        if self.kind == "pole":
            m1, m2 = wobble(epochs, self.eop)
            zero = np.zeros_like(m1)
            return np.stack([zero, -_POLE * (m1 + _LAG * m2), -_POLE * (m2 - _LAG * m1), zero, zero], -1)
        return _by_order(epochs, self.eop) + 1e-12 * _by_frequency(epochs, self.eop)


def _by_order(epochs: list[Epoch], eop: Orientation | None) -> Array:
    """Eq. 6.6 with what the Love numbers of orders 1 and 2 have beyond the one of order 0."""
    turn = rotation("GCRF", "ITRF", epochs, eop)
    total = np.zeros((len(epochs), 5))
    for name in ("sun", "moon"):
        x, y, z = np.einsum("kij,kj->ik", turn, body(name, epochs)[0])
        r = np.sqrt(x * x + y * y + z * z)
        size = GM[name] / GM["earth"] / 5.0 * (RADIUS / r) ** 3 * np.sqrt(15.0) / r**2
        first = (LOVE_K21 - LOVE_K2) * size * z * (x - 1j * y)
        second = (LOVE_K22 - LOVE_K2) * size / 2.0 * (x - 1j * y) ** 2
        total[:, 1:] += np.stack([first.real, -first.imag, second.real, -second.imag], -1)
    return total


def _by_frequency(epochs: list[Epoch], eop: Orientation | None) -> Array:
    """Eq. 6.8 in units of 1e-12."""
    import erfa

    whole, fraction = pairs(epochs)
    tt = scales.days(whole, fraction)
    behind = scales.TT_TAI - (tables() if eop is None else eop).ut1_tai(whole, fraction)
    t = ((tt[0] - 2451545.0) + tt[1]) / 36525.0
    arguments = np.stack([f(t) for f in (erfa.fal03, erfa.falp03, erfa.faf03, erfa.fad03, erfa.faom03)], -1)
    turned = erfa.gmst06(*scales.days(*scales.normalized(whole, fraction - behind)), *tt) + np.pi
    out = []
    for order, lines in enumerate((_ZONAL, _DIURNAL, _SEMIDIURNAL)):
        angle = order * turned[:, None] - arguments @ lines[:, :5].T
        wave = np.exp(1j * angle) @ (lines[:, 5] + 1j * lines[:, 6])
        out.append(-1j * wave if order == 1 else wave)
    zonal, diurnal, semidiurnal = out
    return np.stack([zonal.real, diurnal.real, -diurnal.imag, semidiurnal.real, -semidiurnal.imag], -1)
