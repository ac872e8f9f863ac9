"""Modified equinoctial elements of any conic, to and from states, with the derivatives of both.

With the longitude of the pericentre w = argument + node, and L = nu + w the true longitude,

    p, f = e cos w, g = e sin w, h = tan(i/2) cos(node), k = tan(i/2) sin(node), L

are regular for circular, equatorial, parabolic and hyperbolic orbits, and singular at an inclination of 180 degrees
only, where the
retrograde set (node counted the other way) is regular.  Sources: Walker, Ireland and Owens, Celestial Mechanics 36 (1985);
Broucke and Cefola, Celestial Mechanics 5 (1972); derivatives derived here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.differential import check_mu, differential, motion, states

# retrograde elements are those of the state turned by half a turn about the first axis, with h and k changed in sign as here
_TURNED = np.array([1.0, -1.0, -1.0])
_SIGNS = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class ModifiedEquinoctial:
    """Modified equinoctial elements (..., 6): p, f, g, h, k and the true longitude L, of any conic.

    Parameters
    ----------
    retrograde : take the set that is singular at an inclination of 0, and regular at 180 degrees

    Notes
    -----
    p is in the unit of the position, L in radians, in (-pi, pi], the others are numbers.
    """

    retrograde: bool = False

    names: ClassVar[tuple[str, ...]] = ("p", "f", "g", "h", "k", "true longitude")
    units: ClassVar[tuple[str, ...]] = ("m", "", "", "", "", "rad")

    def from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Elements (..., 6) of position and velocity (..., 3).

        Raises
        ------
        ValueError
            For what is no state, motion along a straight line, or the inclination at which this set is singular.
        """
        r, v = self._turned(*states(r, v, mu))
        m = motion(r, v, mu)
        h, k = self._tilt(m.n)
        F, G = _frame(h, k)
        L = np.arctan2(np.sum(m.u * G, -1), np.sum(m.u * F, -1))
        c, s = np.cos(L), np.sin(L)
        elements = np.stack([m.p, m.c * c + m.s * s, m.c * s - m.s * c, h, k, L], -1)
        return elements * _SIGNS if self.retrograde else elements

    def to_state(self, elements: Any, mu: float) -> tuple[Array, Array]:
        """Position and velocity (..., 3) of elements; ValueError where p is not positive or L beyond the asymptotes."""
        p, f, g, h, k, L = self._parts(elements, mu)
        F, G = _frame(h, k)
        c, s = np.cos(L)[..., None], np.sin(L)[..., None]
        w = 1.0 + f[..., None] * c + g[..., None] * s
        speed = np.sqrt(mu / p)[..., None]
        return self._turned(p[..., None] / w * (c * F + s * G), speed * ((c + f[..., None]) * G - (s + g[..., None]) * F))

    def jacobian_from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of the elements by position and velocity; errors as of `from_state`."""
        r, v = self._turned(*states(r, v, mu))
        m = motion(r, v, mu)
        h, k = self._tilt(m.n)
        F, G = _frame(h, k)
        d = differential(m, v, mu)
        c, s = np.sum(m.u * F, -1)[..., None], np.sum(m.u * G, -1)[..., None]
        f, g = m.c[..., None] * c + m.s[..., None] * s, m.c[..., None] * s - m.s[..., None] * c
        about_f, about_g = c * d.about_u - s * d.about_t, s * d.about_u + c * d.about_t
        half = (0.5 * (1.0 + h * h + k * k))[..., None]
        dL = d.about_n + h[..., None] * about_g - k[..., None] * about_f
        df = c * d.c + s * d.s - g * dL
        dg = s * d.c - c * d.s + f * dL
        J = np.stack([d.p, df, dg, half * about_f, half * about_g, dL], -2)
        return _SIGNS[:, None] * J * np.tile(_TURNED, 2) if self.retrograde else J

    def jacobian_to_state(self, elements: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of position and velocity by the elements; errors as of `to_state`."""
        p, f, g, h, k, L = (part[..., None] for part in self._parts(elements, mu))
        F, G = _frame(h[..., 0], k[..., 0])
        n = np.cross(F, G)
        c, s = np.cos(L), np.sin(L)
        w, speed = 1.0 + f * c + g * s, np.sqrt(mu / p)
        u, t = c * F + s * G, c * G - s * F
        r, v = p / w * u, speed * ((c + f) * G - (s + g) * F)
        twice = 2.0 / (1.0 + h * h + k * k)
        by_h, by_k = twice * (F + k * n), twice * (G - h * n)  # how the axes turn
        columns = [
            np.concatenate([r / p, -v / (2.0 * p)], -1),
            np.concatenate([-c / w * r, speed * G], -1),
            np.concatenate([-s / w * r, -speed * F], -1),
            np.concatenate([np.cross(by_h, r), np.cross(by_h, v)], -1),
            np.concatenate([np.cross(by_k, r), np.cross(by_k, v)], -1),
            np.concatenate([p / w * t - (g * c - f * s) / w * r, -speed * u], -1),
        ]
        J = np.stack(columns, -1)
        return np.tile(_TURNED, 2)[:, None] * J * _SIGNS if self.retrograde else J

    def _turned(self, r: Array, v: Array) -> tuple[Array, Array]:
        return (r * _TURNED, v * _TURNED) if self.retrograde else (r, v)

    def _tilt(self, n: Array) -> tuple[Array, Array]:
        below = 1.0 + n[..., 2]
        if np.any(below == 0.0):
            at, other = ("0", "False") if self.retrograde else ("180", "True")
            raise ValueError(f"the inclination is {at} degrees, where these elements are singular; take retrograde={other}")
        return -n[..., 1] / below, n[..., 0] / below

    def _parts(self, elements: Any, mu: float) -> Array:
        check_mu(mu)
        elements = np.asarray(elements, dtype=float)
        if elements.shape[-1:] != (6,):
            raise ValueError(f"elements have shape {elements.shape}; they must be (..., 6)")
        parts: Array = np.moveaxis(elements * _SIGNS if self.retrograde else elements, -1, 0)
        p, f, g, L = parts[[0, 1, 2, 5]]
        if not np.all((p > 0.0) & np.isfinite(p)):
            raise ValueError(f"semi-latus rectum is {p[~(p > 0.0)].flat[0]:g}, which no orbit has")
        if np.any(1.0 + f * np.cos(L) + g * np.sin(L) <= 0.0):
            raise ValueError("a true longitude lies beyond the asymptotes of the hyperbola")
        return parts


def _frame(h: Array, k: Array) -> tuple[Array, Array]:
    """The first two of the equinoctial axes."""
    size = 1.0 + h * h + k * k
    F = np.stack([1.0 + h * h - k * k, 2.0 * h * k, -2.0 * k], -1)
    G = np.stack([2.0 * h * k, 1.0 - h * h + k * k, 2.0 * h], -1)
    return F / size[..., None], G / size[..., None]
