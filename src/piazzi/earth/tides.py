"""Tides of the solid Earth that move stations, and the tide of the pole.

IERS Conventions 2010, 7.1.1 and 7.1.4.  The ITRF is tide-free: the permanent part of the tide stays in what `solid_tide` gives,
as the conventions have it.  Loading by the ocean and the air is left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.bodies import body
from piazzi.earth.eop import ARCSEC, SECULAR_POLE, decimal_year, tables
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.rotation import rotation
from piazzi.earth.scales import Orientation

# IERS Conventions 2010, 7.1.1: the Earth's radius (m), masses of Sun and Moon in masses of the Earth, Love and Shida numbers
RADIUS = 6378136.6
SHARED = 64  # times of tables, of a day each, whose sky is kept for the next station
SUN_MASS, MOON_MASS = 332946.0482, 0.0123000371
H2, H2_LATITUDE, L2, L2_LATITUDE = 0.6078, -0.0006, 0.0847, 0.0002
H3, L3 = 0.292, 0.015
H_DIURNAL, L_DIURNAL, H_SEMIDIURNAL, L_SEMIDIURNAL = -0.0025, -0.0007, -0.0022, -0.0007  # out of phase, eqs. 7.10 and 7.11
L1_DIURNAL, L1_SEMIDIURNAL = 0.0012, 0.0024  # eqs. 7.8 and 7.9

# Tables 7.3a and 7.3b: multiples of the mean longitudes s, h, p, N', p_s; then mm in phase and out of phase, radial and
# transverse.  A diurnal line has one tau besides.
_DIURNAL = np.array([
    [-3, 0, 2, 0, 0, -0.01, 0, 0, 0], [-3, 2, 0, 0, 0, -0.01, 0, 0, 0], [-2, 0, 1, -1, 0, -0.02, 0, 0, 0],
    [-2, 0, 1, 0, 0, -0.08, 0, -0.01, 0.01], [-2, 2, -1, 0, 0, -0.02, 0, 0, 0], [-1, 0, 0, -1, 0, -0.10, 0, 0, 0],
    [-1, 0, 0, 0, 0, -0.51, 0, -0.02, 0.03], [-1, 2, 0, 0, 0, 0.01, 0, 0, 0], [0, -2, 1, 0, 0, 0.01, 0, 0, 0],
    [0, 0, -1, 0, 0, 0.02, 0, 0, 0], [0, 0, 1, 0, 0, 0.06, 0, 0, 0], [0, 0, 1, 1, 0, 0.01, 0, 0, 0],
    [0, 2, -1, 0, 0, 0.01, 0, 0, 0], [1, -3, 0, 0, 1, -0.06, 0, 0, 0], [1, -2, 0, -1, 0, 0.01, 0, 0, 0],
    [1, -2, 0, 0, 0, -1.23, -0.07, 0.06, 0.01], [1, -1, 0, 0, -1, 0.02, 0, 0, 0], [1, -1, 0, 0, 1, 0.04, 0, 0, 0],
    [1, 0, 0, -1, 0, -0.22, 0.01, 0.01, 0], [1, 0, 0, 0, 0, 12.00, -0.80, -0.67, -0.03],
    [1, 0, 0, 1, 0, 1.73, -0.12, -0.10, 0], [1, 0, 0, 2, 0, -0.04, 0, 0, 0], [1, 1, 0, 0, -1, -0.50, -0.01, 0.03, 0],
    [1, 1, 0, 0, 1, 0.01, 0, 0, 0], [0, 1, 0, 1, -1, -0.01, 0, 0, 0], [1, 2, -2, 0, 0, -0.01, 0, 0, 0],
    [1, 2, 0, 0, 0, -0.11, 0.01, 0.01, 0], [2, -2, 1, 0, 0, -0.01, 0, 0, 0], [2, 0, -1, 0, 0, -0.02, 0, 0, 0],
])  # fmt: skip
_LONG = np.array([
    [0, 0, 0, 1, 0, 0.47, 0.16, 0.23, 0.07], [0, 2, 0, 0, 0, -0.20, -0.11, -0.12, -0.05],
    [1, 0, -1, 0, 0, -0.11, -0.09, -0.08, -0.04], [2, 0, 0, 0, 0, -0.13, -0.15, -0.11, -0.07],
    [2, 0, 0, 1, 0, -0.05, -0.06, -0.05, -0.03],
])  # fmt: skip


def station_displacement(position: Array, epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None) -> Array:
    """How far solid tide and pole tide move ITRF places (3,) or (K, 3), in metres along X, Y, Z."""
    epoch = epoch if isinstance(epoch, Epoch) else tuple(epoch)
    known: Any = tables() if eop is None else eop
    _, sun, moon = above(epoch, known)
    return solid_tide(position, sun, moon, epoch, eop) + pole_tide(position, epoch, eop)


@lru_cache(maxsize=SHARED)
def above(epoch: Epoch | tuple[Epoch, ...], eop: Any) -> tuple[Array, Array, Array]:
    """The matrix from the GCRF to the ITRF, and Sun and Moon in the ITRF (m), which all stations have in common."""
    turn = rotation("GCRF", "ITRF", epoch, eop)
    sun, moon = (np.einsum("...ij,...j->...i", turn, body(name, epoch)[0]) for name in ("sun", "moon"))
    for one in (turn, sun, moon):
        one.setflags(write=False)
    return turn, sun, moon


def solid_tide(
    position: Array, sun: Array, moon: Array, epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None
) -> Array:
    """Displacement of stations by the tides of the solid Earth, in metres along X, Y, Z of the ITRF.

    Parameters
    ----------
    position : (3,) or (K, 3), station in the ITRF, m
    sun, moon : (3,) or (K, 3), in the ITRF, m
    epoch : the instant, or K of them
    eop : orientation of the Earth, for UT1; default the tables of the IERS

    Returns
    -------
    (3,) or (K, 3); the permanent part is in it

    Notes
    -----
    Step 1 is degree 2, with Love and Shida numbers that depend on latitude and their parts out of phase, and degree 3.  Step 2
    corrects the lines of Tables 7.3a and 7.3b for their frequency.
    """
    r = np.asarray(position, dtype=float)
    distance = np.linalg.norm(r, axis=-1)
    up = r / distance[..., None]  # conventions use the geocentric latitude
    sp, cp = up[..., 2], np.hypot(up[..., 0], up[..., 1])
    longitude = np.arctan2(up[..., 1], up[..., 0])
    north = np.stack([-sp * np.cos(longitude), -sp * np.sin(longitude), cp], -1)
    east = np.stack([-np.sin(longitude), np.cos(longitude), np.zeros_like(longitude)], -1)
    moved = np.zeros(3)
    local = np.zeros(3)
    for ratio, other in ((SUN_MASS, sun), (MOON_MASS, moon)):
        away = np.linalg.norm(other, axis=-1)
        towards = np.asarray(other, dtype=float) / away[..., None]
        size = ratio * RADIUS * (RADIUS / away) ** 3
        moved = moved + _in_phase(up, towards, size, RADIUS / away)
        local = local + _out_of_phase(sp, cp, longitude, towards, size)
    local = local + 1e-3 * _by_frequency(sp, cp, longitude, *pairs(epoch), tables() if eop is None else eop)
    return np.asarray(moved + local[..., :1] * up + local[..., 1:2] * north + local[..., 2:] * east)


def _in_phase(up: Array, towards: Array, size: Array, parallax: Array) -> Array:
    """Degrees 2 and 3, eqs. 7.5 and 7.6."""
    cosine = np.sum(up * towards, axis=-1)
    p2 = (3.0 * up[..., 2] ** 2 - 1.0) / 2.0
    h2, l2 = H2 + H2_LATITUDE * p2, L2 + L2_LATITUDE * p2
    radial = h2 * (1.5 * cosine**2 - 0.5) + parallax * H3 * (2.5 * cosine**3 - 1.5 * cosine)
    across = 3.0 * l2 * cosine + parallax * L3 * (7.5 * cosine**2 - 1.5)
    return np.asarray(size[..., None] * (radial[..., None] * up + across[..., None] * (towards - cosine[..., None] * up)))


def _out_of_phase(sp: Array, cp: Array, longitude: Array, towards: Array, size: Array) -> Array:
    """Up, north, east of what depends on latitude (eqs. 7.8, 7.9) and of what lags behind (eqs. 7.10, 7.11)."""
    c = towards[..., 0] * np.cos(longitude) + towards[..., 1] * np.sin(longitude)  # in the station's meridian
    s = towards[..., 1] * np.cos(longitude) - towards[..., 0] * np.sin(longitude)  # east of it
    z = towards[..., 2]
    cos2 = cp**2 - sp**2
    up = 3.0 * sp * cp * H_DIURNAL * z * s + 1.5 * cp**2 * H_SEMIDIURNAL * c * s
    north = 3.0 * cos2 * L_DIURNAL * z * s - 3.0 * sp * cp * L_SEMIDIURNAL * c * s
    east = -3.0 * sp * L_DIURNAL * z * c - 1.5 * cp * L_SEMIDIURNAL * (c**2 - s**2)
    north = north - 3.0 * sp**2 * L1_DIURNAL * z * c - 1.5 * sp * cp * L1_SEMIDIURNAL * (c**2 - s**2)
    east = east - 3.0 * sp * cos2 * L1_DIURNAL * z * s + 3.0 * sp**2 * cp * L1_SEMIDIURNAL * c * s
    return np.asarray(size[..., None] * np.stack([up, north, east], -1))


def _by_frequency(sp: Array, cp: Array, longitude: Array, whole: Array, fraction: Array, eop: Orientation) -> Array:
    """Up, north, east in mm of the lines of Tables 7.3a and 7.3b (eqs. 7.12 and 7.13)."""
    gmst, angles = _arguments(whole, fraction, eop)
    day = np.asarray(gmst + np.pi - angles[..., 0] + longitude)[..., None] + angles @ _DIURNAL[:, :5].T
    sine, cosine = np.sin(day), np.cos(day)
    rip, rop, tip, top = _DIURNAL[:, 5:].T
    up = 2.0 * sp * cp * (sine @ rip + cosine @ rop)
    north = (cp**2 - sp**2) * (sine @ tip + cosine @ top)
    east = sp * (cosine @ tip - sine @ top)
    slow = angles @ _LONG[:, :5].T
    sine, cosine = np.sin(slow), np.cos(slow)
    rip, rop, tip, top = _LONG[:, 5:].T
    up = up + (1.5 * sp**2 - 0.5) * (cosine @ rip + sine @ rop)
    north = north + 2.0 * sp * cp * (cosine @ tip + sine @ top)
    return np.stack([up, north, east], -1)


def _arguments(whole: Array, fraction: Array, eop: Orientation) -> tuple[Array, Array]:
    """Greenwich mean sidereal time and the mean longitudes s, h, p, N', p_s, (..., 5), in radians; Conventions 5.43."""
    import erfa

    tt = scales.days(whole, fraction)
    behind = scales.TT_TAI - eop.ut1_tai(whole, fraction)
    ut1 = scales.days(*scales.normalized(whole, fraction - behind))
    t = ((tt[0] - 2451545.0) + tt[1]) / 36525.0
    node = erfa.faom03(t)
    s = erfa.faf03(t) + node
    h = s - erfa.fad03(t)
    longitudes = np.stack(np.broadcast_arrays(s, h, s - erfa.fal03(t), -node, h - erfa.falp03(t)), -1)
    return np.asarray(erfa.gmst06(*ut1, *tt)), longitudes


