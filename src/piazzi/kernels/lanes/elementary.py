"""Elementary functions of numbers and of packs from one source: the same operations, so the same bits with lanes and without.

Errors stay below the bounds in the table of functions (`ulps`); tests hold them against wider arithmetic.  Arguments are
reduced as by Cody and Waite (Software Manual for the Elementary Functions, 1980), with constants whose products with small
whole numbers are exact; the polynomials are minimax fits (Remez), to 1e-17 of the function.  What a reduction does not cover
(NaN, infinity, angles beyond a million, numbers that are not normal) is left to the C library, lane by lane.  Hyperbolic
functions and powers by anything but integers and halves are the C library's altogether.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from numba import njit

from piazzi.kernels.compiler import helper_options
from piazzi.kernels.lanes.functions import maximum, minimum
from piazzi.kernels.lanes.pieces import below, choose, exponent, mended, nearest, polynomial, two_to, with_sign

fabs, sqrt = math.fabs, math.sqrt
# "contract" lets a*b + c round once; nothing else of fast-math, so that NaN keeps meaning "missing"
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
HELPER: dict[str, Any] = OPTIONS | helper_options()

# pi/2 and ln 2 in parts: the first two (the first) have 33 bits, so that whole multiples up to 2^20 are exact
QUARTER_TURN = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
LN2 = (0.6931471803691238, 1.9082149292705877e-10)
HALF_PI, HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17
EIGHTH_TURN = 0.41421356237309503  # its tangent
LARGEST_ANGLE, LARGEST_EXPONENT = 1e6, 700.0
HUGE = 1e290

sine_series = polynomial(
    "sine_series",
    -0.1666666666666663,
    0.008333333333322075,
    -0.00019841269829551453,
    2.755731360731377e-06,
    -2.5050745427545973e-08,
    1.589608747693057e-10,
)
cosine_series = polynomial(
    "cosine_series",
    0.041666666666666595,
    -0.0013888888888872984,
    2.480158728880309e-05,
    -2.7557314164463753e-07,
    2.087569873454228e-09,
    -1.1358423309497131e-11,
)
arc_series = polynomial(
    "arc_series",
    -0.3333333333333319,
    0.1999999999995282,
    -0.1428571428012132,
    0.11111110779801847,
    -0.09090897655223865,
    0.07692058433500107,
    -0.06663084208901873,
    0.05847747464181119,
    -0.05038675257349662,
    0.038048779573864225,
    -0.01789012801136526,
)
exponential_series = polynomial(
    "exponential_series",
    0.5,
    0.16666666666666682,
    0.04166666666666609,
    0.008333333333316918,
    0.0013888888889117387,
    0.0001984126989667965,
    2.480158692442184e-05,
    2.755723455987763e-06,
    2.755758292151809e-07,
    2.51121441719468e-08,
    2.0826503509183257e-09,
)
logarithm_series = polynomial(
    "logarithm_series",
    0.6666666666666735,
    0.39999999999411884,
    0.28571428743107175,
    0.22222198489466705,
    0.18183569168665004,
    0.15313914770198447,
    0.14797420195979794,
)
_sin, _cos, _tan, _exp, _log = (mended(f, 1) for f in (math.sin, math.cos, math.tan, math.exp, math.log))
_atan2 = mended(math.atan2, 2)


def _one_source(function: Callable[..., Any]) -> Any:
    """Compile for whatever arguments a caller has."""
    return njit(forceinline=True, **HELPER)(function)


@_one_source
def _reduced(x: Any) -> Any:
    """Sine and cosine of x less the nearest multiple of a quarter turn, and that multiple."""
    k = nearest(x * 0.6366197723675814) + 0.0  # no -0, so that r keeps the sign of x
    r = ((x - k * QUARTER_TURN[0]) - k * QUARTER_TURN[1]) - k * QUARTER_TURN[2]
    z = r * r
    half = 0.5 * z
    rest = 1.0 - half
    sine = with_sign(r + r * (z * sine_series(z)), r)  # a sum of zeros would lose it
    return sine, rest + (((1.0 - rest) - half) + z * z * cosine_series(z)), k


@_one_source
def sin(x: Any) -> Any:
    """The sine."""
    s, c, k = _reduced(x)
    quarter = k - 4.0 * below(0.25 * k)
    value = choose(quarter - 2.0 * below(0.5 * quarter), 0.5, c, s)
    return _sin(choose(quarter, 1.5, -value, value), fabs(x), LARGEST_ANGLE, x)


@_one_source
def cos(x: Any) -> Any:
    """The cosine."""
    s, c, k = _reduced(x)
    quarter = (k + 1.0) - 4.0 * below(0.25 * (k + 1.0))
    value = choose(quarter - 2.0 * below(0.5 * quarter), 0.5, c, s)
    return _cos(choose(quarter, 1.5, -value, value), fabs(x), LARGEST_ANGLE, x)


@_one_source
def tan(x: Any) -> Any:
    """The tangent."""
    s, c, k = _reduced(x)
    odd = k - 2.0 * below(0.5 * k)
    return _tan(choose(odd, 0.5, -c, s) / choose(odd, 0.5, s, c), fabs(x), LARGEST_ANGLE, x)


@_one_source
def exp(x: Any) -> Any:
    """The exponential."""
    k = nearest(x * 1.4426950408889634)
    r = (x - k * LN2[0]) - k * LN2[1]
    return _exp((1.0 + (r + r * r * exponential_series(r))) * two_to(k), fabs(x), LARGEST_EXPONENT, x)


@_one_source
def log(x: Any) -> Any:
    """The natural logarithm."""
    k = exponent(x)
    f = x * two_to(-k) - 1.0
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    value = k * LN2[0] - ((half - (s * (half + z * logarithm_series(z)) + k * LN2[1])) - f)
    return _log(value, choose(x, 0.0, maximum(x, 1.0 / x), HUGE), HUGE, x)


@_one_source
def atan2(y: Any, x: Any) -> Any:
    """The angle of the point (x, y)."""
    wide, high = fabs(x), fabs(y)
    large, small = maximum(wide, high), minimum(wide, high)
    edge = EIGHTH_TURN * large
    u = choose(small, edge, small - large, small) / choose(small, edge, small + large, large)
    z = u * u
    arc = u + (u * (z * arc_series(z)) + choose(small, edge, 0.5 * HALF_PI_REST, 0.0))
    arc = choose(small, edge, 0.5 * HALF_PI, 0.0) + arc
    arc = choose(high, wide, HALF_PI - (arc - HALF_PI_REST), arc)
    arc = choose(0.0, x, 2.0 * HALF_PI - (arc - 2.0 * HALF_PI_REST), arc)
    return _atan2(with_sign(arc, y), wide + high, HUGE, y, x)


@_one_source
def atan(x: Any) -> Any:
    """The arc tangent."""
    return atan2(x, 1.0)


@_one_source
def asin(x: Any) -> Any:
    """The arc sine."""
    return atan2(x, sqrt((1.0 - x) * (1.0 + x)))


@_one_source
def acos(x: Any) -> Any:
    """The arc cosine."""
    return atan2(sqrt((1.0 - x) * (1.0 + x)), x)
