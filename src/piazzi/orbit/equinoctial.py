"""Equinoctial elements of an ellipse, to and from states, with the derivatives of both, by way of the modified ones.

Source: Broucke and Cefola, Celestial Mechanics 5 (1972); derivatives derived here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.anomalies import check_kind, from_true, to_true, true_partials
from piazzi.orbit.differential import motion, states
from piazzi.orbit.modified_equinoctial import ModifiedEquinoctial


@dataclass(frozen=True)
class Equinoctial:
    """Equinoctial elements (..., 6) of an ellipse: a, h, k, p, q and the longitude of the body.

    Parameters
    ----------
    longitude : "mean", "eccentric" or "true": the anomaly of that kind, plus w, in radians, in (-pi, pi]
    retrograde : take the set that is singular at an inclination of 0, and regular at 180 degrees

    Notes
    -----
    h = e sin w, k = e cos w, p = tan(i/2) sin(node), q = tan(i/2) cos(node): letters as in the literature, and
    others than those
    of the modified set.  Regular for circular and equatorial ellipses.  Parabolas and hyperbolas are refused: take
    modified equinoctial elements.
    """

    longitude: str = "mean"
    retrograde: bool = False

    def __post_init__(self) -> None:
        check_kind(self.longitude)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the six elements."""
        return ("a", "h", "k", "p", "q", f"{self.longitude} longitude")

    units: ClassVar[tuple[str, ...]] = ("m", "", "", "", "", "rad")

    def from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Elements (..., 6) of position and velocity (..., 3).

        Raises
        ------
        ValueError
            Where the orbit is no ellipse, and as `ModifiedEquinoctial.from_state`.
        """
        _, f, g, h, k, L = np.moveaxis(self._modified.from_state(r, v, mu), -1, 0)
        _check_ellipse(f, g)
        return np.stack([1.0 / motion(*states(r, v, mu), mu).alpha, g, f, k, h, self._from_true(L, f, g)], -1)

    def to_state(self, elements: Any, mu: float) -> tuple[Array, Array]:
        """Position and velocity (..., 3) of elements; ValueError where they are those of no ellipse."""
        return self._modified.to_state(self._to_modified(elements), mu)

    def jacobian_from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of the elements by position and velocity; errors as of `from_state`."""
        x = self._modified.from_state(r, v, mu)
        by = self._modified.jacobian_from_state(r, v, mu)
        p, f, g, L = x[..., 0], x[..., 1], x[..., 2], x[..., 5]
        _check_ellipse(f, g)
        dp, df, dg, dh, dk, dL = np.moveaxis(by, -2, 0)
        off = (1.0 - f * f - g * g)[..., None]
        da = dp / off + (2.0 * p)[..., None] / off**2 * (f[..., None] * df + g[..., None] * dg)
        by_l, by_f, by_g = _longitude_partials(L, f, g, self.longitude)
        dl = (dL - by_f[..., None] * df - by_g[..., None] * dg) / by_l[..., None]
        return np.stack([da, dg, df, dk, dh, dl], -2)

    def jacobian_to_state(self, elements: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of position and velocity by the elements; errors as of `to_state`."""
        x = self._to_modified(elements)
        p, f, g, L = x[..., 0], x[..., 1], x[..., 2], x[..., 5]
        by_p, by_f, by_g, by_h, by_k, by_L = np.moveaxis(self._modified.jacobian_to_state(x, mu), -1, 0)
        off = 1.0 - f * f - g * g
        a = (p / off)[..., None]
        l_by, l_f, l_g = (part[..., None] for part in _longitude_partials(L, f, g, self.longitude))
        f, g = f[..., None], g[..., None]
        columns = [
            off[..., None] * by_p,
            by_g - 2.0 * a * g * by_p + l_g * by_L,
            by_f - 2.0 * a * f * by_p + l_f * by_L,
            by_k,
            by_h,
            l_by * by_L,
        ]
        return np.stack(columns, -1)

    @property
    def _modified(self) -> ModifiedEquinoctial:
        return ModifiedEquinoctial(self.retrograde)

    def _to_modified(self, elements: Any) -> Array:
        elements = np.asarray(elements, dtype=float)
        if elements.shape[-1:] != (6,):
            raise ValueError(f"elements have shape {elements.shape}; they must be (..., 6)")
        a, h, k, p, q, longitude = np.moveaxis(elements, -1, 0)
        _check_ellipse(k, h)
        e, w = np.hypot(h, k), np.arctan2(h, k)
        L = w + to_true(longitude - w, e, self.longitude)
        return np.stack([a * (1.0 - e) * (1.0 + e), k, h, q, p, L], -1)

    def _from_true(self, L: Array, f: Array, g: Array) -> Array:
        e, w = np.hypot(f, g), np.arctan2(g, f)
        longitude = w + from_true(L - w, e, self.longitude)
        return np.asarray(longitude - 2.0 * np.pi * np.ceil((longitude - np.pi) / (2.0 * np.pi)))


def _longitude_partials(L: Array, f: Array, g: Array, kind: str) -> tuple[Array, Array, Array]:
    """Derivatives of the true longitude by one of a `kind`, by f and by g; regular where the orbit is circular."""
    e, w = np.hypot(f, g), np.arctan2(g, f)
    true = L - w
    by, _ = true_partials(true, e, kind)
    if kind == "true":
        return by, np.zeros_like(f), np.zeros_like(f)
    # the turn of the pericentre moves L by 1 - by, and e by sin(nu) (...); both over e, which cancels
    off = 1.0 - e * e
    along = np.sin(true) * ((2.0 + e * np.cos(true)) if kind == "mean" else 1.0) / off
    root = np.sqrt(off)
    cosine = np.cos(true)
    if kind == "mean":  # (1 - (1 + e c)^2 / root^3) / e
        across = -((2.0 * cosine + e * cosine**2) + e * (off + root + 1.0) / (1.0 + root)) / root**3
    else:  # (1 - (1 + e c) / root) / e
        across = -(cosine + e / (1.0 + root)) / root
    c, s = np.cos(w), np.sin(w)
    return by, along * c - across * s, along * s + across * c


def _check_ellipse(f: Array, g: Array) -> None:
    e = np.hypot(f, g)
    if np.any(e >= 1.0):
        raise ValueError(f"eccentricity is {e[e >= 1.0].flat[0]:g}: these elements are for ellipses; take ModifiedEquinoctial")
