"""Orbits that others published of the same body, and how far an answer is from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.determination.centres import centre_of
from piazzi.determination.orbit import ECLIPTIC, TO_ECLIPTIC, Orbit
from piazzi.earth import Epoch, rotation
from piazzi.orbit import Keplerian, propagate_kepler
from piazzi.problem.checks import Array

KEYS = ("name", "date", "source", "epoch", "axes", "a", "e", "i", "node", "perihelion", "longitude")
ANGLES = ("i", "node", "perihelion", "longitude")


@dataclass(frozen=True)
class Published:
    """Elements as they were printed: two-body motion from there on.

    Attributes
    ----------
    name, date, source : who gave them, when and where
    epoch : of the mean longitude
    axes : "ecliptic J2000", or "ecliptic of date" with the mean equinox of the epoch
    a, e : m, and the eccentricity
    i, node, perihelion, longitude : inclination, longitudes of the node and of the perihelion, mean longitude at the epoch, rad
    """

    name: str
    date: str
    source: str
    epoch: Epoch
    axes: str
    a: float
    e: float
    i: float
    node: float
    perihelion: float
    longitude: float

    def table(self) -> dict[str, Any]:
        """What `published_of` reads: `a` in astronomical units, angles in degrees."""
        from piazzi.earth.constants import ASTRONOMICAL_UNIT

        angles = {key: np.degrees(getattr(self, key)) for key in ANGLES}
        numbers = {"a": self.a / ASTRONOMICAL_UNIT, "e": self.e, **angles}
        printed = {key: float(f"{value:.15g}") for key, value in numbers.items()}  # as it was before its change of units
        return {
            "name": self.name,
            "date": self.date,
            "source": self.source,
            "epoch": self.epoch.exact(),
            "axes": self.axes,
            **printed,
        }

    def state(self, epoch: Epoch, about: str) -> Array:
        """Position and velocity (6,) at a date, on the axes of the ICRF."""
        mu = centre_of(about).mu
        elements = (self.a, self.e, self.i, self.node, self.perihelion - self.node, self.longitude - self.perihelion)
        state = np.concatenate(Keplerian(anomaly="mean").to_state(np.array(elements), mu))
        if self.axes == ECLIPTIC:
            turned = np.kron(np.eye(2), rotation("EME2000", "ICRF", self.epoch)) @ TO_ECLIPTIC.T @ state
        else:
            turned = np.kron(np.eye(2), _of_date(self.epoch).T) @ state
        return np.concatenate(propagate_kepler(turned[:3], turned[3:], mu, epoch - self.epoch))


def _of_date(epoch: Epoch) -> Array:
    """From the ICRF to the mean ecliptic and equinox of a date, IAU 2006."""
    import erfa

    return np.asarray(erfa.ecm06(*epoch.jd("TT")))


def published_of(table: Any, where: str) -> Published:
    """Elements of a table: `a` in astronomical units, angles in degrees; ValueError for what is missing or unknown."""
    from piazzi.earth.constants import ASTRONOMICAL_UNIT

    if not isinstance(table, Mapping) or {*table} != {*KEYS}:
        raise ValueError(f"{where}: a published orbit has {', '.join(KEYS)}")
    axes = ("ecliptic of date", ECLIPTIC)
    if table["axes"] not in axes:
        raise ValueError(f"{where}: axes are {' or '.join(axes)}, not {str(table['axes'])[:40]!r}")
    angles = {key: float(np.radians(float(table[key]))) for key in ANGLES}
    texts: Any = {key: str(table[key]) for key in ("name", "date", "source", "axes")}
    numbers: Any = {**angles, "a": float(table["a"]) * ASTRONOMICAL_UNIT, "e": float(table["e"])}
    return Published(epoch=Epoch(table["epoch"]), **texts, **numbers)


def beside(orbit: Orbit, given: Published) -> dict[str, Any]:
    """How far the answer is from it where it stands: components in sigma, and the square of their joint distance."""
    epoch = orbit.epoch
    there = given.state(epoch, orbit.centre.name)
    axes = orbit.to(orbit.centre.frame)
    off, root = axes.at(epoch) - there, axes.root(epoch)
    sigma = np.sqrt(np.sum(root**2, axis=1))
    joint = float(np.sum(np.linalg.solve(root, off) ** 2))
    return {
        "name": given.name, "date": given.date, "source": given.source, "distance": float(np.linalg.norm(off[:3])),
        "in_sigma": (off / sigma).tolist(), "chi_square": joint,
    }  # fmt: skip
