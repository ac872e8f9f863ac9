"""The density of the air after Harris and Priester: the least and the largest of a day over height.

Values are those that Montenbruck and Gill, Satellite Orbits (2000), table 3.3, give for mean activity of the Sun (F10.7 about
150), from Harris and Priester 1962, J. Atmos. Sci. 19, 286.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.model.functions import Signature
from piazzi.outside.evaluation import check_count, checksum, derivatives, value
from piazzi.outside.pieces import Pieces

# height (km), least and largest density (g/km^3)
TABLE = np.array([
    [100, 497400, 497400], [120, 24900, 24900], [130, 8377, 8710], [140, 3899, 4059], [150, 2122, 2215], [160, 1263, 1344],
    [170, 800.8, 875.8], [180, 528.3, 601.0], [190, 361.7, 429.7], [200, 255.7, 316.2], [210, 183.9, 239.6],
    [220, 134.1, 185.3], [230, 99.49, 145.5], [240, 74.88, 115.7], [250, 57.09, 93.08], [260, 44.03, 75.55],
    [270, 34.30, 61.82], [280, 26.97, 50.95], [290, 21.39, 42.26], [300, 17.08, 35.26], [320, 10.99, 25.11],
    [340, 7.214, 18.19], [360, 4.824, 13.37], [380, 3.274, 9.955], [400, 2.249, 7.492], [420, 1.558, 5.684],
    [440, 1.091, 4.355], [460, 0.7701, 3.362], [480, 0.5474, 2.612], [500, 0.3916, 2.042], [520, 0.2819, 1.605],
    [540, 0.2042, 1.267], [560, 0.1488, 1.005], [580, 0.1092, 0.7997], [600, 0.08070, 0.6390], [620, 0.06012, 0.5123],
    [640, 0.04519, 0.4121], [660, 0.03430, 0.3325], [680, 0.02632, 0.2691], [700, 0.02043, 0.2185], [720, 0.01607, 0.1779],
    [740, 0.01281, 0.1452], [760, 0.01036, 0.1190], [780, 0.008496, 0.09776], [800, 0.007069, 0.08059],
    [840, 0.004680, 0.05741], [880, 0.003200, 0.04210], [920, 0.002210, 0.03130], [960, 0.001560, 0.02360],
    [1000, 0.001150, 0.01810],
])  # fmt: skip
BOTTOM, TOP = 100e3, 1000e3
_STEP = 10e3  # all heights of the table are multiples of it
_H, _LOG = TABLE[:, 0] * 1e3, np.log(TABLE[:, 1:] * 1e-12)
TOP_SCALES, BOTTOM_SCALES = (
    tuple(float(s) for s in -(_H[b] - _H[a]) / (_LOG[b] - _LOG[a])) for a, b in ((-2, -1), (0, 1))
)  # m


@cache
def pieces() -> Pieces:
    """The logarithm of both densities (kg/m^3) over height: cubics, with one slope where they meet, and monotone."""
    h, secant = np.diff(_H)[:, None], np.diff(_LOG, axis=0) / np.diff(_H)[:, None]
    left, right = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]  # Fritsch and Butland 1984: a weighted harmonic mean
    inner = (left + right) / (left / secant[:-1] + right / secant[1:])
    slope = np.concatenate([secant[:1], inner, secant[-1:]])
    starts = np.arange(BOTTOM, TOP, _STEP)
    i = np.searchsorted(_H, starts, side="right") - 1
    width, s = h[i], ((starts - _H[i])[:, None] + 0.5 * _STEP) / h[i]  # s: where in the interval a piece has its middle
    a, b = _LOG[i], slope[i] * width
    c = 3 * (_LOG[i + 1] - a) - width * (2 * slope[i] + slope[i + 1])
    d = 2 * (a - _LOG[i + 1]) + width * (slope[i] + slope[i + 1])
    q = 0.5 * _STEP / width  # of the interval, for one of tau
    powers = d * q**3, (3 * d * s + c) * q**2, (3 * d * s**2 + 2 * c * s + b) * q, ((d * s + c) * s + b) * s + a
    return Pieces(BOTTOM, _STEP, np.stack(powers, axis=1), np.zeros(2), np.zeros(2))


@dataclass(frozen=True)
class HarrisPriester:
    """Natural logarithms of the least and the largest density (kg/m^3) at a height of 100e3 to 1000e3 m: ``(h)`` to two."""

    signature: ClassVar[Signature] = Signature.of_table(2, 4)
    span: ClassVar[None] = None

    @cached_property
    def checksum(self) -> str:
        """Hash of what the table is."""
        return checksum("harris-priester", TABLE)

    def block(self, first: float = 0.0, last: float = 0.0) -> Array:
        """The data as kernels read them, whatever the times."""
        return pieces().block

    def value(self, *height: float) -> tuple[float, ...]:
        """Both logarithms."""
        check_count(self.signature, height)
        return value(self.signature, self.block(), *height)

    def derivatives(self, *height: float) -> Array:
        """Their slopes over height, (2, 1)."""
        check_count(self.signature, height)
        return derivatives(self.signature, self.block(), *height)
