"""True, eccentric and mean anomaly on any conic, and the derivatives of the true one.

The eccentric anomaly is E on an ellipse, the hyperbolic one H on a hyperbola, and D = tan(nu / 2) on a parabola.
The mean one is

    M = E - e sin E = sqrt(mu / a^3) (t - T)            ellipse
    M = e sinh H - H = sqrt(mu / |a|^3) (t - T)         hyperbola
    M = D + D^3 / 3 = sqrt(mu / (2 q^3)) (t - T)        parabola, with the distance q of the pericentre (Barker)

Angles are in radians.  Sources: Battin, An Introduction to the Mathematics and Methods of Astrodynamics (1999), ch. 4 and 5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.arrays import Array

ANOMALIES = ("true", "eccentric", "mean")
_TERMS = 9  # of the series of x - sin x, to 1e-17 where |x| <= 1


def true_to_eccentric(true: Any, e: Any) -> Array:
    """The eccentric anomaly of a true one at eccentricity `e`; turns are kept.

    Raises
    ------
    ValueError
        For an eccentricity that is negative, or a true anomaly beyond the asymptotes of a hyperbola.
    """
    true, e = _checked(true, e)
    turns = 2.0 * np.pi * np.round(true / (2.0 * np.pi))
    half = np.tan(0.5 * (true - turns))
    if np.any(beyond := (e > 1.0) & (1.0 + e * np.cos(true) <= 0.0)):
        at = np.flatnonzero(beyond)[0]
        raise ValueError(
            f"true anomaly {np.degrees(true.flat[at]):g} deg lies beyond the asymptotes"
            f" of a hyperbola of eccentricity {e.flat[at]:g}"
        )
    ratio = np.sqrt(np.abs(1.0 - e) / (1.0 + e)) * half
    with np.errstate(all="ignore"):
        bound, free = turns + 2.0 * np.arctan(ratio), 2.0 * np.arctanh(ratio)
    return np.asarray(np.where(e < 1.0, bound, np.where(e > 1.0, free, half)))


def eccentric_to_true(eccentric: Any, e: Any) -> Array:
    """The true anomaly of an eccentric one at eccentricity `e`; turns are kept."""
    eccentric, e = _checked(eccentric, e)
    turns = np.where(e < 1.0, 2.0 * np.pi * np.round(eccentric / (2.0 * np.pi)), 0.0)
    within = 0.5 * (eccentric - turns)
    with np.errstate(all="ignore"):
        half = np.where(e < 1.0, np.tan(within), np.where(e > 1.0, np.tanh(within), 2.0 * within))
        ratio = np.where(e == 1.0, 1.0, np.sqrt((1.0 + e) / np.abs(1.0 - e)))
    return np.asarray(turns + 2.0 * np.arctan(ratio * half))


def eccentric_to_mean(eccentric: Any, e: Any) -> Array:
    """The mean anomaly of an eccentric one at eccentricity `e`."""
    E, e = _checked(eccentric, e)
    return np.where(e == 1.0, E + E**3 / 3.0, _kepler(E, e)[0])


def mean_to_eccentric(mean: Any, e: Any) -> Array:
    """The eccentric anomaly of a mean one at eccentricity `e`, by Newton's method within a bracket."""
    mean, e = _checked(mean, e)
    turns = np.where(e < 1.0, 2.0 * np.pi * np.round(mean / (2.0 * np.pi)), 0.0)
    sign, M = np.sign(mean - turns), np.abs(mean - turns)
    low = np.zeros_like(M)
    with np.errstate(all="ignore"):
        # M >= (1 - e) E and M >= E - e on an ellipse; on a hyperbola e sinh H <= M + H, and M >= (e - 1) H + e H^3 / 6
        high = np.where(e < 1.0, np.minimum(M + e, M / np.abs(1.0 - e)), np.cbrt(6.0 * M / np.maximum(e, 1.0)))
        high = np.where(e > 1.0, np.minimum(high, M / np.abs(e - 1.0)), high)
        high = np.where(np.isfinite(high), high, M + e) * (1.0 + 1e-15)
        E = np.where(
            e < 1.0,
            np.minimum(high, np.cbrt(6.0 * M / np.maximum(e, 1e-3))),
            np.minimum(high, np.arcsinh(M / np.maximum(e, 1.0)) + 0.5 * high),
        )
        for _ in range(100):
            value, slope = _kepler(E, e)
            above = value > M
            low, high = np.where(above, low, E), np.where(above, E, high)
            new = E - (value - M) / slope
            new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
            if np.all((np.abs(new - E) <= 2e-16 * np.abs(E)) | (e == 1.0)):
                break
            E = new
        B = 1.5 * M
        root = np.cbrt(B + np.sqrt(B * B + 1.0))
        barker = np.where(M < 1e-4, M - M**3 / 3.0, root - 1.0 / root)
    return np.asarray(np.where(e == 1.0, sign * barker, turns + sign * E))


