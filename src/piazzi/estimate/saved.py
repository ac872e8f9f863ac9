"""Arrays of a checkpoint, each checked as it is taken: what was a file may be anything."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from piazzi.estimate.soundness import lowest_eigenvalues, semidefinite
from piazzi.problem import Problem
from piazzi.problem.checks import Array, numeric

MOST_STEPS = 2**53
_ASYMMETRY = 1e-6  # in sigmas: more than rounding leaves between two halves of a predicted covariance


class Saved:
    """The arrays of a checkpoint, for a session of one problem; every method raises ValueError for what does not fit.

    Parameters
    ----------
    arrays : by name, of any shape and type
    problem : Problem
    """

    def __init__(self, arrays: Mapping[str, Any], problem: Problem) -> None:
        self._arrays, self._names = arrays, problem.model.names
        self._width, self._stations = problem.model.width, len(problem.stations)

    def length(self, name: str) -> int:
        """How many rows an array has."""
        shape = np.shape(self._found(name))
        if not shape:
            raise ValueError(f"the checkpoint's {name!r} is one number; it must be an array")
        return int(shape[0])

    def array(self, name: str, *shape: int, missing: bool = False) -> Array:
        """Finite numbers of this shape; NaN is let pass where some may be missing."""
        out = numeric(self._found(name), f"the checkpoint's {name!r}")
        if out.shape != shape:
            raise ValueError(f"the checkpoint's {name!r} has shape {out.shape}; this problem needs {shape}")
        bad = np.argwhere(np.isinf(out) if missing else ~np.isfinite(out))
        if bad.size:
            at = tuple(bad[0].tolist())
            raise ValueError(f"the checkpoint's {name!r} is {out[at]} at {', '.join(map(str, at))}; it must be finite")
        return out

    def mean(self, name: str) -> Array:
        """One finite number of each value, (n,)."""
        return self.array(name, len(self._names))

    def covariance(self, name: str) -> Array:
        """A matrix (n, n), symmetric and positive semidefinite up to rounding, its bits as they are."""
        n, names, what = len(self._names), self._names, f"the checkpoint's {name!r}"
        P = self.array(name, n, n)
        variances = np.diag(P)
        if (variances < 0).any():
            i = int(np.argmin(variances))
            raise ValueError(f"{what} is not positive semidefinite: the variance of {names[i]!r} is {variances[i]:g}")
        sigma = np.sqrt(variances)
        scale = np.outer(sigma, sigma)
        with np.errstate(over="ignore"):
            off = np.argwhere(np.abs(P - P.T) > _ASYMMETRY * scale)
        if off.size:
            i, j = off[0]
            pair = f"({names[i]}, {names[j]}) is {P[i, j]:g} and ({names[j]}, {names[i]}) is {P[j, i]:g}"
            raise ValueError(f"{what} is not symmetric: {pair}")
        if not semidefinite(P[None])[0]:
            lowest = lowest_eigenvalues(P[None])[0]
            raise ValueError(
                f"{what} is not positive semidefinite: the smallest eigenvalue of its correlations is {lowest:.3g}"
            )
        return P

    def whole(self, name: str, rows: int, low: int, high: int) -> Array:
        """Whole numbers from `low` to `high`, (rows,)."""
        out = self.array(name, rows)
        bad = np.flatnonzero((out != np.round(out)) | (out < low) | (out > high))
        if bad.size:
            at = int(bad[0])
            raise ValueError(
                f"the checkpoint's {name!r} is {out[at]:g} at {at}; it must be a whole number from {low} to {high}"
            )
        return out.astype(np.int64)

    def measurements(self, values: str, stations: str) -> tuple[Array, Array]:
        """Rows of measurements (J, m), NaN where missing, and the index of each one's station, (J,)."""
        rows = self.length(values)
        return self.array(values, rows, self._width, missing=True), self.whole(stations, rows, 0, self._stations - 1)

    def clock(self, name: str, size: int) -> Array:
        """Time of the epoch before and of the one that stands, NaN where there is none yet; and marks behind, 0 or 1."""
        out = self.array(name, size, missing=True)
        if not (np.isnan(out[0]) or out[1] >= out[0]):
            raise ValueError(f"the checkpoint's {name!r} has an epoch at {out[1]:g} s after one at {out[0]:g} s")
        if not np.isin(out[2:], (0, 1)).all():
            raise ValueError(f"the checkpoint's {name!r} ends in {out[-1]:g}; it must be 0 or 1")
        return out

    def _found(self, name: str) -> Any:
        if name not in self._arrays:
            raise ValueError(f"the checkpoint has no {name!r}")
        return self._arrays[name]


def check_order(times: Array, first_row: Array, rows: int) -> None:
    """Raise ValueError unless times rise and the rows of each epoch follow those of the one before."""
    late = np.flatnonzero(np.diff(times) <= 0)
    if late.size:
        k = int(late[0])
        raise ValueError(f"the checkpoint's 't' is {times[k + 1]:g} at {k + 1}, after {times[k]:g}; times must rise")
    back = np.flatnonzero(np.diff(first_row) < 0)
    if back.size:
        k = int(back[0])
        raise ValueError(
            f"the checkpoint's 'first_row' is {first_row[k + 1]} at {k + 1}, after {first_row[k]}; it must not fall"
        )
    if (first_row[0], first_row[-1]) != (0, rows):
        raise ValueError(
            f"the checkpoint's 'first_row' goes from {first_row[0]} to {first_row[-1]}; it must go from 0 to {rows}"
        )


def check_steps(times: Array, count: Array, scale: Array, step: Callable[[float], tuple[int, float]]) -> None:
    """Raise ValueError unless substeps and noise scales (W,) are those that `step` gives for the intervals between times."""
    for k in range(1, len(times)):
        for name, found, wanted in zip(
            ("count", "scale"), (count[k], scale[k]), step(float(times[k] - times[k - 1])), strict=True
        ):
            if not np.isclose(found, wanted, rtol=1e-9, atol=0):
                raise ValueError(f"the checkpoint's {name!r} is {found:g} at {k}; this problem has {wanted:g} there")
