"""Delta T = TT - UT1 before there were atomic clocks.

The polynomials of F. Espenak and J. Meeus, "Five Millennium Canon of Solar Eclipses", NASA/TP-2006-214141 (2006), for the years
1600 to 1961: no more than fits to tables by Morrison and Stephenson (2004).  Their error is that of those tables: 20 s in 1600,
5 s in 1700, 2 s in 1750, 1 s from 1800, 0.1 s from 1955.
"""

from __future__ import annotations

import numpy as np

from piazzi.arrays import Array

MODEL = "Espenak and Meeus 2006"
FIRST_YEAR, LAST_YEAR = 1600.0, 1986.0
# first year of the piece, year that its variable counts from, coefficients from the constant upwards
_PIECES = (
    (1600.0, 1600.0, (120.0, -0.9808, -0.01532, 1 / 7129)),
    (1700.0, 1700.0, (8.83, 0.1603, -0.0059285, 0.00013336, -1 / 1174000)),
    (
        1800.0,
        1800.0,
        (13.72, -0.332447, 0.0068612, 0.0041116, -0.00037436, 0.0000121272, -0.0000001699, 0.000000000875),
    ),
    (1860.0, 1860.0, (7.62, 0.5737, -0.251754, 0.01680668, -0.0004473624, 1 / 233174)),
    (1900.0, 1900.0, (-2.79, 1.494119, -0.0598939, 0.0061966, -0.000197)),
    (1920.0, 1920.0, (21.20, 0.84493, -0.076100, 0.0020936)),
    (1941.0, 1950.0, (29.07, 0.407, -1 / 233, 1 / 2547)),
    (1961.0, 1975.0, (45.45, 1.067, -1 / 260, -1 / 718)),
)
# year and standard error in seconds
_ERRORS = np.array([[1600.0, 20.0], [1700.0, 5.0], [1750.0, 2.0], [1800.0, 1.0], [1900.0, 1.0], [1955.0, 0.1], [1986.0, 0.1]])


def delta_t(year: Array) -> Array:
    """TT - UT1 in seconds at years with decimals; raises ValueError before 1600 and after 1986."""
    year = np.asarray(year, dtype=float)
    if np.any((year < FIRST_YEAR) | (year >= LAST_YEAR)):
        wrong = year[(year < FIRST_YEAR) | (year >= LAST_YEAR)].flat[0]
        raise ValueError(f"year {wrong:.2f}: Delta T is known here from {FIRST_YEAR:.0f} to {LAST_YEAR:.0f} ({MODEL})")
    result = np.zeros_like(year)
    for first, origin, coefficients in _PIECES:
        result = np.where(year >= first, np.polynomial.polynomial.polyval(year - origin, coefficients), result)
    return result


def delta_t_error(year: Array) -> Array:
    """One standard error of `delta_t` in seconds, between the years of its source."""
    return np.asarray(np.interp(np.asarray(year, dtype=float), _ERRORS[:, 0], _ERRORS[:, 1]))
