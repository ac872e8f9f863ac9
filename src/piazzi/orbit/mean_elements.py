"""Orbits of the SGP4 theory: states of two-line elements and OMM at any date, and a covariance for them as a prior."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, transform
from piazzi.formats.ephemeris import MeanElements
from piazzi.orbit.axes import state_axes

MU = 3.986008e14  # m^3/s^2 of WGS 72, which the theory is fitted with
_DAY = 86400.0
_FAULTS = {
    1: "the mean eccentricity has left 0 to 1",
    2: "the mean motion is negative",
    3: "the perturbed eccentricity has left 0 to 1",
    4: "the semi-latus rectum is negative",
    6: "the orbit has decayed",
}


def read_tle(text: str) -> MeanElements:
    """The mean elements of one two-line set, given as text with or without a line of the name.

    Raises
    ------
    ValueError
        With line and reason, for a wrong checksum among others, and where the text holds another number of sets.
    """
    from piazzi.formats.conventions import Conventions
    from piazzi.formats.tle import read

    found = read(text.encode(), "two-line elements", Conventions()).mean
    if len(found) != 1:
        raise ValueError(
            f"the text holds {len(found)} two-line element sets; it must be one (read_ephemeris reads files of many)"
        )
    return found[0]


def sgp4_states(mean: MeanElements, epochs: Epoch | Sequence[Epoch], frame: str = "TEME") -> tuple[Array, Array]:
    """Position (m) and velocity (m/s) of mean elements at dates, (3,) at one epoch or (K, 3) at K.

    Parameters
    ----------
    mean : of a two-line set or an OMM of the theory SGP4
    epochs : one or several
    frame : axes of the answer; see `piazzi.earth.rotation`

    Raises
    ------
    ValueError
        For elements of another theory, or where the theory fails, as after a decay: with the date.

    Notes
    -----
    The states of the theory are in TEME, with the constants of WGS 72.  Times are seconds since the epoch of the elements, so
    that a leap second between counts.  Source: Vallado et al., Revisiting Spacetrack Report 3, AIAA 2006-6753, by the package
    `sgp4`.
    """
    one = isinstance(epochs, Epoch)
    dates = [epochs] if isinstance(epochs, Epoch) else list(epochs)
    satellite = _satellite(mean)
    since = np.array([(date - mean.epoch) / _DAY for date in dates])
    fault, r, v = satellite.sgp4_array(
        np.full(len(dates), satellite.jdsatepoch), np.asarray(satellite.jdsatepochF + since, dtype=float)
    )
    if np.any(fault):
        k = int(np.argmax(fault != 0))
        reason = _FAULTS.get(int(fault[k]), f"fault {fault[k]}")
        raise ValueError(f"SGP4 has no state of {mean.called} at {dates[k]}: {reason}")
    r, v = 1e3 * r, 1e3 * v
    if frame.strip().upper() != "TEME":
        r, turned = transform(r, v, "TEME", frame, dates)
        v = np.asarray(turned)
    return (r[0], v[0]) if one else (r, v)


def sgp4_covariance(
    mean: MeanElements,
    epoch: Epoch,
    frame: str = "GCRF",
    sigma: tuple[float, float, float] = (1000.0, 1000.0, 1000.0),
    growth: float = 2000.0,
) -> Array:
    """A covariance (6, 6) in m and m/s for the state of mean elements, as a prior where none comes with them.

    Parameters
    ----------
    mean, epoch, frame : as of `sgp4_states`; the epoch of the prior
    sigma : of the position at the epoch of the elements along R, T and N, m
    growth : of the error along T, m per day of age

    Returns
    -------
    (6, 6) ndarray, positive definite: velocities go with the positions as on an orbit that is a little turned, moved on, or
    of another period, whose sigma is what makes `growth`

    Notes
    -----
    A rule of thumb, no statistic of the object: public elements in low orbit are off by about 1 km at their epoch,
    and by 1 to 3 km
    more with each day (T. S. Kelso, CelesTrak; AAS 07-127 for high orbits, where several km are common).  Right for small
    eccentricities.
    """
    r, v = sgp4_states(mean, epoch, frame)
    if not (min(sigma) > 0.0 and growth > 0.0):
        raise ValueError(f"sigma is {sigma} and growth {growth}; all must be positive")
    n = dict(mean.elements)["mean_motion"] if "mean_motion" in dict(mean.elements) else np.sqrt(MU / np.linalg.norm(r) ** 3)
    R, T, N = sigma
    late = growth * abs(epoch - mean.epoch) / _DAY
    axis = 2.0 * growth / (3.0 * n * _DAY)  # error of the semi-major axis that makes this drift
    root = np.zeros((6, 6))
    root[[0, 4], 0] = R, -n * R
    root[[1, 3], 1] = T, -n * T
    root[2, 2] = N
    root[5, 3] = n * N
    root[3, 4] = n * R
    root[[1, 3, 4], 5] = -late, n * late, 0.5 * n * axis
    moved = state_axes(r, v, "RTN").T @ root
    return np.asarray(moved @ moved.T)


@lru_cache(maxsize=256)
def _satellite(mean: MeanElements) -> Any:
    """The object of the package that has the theory's constants of these elements."""
    from sgp4.api import WGS72, Satrec

    if mean.theory.upper().replace("/", "").replace(" ", "") not in ("SGP4", "SGPSGP4", "SDP4", "SGP4SDP4"):
        raise ValueError(f"mean elements of {mean.called} are of the theory {mean.theory}; SGP4 is known")
    values, said = dict(mean.elements), dict(mean.said)
    if "mean_motion" not in values:
        raise ValueError(f"mean elements of {mean.called} have no mean motion, which SGP4 needs")
    jd, part = mean.epoch.jd("UTC")
    satellite = Satrec()
    satellite.sgp4init(
        WGS72, "i", 0, (jd - 2433281.5) + part, float(said.get("BSTAR", 0.0)), 0.0, 0.0, values["eccentricity"],
        values["argument_of_pericentre"], values["inclination"], values["mean_anomaly"], 60.0 * values["mean_motion"],
        values["ascending_node"],
    )  # fmt: skip
    return satellite
