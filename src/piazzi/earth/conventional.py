"""The conventional field of the IERS Conventions 2010: EGM2008 with low degrees as satellites see them, and their rates."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from piazzi.earth.eop import ARCSEC, SECULAR_POLE
from piazzi.earth.fields import PERMANENT_TIDE, GravityField, Term

# Table 6.2: values of 2000.0 and rates per year; that of C20 is zero-tide
C20, C20_RATE, C30_RATE, C40_RATE = -0.48416948e-3, 11.6e-12, 4.9e-12, 4.7e-12


def conventional(field: GravityField) -> GravityField:
    """EGM2008 with C20 of satellite laser ranging, rates of C20, C30 and C40, and C21 and S21 of the secular pole (eq. 6.5)."""
    c, s = field.c.copy(), field.s.copy()
    c[2, 0] = C20 - PERMANENT_TIDE  # the field is tide-free
    (x, y), (x_rate, y_rate) = np.array(SECULAR_POLE).T * ARCSEC
    c[2, 1], s[2, 1] = _of_pole(field, x, y)
    rates = [(2, 0, C20_RATE, 0.0), (3, 0, C30_RATE, 0.0), (4, 0, C40_RATE, 0.0), (2, 1, *_of_pole(field, x_rate, y_rate))]
    terms = tuple(Term("trnd", n, m, cosine, sine, 2000.0, math.inf, 1.0) for n, m, cosine, sine in rates)
    return replace(field, name="IERS2010", c=c, s=s, source="package, IERS Conventions 2010, table 6.2", terms=terms)


def _of_pole(field: GravityField, x: float, y: float) -> tuple[float, float]:
    """C21 and S21 of a field whose axis of greatest inertia is at this place of the pole (rad)."""
    a, c, s = math.sqrt(3.0) * field.c[2, 0], field.c[2, 2], field.s[2, 2]
    return float(a * x - c * x + s * y), float(-a * y - c * y - s * x)
