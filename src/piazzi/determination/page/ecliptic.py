"""An orbit about the Sun: in the plane of the ecliptic, and on the sky with the ellipse of the prediction."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.determination.orbit import TILT
from piazzi.determination.page.sampled import Sampled
from piazzi.earth import body
from piazzi.earth.constants import ASTRONOMICAL_UNIT
from piazzi.evaluate.quantities import Display, display_of
from piazzi.present.report.blocks import Orbit, Section, Track
from piazzi.problem.checks import Array

FARTHEST, NEAREST = 6.0, 0.18  # of ellipses that are drawn: over the size of what was seen; of the picture, for a name
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
    R = TILT
    place, own = path.mean[:, :3] @ R.T, ellipse(path.mean[len(path.mean) // 2], found.setup.measured.centre.mu) @ R.T
    tracks = [
        Track(place[:, 0], place[:, 1], found.object or "object", 0, *_ellipse(R[:2] @ path.covariance[:, :3, :3] @ R[:2].T))
    ]
    long = not len(own) or np.abs(own).max() > FARTHEST * np.abs(place).max()  # as that of a comet
    whole = place if long else own
    reach, rings = 1.1 * float(np.abs(whole[:, :2]).max()), [whole]
    for name in PLANETS:
        there, speed = (v @ R.T for v in body(name, epochs, center="sun"))
        round_ = ellipse(np.concatenate([there[0], speed[0]]), found.setup.measured.centre.mu)
        if name == "earth" or NEAREST * reach < np.abs(round_).max() < reach:
            tracks.append(Track(there[:, 0], there[:, 1], name))
            rings.append(round_)
            reach = max(reach, 1.1 * float(np.abs(round_[:, :2]).max()))
    sun = np.zeros(len(path.times))
    tracks.append(Track(sun, sun, "sun"))
    limits, lines = (-reach, reach, -reach, reach), [(line[:, 0], line[:, 1]) for line in rings]
    return Orbit("Plane of the ecliptic", tracks, ("x", "y"), _AU, limits, rings=lines)


def ellipse(state: Array, mu: float) -> Array:
    """The ellipse (181, 3) on which a state is; nothing, (0, 3), where it is on none."""
    r, v = state[:3], state[3:6]
    h = np.cross(r, v)
    towards = np.cross(v, h) / mu - r / np.linalg.norm(r)
    e, energy = float(np.linalg.norm(towards)), 0.5 * float(v @ v) - mu / float(np.linalg.norm(r))
    if energy >= 0.0 or not np.linalg.norm(h) > 0.0:
        return np.empty((0, 3))
    P = towards / e if e > 1e-12 else r / np.linalg.norm(r)
    Q = np.cross(h, P) / np.linalg.norm(h)
    a, E = -0.5 * mu / energy, np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
    out: Array = a * (np.cos(E) - e) * P + a * np.sqrt(1.0 - e * e) * np.sin(E) * Q
    return out


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
