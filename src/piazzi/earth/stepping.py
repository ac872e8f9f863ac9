"""Steps of an orbit about the Earth."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from piazzi.earth.defaults import lowest_height
from piazzi.earth.tides import RADIUS

STEPS = 100  # of order 8 in a turn at the rate of the pericentre: millimetres in a day, as much as edges of the shadow leave


def turning(position: Any, velocity: Any) -> float:
    """Rate of turning of a state's orbit at its pericentre, rad/s."""
    return float(np.linalg.norm(np.cross(position, velocity))) / (RADIUS + lowest_height(position, velocity)) ** 2


def longest_step(position: Any, velocity: Any, steps: int = STEPS) -> float:
    """Seconds that a step of order 8 may take on the orbit of a state: so many in a turn at the rate of the pericentre."""
    return 2.0 * pi / (steps * turning(position, velocity))
