"""Derivatives by central differences with one Richardson extrapolation: error h^4, independent of every formula."""

from collections.abc import Callable

import numpy as np


def jacobian(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """d function / dx at `x`, with a step for every entry of `x`."""
    columns = []
    for i, h in enumerate(steps):
        e = np.eye(len(x))[i]
        coarse, fine = ((function(x + s * e) - function(x - s * e)) / (2 * s) for s in (h, h / 2))
        columns.append((4 * fine - coarse) / 3)
    return np.array(columns).T
