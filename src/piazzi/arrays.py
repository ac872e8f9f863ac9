"""The type of arrays, whose shapes and units stand in docstrings, and what NumPy imports its masked arrays for."""

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def distinct(values: Any) -> Array:
    """The values, of which none is NaN, each once and in order, as `numpy.unique` has them."""
    ordered: Array = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def median(values: Array) -> float:
    """The middle of all values, as `numpy.median` has it: NaN of none, and where one is."""
    ordered = np.sort(values, axis=None)
    if not len(ordered) or np.isnan(ordered[-1]):
        return float("nan")
    return float(ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
