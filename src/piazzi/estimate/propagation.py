"""Motion without measurements: what a problem's prior says about other times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate.forecast import STEP, checked_times, forecast, moved
from piazzi.estimate.soundness import defect
from piazzi.problem import Problem
from piazzi.problem.checks import Array, Locked, numeric
from piazzi.problem.dense import products
from piazzi.text import brief

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Propagation(Locked):
    """The prior of a problem, carried to other times.

    Attributes
    ----------
    problem : what was propagated
    times : (K,), s
    mean : (K, n), covariance : (K, n, n)
    success, message : every belief is finite with a semidefinite covariance; else which is not
    """

    problem: Problem
    times: Array
    mean: Array
    covariance: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        for a in (self.times, self.mean, self.covariance):
            a.setflags(write=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `mean`."""
        return self.problem.model.names

    @property
    def sigma(self) -> Array:
        """Standard deviations (K, n), NaN where a variance is negative."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)))

    @property
    def success(self) -> bool:
        return not self.message

    @cached_property
    def message(self) -> str:
        return defect(self.mean, self.covariance, self.names, lambda k: f"at t = {self.times[k]:g} s", "the motion")

    def to_dataset(self) -> xarray.Dataset:
        """Mean and covariance over time, with names and units."""
        import xarray as xr

        names = np.array(self.names, dtype=object)
        units = {"units": np.array([self.problem.model.unit(name) for name in self.names], dtype=object)}
        about = {"title": self.problem.name}
        if self.problem.epoch is not None:
            about["epoch"] = self.problem.epoch.exact()
        variables = {
            "state_mean": (("time", "state"), self.mean, {"long_name": "state"}),
            "covariance": (("time", "state", "state_2"), self.covariance, {"long_name": "covariance of the state"}),
        }
        places = {"time": ("time", self.times, {"units": "s"}), "state": ("state", names), "state_2": ("state_2", names)}
        return xr.Dataset(variables, {**places, "unit": ("state", units["units"])}, about)


def propagate(problem: Problem, times: Any) -> Propagation:
    """The prior of a problem at other times, without measurements.

    Parameters
    ----------
    problem : Problem
        Its prior is at `prior_time`, or at the first of the times.
    times : (K,) s, not decreasing
        Those before the prior are reached backwards, where there is no process noise.

    Returns
    -------
    Propagation
        Without process noise the motion is one arc, by its transition matrices, with the integrator's multi-step method where
        it has one; with it, mean and covariance go interval by interval.  Considered parameters inflate the covariance.

    Raises
    ------
    ValueError
        For times that decrease or are not finite, and times before a prior with process noise.
    """
    at = numeric(times, "times").reshape(-1)
    if not at.size or not np.isfinite(at).all() or (np.diff(at) < 0).any():
        raise ValueError("the times to propagate to must be finite and not decrease, and there must be one")
    start = problem.prior_start(at)
    if not problem.is_noise_free or problem.model.discrete or problem.model.memory:
        none = dict.fromkeys(problem.considered, np.zeros(problem.model.n))
        checked_times(at, start)
        found = forecast(problem, np.array([start]), (problem.mean, problem.covariance), none, at)
        return Propagation(problem, at, found.mean, found.covariance)
    from piazzi.orbit.axes import covariance_root

    x, root, begin = problem.mean, covariance_root(problem.covariance), start
    if at[0] < start:
        step = _back(problem, float(at[0]), start)
        root, begin = step(x)[1] @ root, float(at[0])
    else:
        step = _stay
    mean, Phi = _arc(problem, begin, at, step(x)[0])
    carried = Phi @ root
    P = carried @ np.swapaxes(carried, 1, 2)
    for name in problem.considered:
        above, below = (_of(moved(problem, name, side), begin, start, at, x) for side in (STEP, -STEP))
        shift = (above - below) / (2 * STEP)
        P += shift[:, :, None] * shift[:, None, :]
    return Propagation(problem, at, mean, P)


def _stay(x: Array) -> tuple[Array, Array]:
    return x, np.eye(len(x))


def _back(problem: Problem, begin: float, start: float) -> Callable[[Array], tuple[Array, Array]]:
    """The state at `begin` of one at `start`, later, with its derivative."""
    return lambda x: problem.step(x, begin - start, start)


def _of(problem: Problem, begin: float, start: float, at: Array, x: Array) -> Array:
    """States of the orbit that is at `x` at the start."""
    first = x if begin == start else _back(problem, begin, start)(x)[0]
    return _arc(problem, begin, at, first)[0]


def _arc(problem: Problem, begin: float, at: Array, first: Array) -> tuple[Array, Array]:
    """States (K, n), and their derivatives by the first (K, n, n)."""
    nodes, where = np.unique(np.append(begin, at), return_inverse=True)
    arc = problem.arc(nodes, first)
    whole = products(arc.Phi)
    return arc.x[where[1:]], whole[where[1:]]
