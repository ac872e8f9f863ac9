"""Keplerian elements of any conic, to and from states, with the derivatives of both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.anomalies import check_kind, from_true, to_true, true_partials
from piazzi.orbit.differential import check_mu, differential, motion, states

SIZES = {"a": "semi-major axis", "p": "semi-latus rectum", "q": "distance of the pericentre"}
_NO_DIGITS = 1e-12  # e or sin i below which a derivative by them is nothing but rounding


@dataclass(frozen=True)
class Keplerian:
    """Keplerian elements (..., 6): size, eccentricity, inclination, ascending node, argument of the pericentre, anomaly.

    Parameters
    ----------
    anomaly : "true", "eccentric" (hyperbolic on a hyperbola) or "mean"
    size : "a", the semi-major axis, negative on a hyperbola; "p", the semi-latus rectum; "q", the distance of the pericentre

    Notes
    -----
    Lengths are in the unit of the position, angles in radians, all in (-pi, pi] but the inclination, in [0, pi].

    A circular orbit has no pericentre, and an equatorial one no node.  Where the eccentricity is exactly zero, the
    anomaly is 0;
    where the inclination is, the node is 0.  Next to that they are what rounding makes of them.  Either way the
    state comes back
    to its last digits; derivatives by it do not exist, which equinoctial elements have.  A parabola has no
    semi-major axis (it comes out infinite): take "p" or "q".
    Source: Vallado, Fundamentals of Astrodynamics and Applications (2013), sections 2.4 to 2.6; derivatives derived here.
    """

    anomaly: str = "true"
    size: str = "a"

    def __post_init__(self) -> None:
        check_kind(self.anomaly)
        if self.size not in SIZES:
            raise ValueError(f"size {self.size!r} is not known; there are {', '.join(SIZES)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the six elements."""
        return (self.size, "e", "i", "node", "argument", f"{self.anomaly} anomaly")

    units: ClassVar[tuple[str, ...]] = ("m", "", "rad", "rad", "rad", "rad")

    def from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Elements (..., 6) of position and velocity (..., 3).

        Raises
        ------
        ValueError
            For what is no state (see `mu`, shapes, finite values), or motion along a straight line through the centre.
        """
        r, v = states(r, v, mu)
        m = motion(r, v, mu)
        e, true = np.hypot(m.c, m.s), np.arctan2(m.s, m.c)
        inclination, node, latitude = _angles(m.u, m.t, m.n)
        with np.errstate(divide="ignore"):
            size = {"a": 1.0 / m.alpha, "p": m.p, "q": m.p / (1.0 + e)}[self.size]
        argument = _wrapped(latitude - true)
        return np.stack([size, e, inclination, node, argument, from_true(true, e, self.anomaly)], -1)

    def to_state(self, elements: Any, mu: float) -> tuple[Array, Array]:
        """Position and velocity (..., 3) of elements.

        Raises
        ------
        ValueError
            Where elements belong to no orbit: a size of the wrong sign, an anomaly beyond the asymptotes, a parabola by its
            semi-major axis.
        """
        p, e, true, angles = self._shape(elements, mu)
        P, Q, _ = _frame(*angles)
        c, s, w = np.cos(true), np.sin(true), 1.0 + e * np.cos(true)
        speed = np.sqrt(mu / p)
        r = (p / w)[..., None] * (c[..., None] * P + s[..., None] * Q)
        v = speed[..., None] * (-s[..., None] * P + (e + c)[..., None] * Q)
        return r, v

    def jacobian_from_state(self, r: Any, v: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of the elements by position and velocity.

        Raises
        ------
        ValueError
            As `from_state`; for a circular or equatorial orbit, where it does not exist; for a parabola, unless the
            anomaly is
            true and the size another than "a".
        """
        r, v = states(r, v, mu)
        m = motion(r, v, mu)
        e, true = np.hypot(m.c, m.s), np.arctan2(m.s, m.c)
        inclination, _, latitude = _angles(m.u, m.t, m.n)
        self._check_regular(e, inclination)
        d = differential(m, v, mu)
        cos, sin = np.cos(true)[..., None], np.sin(true)[..., None]
        de = cos * d.c + sin * d.s
        dtrue = (cos * d.s - sin * d.c) / e[..., None]
        cl, sl = np.cos(latitude)[..., None], np.sin(latitude)[..., None]
        di = cl * d.about_u - sl * d.about_t
        dnode = (sl * d.about_u + cl * d.about_t) / np.sin(inclination)[..., None]
        dlatitude = d.about_n - np.cos(inclination)[..., None] * dnode
        by_anomaly, by_e = true_partials(true, e, self.anomaly)
        danomaly = (dtrue - by_e[..., None] * de) / by_anomaly[..., None]
        size_by, size_by_e = self._size_partials(m.p, e)
        dsize = size_by[..., None] * d.p + size_by_e[..., None] * de
        return np.stack([dsize, de, di, dnode, dlatitude - dtrue, danomaly], -2)

    def jacobian_to_state(self, elements: Any, mu: float) -> Array:
        """Derivative (..., 6, 6) of position and velocity by the elements, for circular and equatorial orbits too."""
        elements = np.asarray(elements, dtype=float)
        p, e, true, angles = self._shape(elements, mu)
        P, Q, n = _frame(*angles)
        c, s = np.cos(true)[..., None], np.sin(true)[..., None]
        w, speed = 1.0 + e[..., None] * c, np.sqrt(mu / p)[..., None]
        u, t = c * P + s * Q, c * Q - s * P
        pp, ee = p[..., None], e[..., None]
        r, v = pp / w * u, speed * (ee * Q + t)
        by_p = np.concatenate([r / pp, -v / (2.0 * pp)], -1)
        by_e = np.concatenate([-c / w * r, speed * Q], -1)
        by_true = np.concatenate([pp * ee * s / w**2 * u + pp / w * t, -speed * u], -1)
        line = np.stack([np.cos(angles[1]), np.sin(angles[1]), np.zeros_like(p)], -1)
        axes = (line, np.broadcast_to([0.0, 0.0, 1.0], n.shape), n)
        by_angles = [np.concatenate([np.cross(axis, r), np.cross(axis, v)], -1) for axis in axes]
        true_by, true_by_e = true_partials(true, e, self.anomaly)
        size_by, size_by_e = self._size_partials(p, e)
        by_e = by_e - (size_by_e / size_by)[..., None] * by_p + true_by_e[..., None] * by_true
        return np.stack([by_p / size_by[..., None], by_e, *by_angles, true_by[..., None] * by_true], -1)

    def _shape(self, elements: Any, mu: float) -> tuple[Array, Array, Array, tuple[Array, Array, Array]]:
        """Semi-latus rectum, eccentricity, true anomaly and the three angles of the axes."""
        check_mu(mu)
        elements = np.asarray(elements, dtype=float)
        if elements.shape[-1:] != (6,):
            raise ValueError(f"elements have shape {elements.shape}; they must be (..., 6)")
        size, e, i, node, argument, anomaly = np.moveaxis(elements, -1, 0)
        if np.any(e < 0.0):
            raise ValueError(f"eccentricity is {e[e < 0.0].flat[0]:g}; it must not be negative")
        if self.size == "a" and np.any(e == 1.0):
            raise ValueError("a parabola has no semi-major axis: give its size as p or q")
        p = {"a": size * (1.0 - e) * (1.0 + e), "p": size, "q": size * (1.0 + e)}[self.size]
        wrong = ~((p > 0.0) & np.isfinite(p))
        if wrong.any():
            raise ValueError(
                f"{SIZES[self.size]} is {size[wrong].flat[0]:g} at eccentricity {e[wrong].flat[0]:g}, which no orbit has"
            )
        true = to_true(anomaly, e, self.anomaly)
        if np.any(1.0 + e * np.cos(true) <= 0.0):
            raise ValueError(f"a true anomaly of {np.degrees(true.flat[0]):g} deg lies beyond the asymptotes of the hyperbola")
        return p, e, true, (i, node, argument)

    def _size_partials(self, p: Array, e: Array) -> tuple[Array, Array]:
        """Derivatives of the size by p and by e."""
        if self.size == "p":
            return np.ones_like(p), np.zeros_like(p)
        if self.size == "q":
            return 1.0 / (1.0 + e), -p / (1.0 + e) ** 2
        if np.any(e == 1.0):
            raise ValueError("a parabola has no semi-major axis: take its size as p or q")
        off = (1.0 - e) * (1.0 + e)
        return 1.0 / off, 2.0 * e * p / off**2

    def _check_regular(self, e: Array, inclination: Array) -> None:
        if np.any(e < _NO_DIGITS):
            raise ValueError("the orbit is circular: it has no pericentre and no derivatives by it; take equinoctial elements")
        if np.any(np.sin(inclination) < _NO_DIGITS):
            raise ValueError("the orbit is equatorial: it has no node and no derivatives by it; take equinoctial elements")


def _angles(u: Array, t: Array, n: Array) -> tuple[Array, Array, Array]:
    """Inclination, node and argument of latitude of axes."""
    sine = np.hypot(n[..., 0], n[..., 1])
    node = np.where(sine > 0.0, np.arctan2(n[..., 0], -n[..., 1]), 0.0)
    latitude = np.where(sine > 0.0, np.arctan2(u[..., 2], t[..., 2]), np.arctan2(u[..., 1] * np.sign(n[..., 2]), u[..., 0]))
    return np.arctan2(sine, n[..., 2]), node, latitude


def _frame(i: Array, node: Array, argument: Array) -> tuple[Array, Array, Array]:
    """Unit vectors to the pericentre, a quarter of a turn on, and normal to the orbit."""
    ci, si, cn, sn, cw, sw = np.cos(i), np.sin(i), np.cos(node), np.sin(node), np.cos(argument), np.sin(argument)
    P = np.stack([cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si], -1)
    Q = np.stack([-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si], -1)
    return P, Q, np.stack([sn * si, -cn * si, ci], -1)


def _wrapped(angle: Array) -> Array:
    return np.asarray(angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi)))
