"""What an orbit goes about: the Earth, or the Sun for whoever watches from the Earth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from piazzi.earth.constants import ASTRONOMICAL_UNIT, GM
from piazzi.orbit.region import Region
from piazzi.problem.checks import Array
from piazzi.text import nearest


@dataclass(frozen=True)
class Centre:
    """A body that orbits go about.

    Attributes
    ----------
    name : "earth" or "sun", as `earth.Forces` takes it
    frame, scale : axes of an answer about it, and the scale that its dates are told in
    region : admissible orbits, where nobody gives a guess
    nearest, farthest : m from its middle, that a guess may be
    stretch : s, of the rows that initial orbits are first looked for by
    """

    name: str
    frame: str
    scale: str
    region: Region
    nearest: float
    farthest: float
    stretch: float

    @property
    def mu(self) -> float:
        """Its attraction, m^3/s^2."""
        return self.region.mu

    def turning(self, position: Array, velocity: Array) -> float:
        """Rate of turning of a state's orbit at its pericentre, rad/s."""
        h = np.cross(position, velocity)
        size = float(h @ h) / self.mu
        e = np.sqrt(max(1.0 + size * (float(velocity @ velocity) / self.mu - 2.0 / float(np.linalg.norm(position))), 0.0))
        return float(np.linalg.norm(h)) * ((1.0 + float(e)) / size) ** 2

    def longest_step(self, position: Array, velocity: Array, steps: int) -> float:
        """Seconds that a step of order 8 may take: so many in a turn at the rate of the pericentre."""
        return 2.0 * pi / (steps * self.turning(position, velocity))


EARTH = Centre(
    "earth", "GCRF", "UTC", Region(GM["earth"], 6378136.3 + 100e3, 1e9, bulge=1.0826e-3 * 6378136.3**2), 1e6, 2e9, 4 * 3600.0
)
SUN = Centre(
    "sun", "ICRF", "TDB",
    Region(GM["sun"], 0.05 * ASTRONOMICAL_UNIT, 60.0 * ASTRONOMICAL_UNIT, on_surface=False),
    7e8, 1e15, 60 * 86400.0,
)  # fmt: skip
CENTRES: Mapping[str, Centre] = {"earth": EARTH, "sun": SUN}


def centre_of(name: str) -> Centre:
    """The centre of a name; raises ValueError for another."""
    found = CENTRES.get(str(name).strip().lower())
    if found is None:
        raise ValueError(
            f"--about {str(name)[:40]!r}: orbits are determined about the earth or the sun{nearest(str(name)[:40], CENTRES)}"
        )
    return found
