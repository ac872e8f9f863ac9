"""Chi-square quantiles by the incomplete gamma function.

Written out because SciPy is no dependency and importing its statistics costs a second; the tests hold it against closed forms
and against 50-digit arithmetic.
"""

from __future__ import annotations

from functools import lru_cache
from math import erf, exp, expm1, inf, lgamma, log, nan, sqrt


def cdf(x: float, k: float) -> float:
    """Probability that a chi-square variable of `k` degrees of freedom is at most `x`.

    By the series of the incomplete gamma function below its turning point and its continued fraction above (Abramowitz and
    Stegun 6.5.29 and 6.5.31).
    """
    a, y = 0.5 * k, 0.5 * x
    if not y > 0:
        return 0.0 if y == 0 or y < 0 else nan
    if y == inf:
        return 1.0
    if k in (1, 2):  # in closed form, and at once: a gate asks hundreds of times
        return erf(sqrt(y)) if k == 1 else -expm1(-y)
    scale = exp(a * log(y) - y - lgamma(a))
    return scale * _series(a, y) if y < a + 1 else 1.0 - scale * _continued_fraction(a, y)


def _series(a: float, y: float) -> float:
    term = total = 1.0 / a
    i = 0
    while abs(term) > 1e-17 * total:
        i += 1
        term *= y / (a + i)
        total += term
    return total


def _continued_fraction(a: float, y: float) -> float:
    """Lentz's evaluation; every denominator is positive for y >= a + 1."""
    b = y + 1.0 - a
    c, d = inf, 1.0 / b
    out = d
    for i in range(1, 100_000):
        numerator = -i * (i - a)
        b += 2.0
        d = 1.0 / (numerator * d + b)
        c = b + numerator / c
        factor = c * d
        out *= factor
        if abs(factor - 1.0) < 1e-16:
            break
    return out


@lru_cache(maxsize=256)
def quantile(p: float, k: float) -> float:
    """The value that a chi-square variable of `k` degrees of freedom stays below with probability `p`, by bisection.

    Raises
    ------
    ValueError
        Unless 0 <= p < 1 and k > 0.
    """
    if not (0 <= p < 1 and k > 0):
        raise ValueError(f"no chi-square quantile for p = {p} and {k} degrees of freedom: 0 <= p < 1 and k > 0")
    low, high = 0.0, max(1.0, float(k))
    while cdf(high, k) < p:
        high *= 2.0
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        low, high = (middle, high) if cdf(middle, k) < p else (low, middle)
