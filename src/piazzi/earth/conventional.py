"""The conventional field of the IERS Conventions 2010: EGM2008 with low degrees as satellites see them, and their rates."""

from __future__ import annotations

import math

import numpy as np

from piazzi.arrays import Array
from piazzi.earth.eop import ARCSEC, SECULAR_POLE

# Table 6.2: values of 2000.0 and rates per year; that of C20 is zero-tide
C20, C20_RATE, C30_RATE, C40_RATE = -0.48416948e-3, 11.6e-12, 4.9e-12, 4.7e-12
SOURCE = "IERS Conventions 2010, table 6.2"


def conventional(c: Array, s: Array) -> tuple[Array, Array, list[tuple[int, int, float, float]]]:
    """The coefficients of EGM2008 with those of low degree in 2000.0 (C20 zero-tide, C21, S21), and rates per year: n, m, c, s.

    C20 is that of satellite laser ranging, C21 and S21 are those of the secular pole (eq. 6.5).
    """
    (x, y), (x_rate, y_rate) = np.array(SECULAR_POLE).T * ARCSEC
    rates = [(2, 0, C20_RATE, 0.0), (3, 0, C30_RATE, 0.0), (4, 0, C40_RATE, 0.0), (2, 1, *_of_pole(c, s, x_rate, y_rate))]
    first, second = c.copy(), s.copy()
    first[2, 0] = C20
    first[2, 1], second[2, 1] = _of_pole(c, s, x, y)
    return first, second, rates


def _of_pole(c: Array, s: Array, x: float, y: float) -> tuple[float, float]:
    """C21 and S21 of a field whose axis of greatest inertia is at this place of the pole (rad)."""
    a, c22, s22 = math.sqrt(3.0) * c[2, 0], c[2, 2], s[2, 2]
    return float(a * x - c22 * x + s22 * y), float(-a * y - c22 * y - s22 * x)