def to_true(anomaly: Any, e: Any, kind: str) -> Array:
    """The true anomaly of one of a `kind`: true, eccentric or mean."""
    if check_kind(kind) == "true":
        return np.asarray(anomaly, dtype=float)
    return eccentric_to_true(anomaly if kind == "eccentric" else mean_to_eccentric(anomaly, e), e)


def from_true(true: Any, e: Any, kind: str) -> Array:
    """The anomaly of a `kind` where the true one is `true`."""
    if check_kind(kind) == "true":
        return np.asarray(true, dtype=float)
    eccentric = true_to_eccentric(true, e)
    return eccentric if kind == "eccentric" else eccentric_to_mean(eccentric, e)


def true_partials(true: Array, e: Array, kind: str) -> tuple[Array, Array]:
    """Derivatives of the true anomaly by one of a `kind` at fixed `e`, and by `e` at a fixed anomaly of that kind.

    Raises
    ------
    ValueError
        On a parabola, unless the kind is true: beside it the other two are of other sorts, and have no derivative by `e`.
    """
    if check_kind(kind) == "true":
        return np.ones_like(true), np.zeros_like(true)
    if np.any(e == 1.0):
        raise ValueError(f"the {kind} anomaly has no derivative by the eccentricity at a parabola; take the true anomaly")
    off = 1.0 - e * e
    w = 1.0 + e * np.cos(true)
    if kind == "eccentric":
        return w / np.sqrt(np.abs(off)), np.sin(true) / off
    return w**2 / np.abs(off) ** 1.5, np.sin(true) * (1.0 + w) / off


def check_kind(kind: str) -> str:
    """The kind of anomaly; raises ValueError where there is none of that name."""
    if kind not in ANOMALIES:
        raise ValueError(f"anomaly {kind!r} is not known; there are {', '.join(ANOMALIES)}")
    return kind


def _kepler(E: Array, e: Array) -> tuple[Array, Array]:
    """Mean anomaly, and its derivative, on ellipse or hyperbola: digits are kept near a parabola."""
    with np.errstate(all="ignore"):
        small = np.abs(E) <= 1.0
        bound = (1.0 - e) * E + e * np.where(small, _cubic(E, -1.0), E - np.sin(E))
        free = (e - 1.0) * E + e * np.where(small, _cubic(E, 1.0), np.sinh(E) - E)
        half = 2.0 * np.sin(0.5 * E) ** 2, 2.0 * np.sinh(0.5 * E) ** 2
        return np.where(e < 1.0, bound, free), np.where(e < 1.0, (1.0 - e) + e * half[0], (e - 1.0) + e * half[1])


def _cubic(x: Array, sign: float) -> Array:
    """x - sin x (`sign` -1), or sinh x - x (`sign` 1), by its series."""
    total = np.ones_like(x)
    for k in range(2 * _TERMS + 3, 3, -2):
        total = 1.0 + sign * x * x / (k * (k - 1.0)) * total
    return np.asarray(x**3 / 6.0 * total)


def _checked(anomaly: Any, e: Any) -> tuple[Array, Array]:
    anomaly, e = np.broadcast_arrays(np.asarray(anomaly, dtype=float), np.asarray(e, dtype=float))
    if np.any(e < 0.0):
        raise ValueError(f"eccentricity is {e[e < 0.0].flat[0]:g}; it must not be negative")
    return anomaly, e