def pole_tide(position: Array, epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None) -> Array:
    """Displacement of ITRF places (3,) or (K, 3) by the motion of the pole about its secular place, in metres along X, Y, Z.

    Eq. 7.26 of the IERS Conventions 2010 with the secular pole of their update of 2018.
    """
    m1, m2 = wobble(epoch, eop)
    r = np.asarray(position, dtype=float)
    longitude = np.arctan2(r[..., 1], r[..., 0])
    sp, cp = (value / np.linalg.norm(r, axis=-1) for value in (r[..., 2], np.hypot(r[..., 0], r[..., 1])))
    cl, sl = np.cos(longitude), np.sin(longitude)
    along, across = m1 * cl + m2 * sl, m1 * sl - m2 * cl
    up = -0.033 * 2.0 * sp * cp * along
    north = 0.009 * (sp**2 - cp**2) * along
    east = 0.009 * sp * across
    return np.stack([
        (up * cp - north * sp) * cl - east * sl, (up * cp - north * sp) * sl + east * cl, up * sp + north * cp,
    ], -1)  # fmt: skip


def wobble(epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None) -> tuple[Array, Array]:
    """The pole's place beside its secular one, m1 and m2 in seconds of arc; eq. 7.24 with the update of 2018."""
    whole, fraction = pairs(epoch)
    pole = (tables() if eop is None else eop).pole(whole, fraction).values / ARCSEC
    years = decimal_year(whole) - 2000.0
    (x, x_rate), (y, y_rate) = SECULAR_POLE
    return pole[..., 0] - (x + x_rate * years), -(pole[..., 1] - (y + y_rate * years))
