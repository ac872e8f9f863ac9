"""Mean elements of the SGP4 theory that come nearest to an orbit: least squares on the positions of the theory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, transform
from piazzi.formats.ephemeris import MeanElements
from piazzi.orbit.equinoctial import Equinoctial
from piazzi.orbit.mean_elements import MU, sgp4_states
from piazzi.orbit.paths import opened, path_of
from piazzi.text import brief

# mean motion (relative), h, k, p, q, mean longitude, and the drag term in 1/Earth radii: steps of differences
_STEPS = np.array([1e-7, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-5])
_PASSES = 30


@dataclass(frozen=True, eq=False)
class MeanFit:
    """Mean elements and how well they fit.

    Attributes
    ----------
    mean : elements, which `sgp4_states` and the writer of OMM take
    residuals : (K, 3) m, position given minus that of the theory, in TEME
    rms : m, of the distances
    """

    mean: MeanElements
    residuals: Array
    rms: float

    __repr__ = brief


def fit_sgp4(
    orbit: Any,
    *,
    object: str | None = None,  # noqa: A002  # as `difference` calls it
    epoch: Epoch | None = None,
    drag: bool = False,
) -> MeanFit:
    """The mean elements whose positions by SGP4 come nearest to the rows of an ephemeris.

    Parameters
    ----------
    orbit : a file (OEM, SP3, CPF), an `Ephemeris` or one of its arcs
    object : name or identifier of the object in a file of several
    epoch : of the elements; default the date of the middle row
    drag : whether the drag term is fitted too: it takes days, or a low orbit; else it is 0

    Raises
    ------
    ValueError
        For fewer rows than the elements need, an orbit that is no ellipse, or a fit that does not converge.

    Notes
    -----
    Gauss and Newton's method in equinoctial elements, so that circular and equatorial orbits are no exception.
    Source: Vallado and Crawford, SGP4 orbit determination, AIAA 2008-6770.
    """
    title, arcs = opened(orbit, object)
    if not isinstance(arcs, tuple):
        raise ValueError(f"{title} has no rows; mean elements are fitted to those of an ephemeris")
    path = path_of(title, arcs, arcs[0].epoch, None)
    t = path.rows()
    dates = [arcs[0].epoch + float(s) for s in t[path.covered(t)]]
    count = 7 if drag else 6
    if 3 * len(dates) < count + 3:
        raise ValueError(f"{title} has {len(dates)} rows; {count} mean elements need more")
    moved, turned = transform(*path.states(t[path.covered(t)]), "GCRF", "TEME", dates)
    target, speed = np.asarray(moved), np.asarray(turned)
    middle = len(dates) // 2
    zero = dates[middle] if epoch is None else epoch
    about = {"epoch": zero, "name": arcs[0].name, "identifier": arcs[0].identifier}
    x = np.zeros(7)
    x[:6] = Equinoctial().from_state(target[middle], speed[middle], MU)
    x[0] = np.sqrt(MU / x[0] ** 3)
    x[5] += x[0] * (zero - dates[middle])

    def residuals(x: Array) -> Array:
        return np.asarray((target - sgp4_states(_mean(x, about), dates)[0]).reshape(-1))

    left = residuals(x)
    for _ in range(_PASSES):
        columns = []
        for j in range(count):
            step = np.zeros(7)
            step[j] = _STEPS[j] * (x[0] if j == 0 else 1.0)
            columns.append((residuals(x + step) - residuals(x - step)) / (2.0 * step[j]))
        J = np.stack(columns, -1)
        size = np.linalg.norm(J, axis=0)
        change = np.zeros(7)
        change[:count] = -np.linalg.lstsq(J / size, left, rcond=None)[0] / size
        x, left, before = *_shorter(x, change, left, residuals), left
        if abs(np.linalg.norm(before) - np.linalg.norm(left)) <= 1e-9 * np.linalg.norm(before) + 1e-9:
            rows = left.reshape(-1, 3)
            return MeanFit(_mean(x, about), rows, float(np.sqrt(np.mean(np.sum(rows**2, axis=1)))))
    raise ValueError(f"the fit of mean elements does not converge: {np.linalg.norm(left) / np.sqrt(len(dates)):.3g} m are left")


def _shorter(x: Array, change: Array, left: Array, residuals: Any) -> tuple[Array, Array]:
    """The step, halved until it comes nearer; where it does not, what there was."""
    for _ in range(12):
        try:
            new = residuals(x + change)
        except ValueError:  # the theory has no such orbit
            new = np.array([np.inf])
        if np.linalg.norm(new) < np.linalg.norm(left):
            return x + change, new
        change = 0.5 * change
    return x, left


def _mean(x: Array, about: dict[str, Any]) -> MeanElements:
    """Mean elements of equinoctial ones."""
    n, h, k, p, q, longitude, drag = (float(value) for value in x)
    pericentre, node = np.arctan2(h, k), np.arctan2(p, q)
    angles = [2.0 * np.arctan(np.hypot(p, q)), node, pericentre - node, longitude - pericentre]
    names = ("inclination", "ascending_node", "argument_of_pericentre", "mean_anomaly")
    wrapped = [angles[0], *(float(angle % (2.0 * np.pi)) for angle in angles[1:])]
    elements = (("mean_motion", n), ("eccentricity", float(np.hypot(h, k))))
    return MeanElements(
        theory="SGP4", elements=(*elements, *zip(names, map(float, wrapped), strict=True)), centre="EARTH", frame="TEME",
        scale="UTC", said=(("EPHEMERIS_TYPE", "0"), ("CLASSIFICATION_TYPE", "U"), ("NORAD_CAT_ID", "0"),
        ("ELEMENT_SET_NO", "0"), ("REV_AT_EPOCH", "0"), ("BSTAR", repr(drag)), ("MEAN_MOTION_DOT", "0.0"),
        ("MEAN_MOTION_DDOT", "0.0")),
        **about,
    )  # fmt: skip
