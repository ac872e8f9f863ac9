"""An orbit about the Sun: in the plane of the ecliptic, and on the sky with the ellipse of the prediction."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.determination.page.sampled import Sampled
from piazzi.earth import body
from piazzi.earth.constants import ASTRONOMICAL_UNIT
from piazzi.evaluate.quantities import Display, display_of
from piazzi.present.report.blocks import Orbit, Section, Track
from piazzi.problem.checks import Array

OBLIQUITY = np.radians(84381.406 / 3600.0)  # of the ecliptic of J2000 to the axes, IAU 2006
PLANETS = ("mercury", "venus", "earth", "mars", "jupiter", "saturn")
_AU = Display("AU", 1.0 / ASTRONOMICAL_UNIT)
_WORDS = (
    "Seen from the north of the ecliptic with the planets, and on the sky as seen from the middle of the Earth, without"
    " light time, with east to the left; ellipses are three sigma. The second half of the time is prediction."
)


def ecliptic(found: Any, path: Sampled) -> Section:
    """Plane of the ecliptic, sky, and the ellipse on the sky at the cursor."""
    epochs = [found.setup.measured.epoch + float(t) for t in path.times]
    earth = body("earth", epochs, center="sun")[0]
    return Section("The orbit", [_plane(found, path, epochs), *_sky(found, path, earth)], _WORDS)


def _plane(found: Any, path: Sampled, epochs: Any) -> Orbit:
    c, s = np.cos(OBLIQUITY), np.sin(OBLIQUITY)
    R = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    place = path.mean[:, :3] @ R.T
    tracks = [
        Track(place[:, 0], place[:, 1], found.object or "object", 0, *_ellipse(R[:2] @ path.covariance[:, :3, :3] @ R[:2].T))
    ]
    reach = 1.1 * float(np.abs(place[:, :2]).max())
    for name in PLANETS:
        there = body(name, epochs, center="sun")[0] @ R.T
        if name == "earth" or np.abs(there[:, :2]).max() < reach:
            tracks.append(Track(there[:, 0], there[:, 1], name))
            reach = max(reach, 1.1 * float(np.abs(there[:, :2]).max()))
    sun = np.zeros(len(path.times))
    return Orbit("Plane of the ecliptic", [*tracks, Track(sun, sun, "sun")], ("x", "y"), _AU, (-reach, reach, -reach, reach))


def _sky(found: Any, path: Sampled, earth: Array) -> list[Orbit]:
    """Right ascension, times the cosine of a middle declination, and declination."""
    line = path.mean[:, :3] - earth
    distance = np.linalg.norm(line, axis=1)
    ra, dec = np.unwrap(np.arctan2(line[:, 1], line[:, 0])), np.arcsin(line[:, 2] / distance)
    squeeze = float(np.cos(np.mean(dec)))
    east = np.stack([-np.sin(ra), np.cos(ra), np.zeros_like(ra)], axis=-1)
    north = np.stack([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)], axis=-1)
    J = np.stack([east, north], axis=1) / distance[:, None, None]
    J[:, 0] *= (squeeze / np.cos(dec))[:, None]
    ellipse = _ellipse(J @ path.covariance[:, :3, :3] @ np.swapaxes(J, 1, 2))
    x = (ra - ra[0]) * squeeze
    margin = 0.08 * float(max(np.ptp(x), np.ptp(dec))) or 1e-6
    limits = (float(x.min() - margin), float(x.max() + margin), float(dec.min() - margin), float(dec.max() + margin))
    name = found.object or "object"
    labels = (
        f"right ascension past {np.degrees(ra[0]) % 360.0:.3f} deg, times cos {np.degrees(np.mean(dec)):.1f} deg",
        "declination",
    )
    zero = np.zeros(len(x))
    small = Display("arcsec", np.degrees(3600.0))
    here = [Track(zero, zero, name, 0, *ellipse)]
    along = ("along right ascension", "along declination")
    return [
        Orbit("On the sky", [Track(x, dec, name, 0, *ellipse)], labels, display_of("rad"), limits, mirrored=True),
        Orbit("Ellipse on the sky at the cursor", here, along, small, close=True, mirrored=True),
    ]


def _ellipse(P: Array) -> tuple[Array, Array, Array]:
    """Sigmas (T,) and correlation of covariances (T, 2, 2)."""
    sigma = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    product = np.where(sigma.prod(axis=1) > 0, sigma.prod(axis=1), 1.0)
    return sigma[:, 0], sigma[:, 1], np.clip(P[:, 0, 1] / product, -1.0, 1.0)
