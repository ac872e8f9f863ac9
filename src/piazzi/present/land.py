"""Land of the Earth, of Natural Earth at 1:110 million (public domain); docs/machinery/land.py made the file."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

from piazzi.problem.checks import Array


@cache
def land() -> Array:
    """Rings of longitude and latitude (P, 2) in degrees, NaN after each; what a ring encloses is on its left."""
    text = files(__package__).joinpath("data", "land.txt").read_text(encoding="utf-8")
    rings = []
    for line in text.splitlines():
        if not line.startswith("#"):
            steps = np.array(line.split(), dtype=float).reshape(-1, 2)
            rings += [np.cumsum(steps, axis=0) / 10.0, np.full((1, 2), np.nan)]
    out: Array = np.concatenate(rings)
    out.setflags(write=False)
    return out
