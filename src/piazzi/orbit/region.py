"""Orbits that are admissible where nothing is known of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.arrays import Array


@dataclass(frozen=True)
class Region:
    """Which orbits are admissible: mu, lowest and highest distance from the centre (m); whether observers stand on the body.

    `bulge` is J2 times the square of the radius that it belongs to (m^2), about the third axis; zero for a body that is round.
    """

    mu: float
    lowest: float
    highest: float
    on_surface: bool = True
    bulge: float = 0.0

    def holds(self, state: Array) -> Array:
        """Which states (K, 6) are bound, with both apsides inside."""
        with np.errstate(all="ignore"):
            r, v2 = np.linalg.norm(state[:, :3], axis=1), np.sum(state[:, 3:] ** 2, axis=1)
            a = 1.0 / (2.0 / r - v2 / self.mu)
            h2 = np.sum(np.cross(state[:, :3], state[:, 3:]) ** 2, axis=1)
            e = np.sqrt(np.maximum(1.0 - h2 / (self.mu * a), 0.0))
            return np.asarray((a > 0) & (a * (1 - e) > self.lowest) & (a * (1 + e) < self.highest) & np.isfinite(r))
