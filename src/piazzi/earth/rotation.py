"""From one set of axes to another: the IAU 2006/2000A precession and nutation, the turn of the Earth, and the pole.

Frames by their CCSDS names.

* `ICRF` and `GCRF` have the same axes; `EME2000` is the mean equator and equinox of J2000, 23 mas from them.
* `MOD` and `TOD` are of date by IAU 2006 and 2000A, `MOD_1976` and `TOD_1980` by the theories that old files mean.
* `CIRS` goes with the celestial intermediate origin.
* `TEME` is that of the SGP4 theory: the Greenwich mean sidereal time of 1982 turns it into `PEF`, without kinematic terms
  (Vallado et al., AIAA 2006-6753).
* `PEF`, or TIRS, is `ITRF` without the motion of the pole.

ITRF and PEF turn, and their rates are complete: turn of the Earth with the length of day, precession and nutation, motion of
the pole.  The axes of date are those of the instant: velocities are only turned into them.

Sources: IERS Conventions 2010, ch. 5; ERFA does the series.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import scales
from piazzi.earth.eop import tables
from piazzi.earth.epoch import Epoch, pairs
from piazzi.earth.scales import Orientation

FRAMES = ("GCRF", "ICRF", "EME2000", "MOD", "TOD", "MOD_1976", "TOD_1980", "CIRS", "TEME", "PEF", "ITRF")
TURNING = ("ITRF", "PEF")
_ALIASES = {"J2000": "EME2000", "TIRS": "PEF", "GCRS": "GCRF", "ICRS": "ICRF", "ITRS": "ITRF"}
_ERA_RATE = 2.0 * np.pi * 1.00273781191135448 / scales.DAY  # rad per second of UT1 (IERS Conventions 2010, eq. 5.15)
_STEP = 60.0  # s: half the span of differences that give the rate of precession and nutation, to 1e-21 rad/s


def frame_named(name: str) -> str:
    """The frame of that name; realisations of the ITRF (``ITRF2014``) are `ITRF`, centimetres from one another."""
    plain = name.strip().upper().replace("-", "").replace(" ", "")
    plain = _ALIASES.get(plain, plain)
    if plain in FRAMES:
        return plain
    if plain.startswith("ITRF") and plain[4:].isdigit():
        return "ITRF"
    raise ValueError(f"frame {name!r} is not known; there are {', '.join(FRAMES)}")


def rotation(origin: str, target: str, epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None) -> Array:
    """Matrix that turns components in one frame into those in another.

    Parameters
    ----------
    origin, target : names of frames
    epoch : the instant, or K of them
    eop : orientation of the Earth; default the tables of the IERS

    Returns
    -------
    (3, 3) or (K, 3, 3), orthogonal

    Raises
    ------
    ValueError
        Where a frame is not known.

    Warns
    -----
    EOPWarning
        Where the tables do not reach, with what that costs in metres on the ground; once.
    """
    return _between(frame_named(origin), frame_named(target), *pairs(epoch), tables() if eop is None else eop, False)[0]


def rotation_rate(
    origin: str, target: str, epoch: Epoch | Iterable[Epoch], eop: Orientation | None = None
) -> tuple[Array, Array]:
    """The matrix of `rotation` and its derivative by time, per second of TT; zero between frames that do not turn."""
    return _between(frame_named(origin), frame_named(target), *pairs(epoch), tables() if eop is None else eop)


def transform(
    position: Array,
    velocity: Array | None,
    origin: str,
    target: str,
    epoch: Epoch | Iterable[Epoch],
    eop: Orientation | None = None,
) -> tuple[Array, Array | None]:
    """A position (m) and velocity (m/s, relative to the axes), (3,) or (K, 3), in another frame.

    A velocity that is None stays None.  Raises ValueError where a frame is not known or a shape is wrong.
    """
    r = _vectors(position, "position")
    R, rate = rotation_rate(origin, target, epoch, eop)
    turned = _times(R, r)
    if velocity is None:
        return turned, None
    v = _vectors(velocity, "velocity")
    return turned, _times(R, v) + _times(rate, r)


def _vectors(values: Array, what: str) -> Array:
    vectors = np.asarray(values, dtype=float)
    if vectors.shape[-1:] != (3,) or vectors.ndim > 2:
        raise ValueError(f"{what} has shape {vectors.shape}; it must be (3,) or (K, 3)")
    return vectors


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _between(
    origin: str, target: str, whole: Array, fraction: Array, eop: Orientation, rates: bool = True
) -> tuple[Array, Array]:
    """Matrix from one frame to another and its rate, by way of the GCRF; without `rates`, that of the equator is left out."""
    if origin == target or {origin, target} == {"GCRF", "ICRF"}:
        one = np.broadcast_to(np.eye(3), (*whole.shape, 3, 3)).copy()
        return one, np.zeros_like(one)
    a, da = _from_gcrf(origin, whole, fraction, eop, rates)
    b, db = _from_gcrf(target, whole, fraction, eop, rates)
    back = np.swapaxes(a, -1, -2)
    return b @ back, db @ back + b @ np.swapaxes(da, -1, -2)


def _from_gcrf(frame: str, whole: Array, fraction: Array, eop: Orientation, rates: bool) -> tuple[Array, Array]:
    """Matrix from the GCRF into a frame, and its rate."""
    if frame in TURNING:
        return _earth_fixed(frame, whole, fraction, eop, rates)
    matrix = _TABLE[frame](whole, fraction, eop)
    matrix = np.broadcast_to(matrix, (*whole.shape, 3, 3))
    return matrix, np.zeros_like(matrix)


def _celestial(whole: Array, fraction: Array, eop: Orientation) -> Array:
    """GCRF to CIRS with the celestial pole offsets."""
    import erfa

    one, two = scales.days(whole, fraction)
    x, y, s = erfa.xys06a(one, two)
    offsets = eop.pole(whole, fraction).values
    return np.asarray(erfa.c2ixys(x + offsets[..., 2], y + offsets[..., 3], s))


def _earth_fixed(frame: str, whole: Array, fraction: Array, eop: Orientation, rates: bool) -> tuple[Array, Array]:
    """GCRF to PEF or ITRF: W R3(ERA) Q and the derivative of each factor."""
    import erfa

    Q = _celestial(whole, fraction, eop)
    dQ = np.zeros_like(Q)
    if rates:  # which takes two thirds of the time
        dQ = (_celestial(whole + _STEP, fraction, eop) - _celestial(whole - _STEP, fraction, eop)) / (2.0 * _STEP)
    turn, rate = _turn(whole, fraction, eop)
    R, dR = turn @ Q, rate @ Q + turn @ dQ
    if frame == "PEF":
        return R, dR
    pole, moves = eop.pole(whole, fraction)
    s_prime = erfa.sp00(*scales.days(whole, fraction))
    W = erfa.pom00(pole[..., 0], pole[..., 1], s_prime)
    ahead = erfa.pom00(pole[..., 0] + _STEP * moves[..., 0], pole[..., 1] + _STEP * moves[..., 1], s_prime)
    behind = erfa.pom00(pole[..., 0] - _STEP * moves[..., 0], pole[..., 1] - _STEP * moves[..., 1], s_prime)
    return W @ R, W @ dR + (ahead - behind) / (2.0 * _STEP) @ R


def _turn(whole: Array, fraction: Array, eop: Orientation) -> tuple[Array, Array]:
    """R3 of the Earth rotation angle, and its rate by TT."""
    import erfa

    angle = erfa.era00(*_ut1(whole, fraction, eop))
    rate = _ERA_RATE * (1.0 + eop.ut1_rate(whole, fraction))
    return _about_z(angle), rate[..., None, None] * _about_z_derivative(angle)


def _ut1(whole: Array, fraction: Array, eop: Orientation) -> tuple[Array, Array]:
    """Julian date of UT1 as two numbers."""
    behind = scales.TT_TAI - eop.ut1_tai(whole, fraction)
    return scales.days(*scales.normalized(whole, fraction - behind))


def _about_z(angle: Array) -> Array:
    c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.stack([np.stack([c, s, o], -1), np.stack([-s, c, o], -1), np.stack([o, o, o + 1.0], -1)], -2)


def _about_z_derivative(angle: Array) -> Array:
    c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    return np.stack([np.stack([-s, c, o], -1), np.stack([-c, -s, o], -1), np.stack([o, o, o], -1)], -2)


def _bias(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    return np.asarray(erfa.bp06(2451545.0, 0.0)[0])


def _mean_of_date(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    return np.asarray(erfa.pmat06(*scales.days(whole, fraction)))


def _true_of_date(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    return np.asarray(erfa.pnm06a(*scales.days(whole, fraction)))


def _mean_1976(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    return np.asarray(erfa.pmat76(*scales.days(whole, fraction)) @ _bias(whole, fraction, eop))


def _true_1980(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    return np.asarray(erfa.nutm80(*scales.days(whole, fraction)) @ _mean_1976(whole, fraction, eop))


def _teme(whole: Array, fraction: Array, eop: Orientation) -> Array:
    import erfa

    gmst = erfa.gmst82(*_ut1(whole, fraction, eop))
    pef = _turn(whole, fraction, eop)[0] @ _celestial(whole, fraction, eop)
    return np.asarray(np.swapaxes(_about_z(gmst), -1, -2) @ pef)


_TABLE: dict[str, Callable[[Array, Array, Orientation], Array]] = {
    "GCRF": lambda whole, fraction, eop: np.eye(3),
    "ICRF": lambda whole, fraction, eop: np.eye(3),
    "EME2000": _bias,
    "MOD": _mean_of_date,
    "TOD": _true_of_date,
    "MOD_1976": _mean_1976,
    "TOD_1980": _true_1980,
    "CIRS": _celestial,
    "TEME": _teme,
}
