"""Other first states that give the same measurements, found by fitting from many starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.evaluate.information import factor, from_first, predicted, propagated
from piazzi.evaluate.twin_starts import starts
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

LISTED = 1.0  # RMS difference, in sigma of a measurement, up to which another solution is worth telling
SAME = 3.0  # solutions whose measurements differ by less than this many sigma in all, to first order, are one
_ITERATIONS = 40
_SEARCHED = 2000  # epochs of the search; what it finds is then fitted to all
_WORK = 1_000_000  # epochs that such a fit may pass in all
_FEWEST = 4  # times that it may pass all of them, however many there are
_BUDGET = 2e8  # what all fits of a search may cost: passes x steps of integration x square of the number of values
_LEAST = 60  # passes that a search may take, however long one is
_FOUND = 1e-3  # RMS, in sigma of a measurement, below which a step that does not help ends a fit
_LATELY, _SLOW = 5, 0.8  # a fit is given up that is far off and has not come down by this share in so many iterations
_GLANCE = 10  # where not all starts can be fitted, this part of the steps of a pass tells which are nearest


@dataclass(frozen=True, eq=False)
class Twin:
    """Another first state with (nearly) the same measurements.

    Attributes
    ----------
    state : (n,), SI units
    misfit : RMS over all measurements of the difference from those of the reference, in sigma
    prior_distance : sigmas between this state and the prior mean, None where the prior is certain about some value
    """

    state: Array
    misfit: float
    prior_distance: float | None

    def to_dict(self) -> dict[str, Any]:
        """The twin as JSON keeps it."""
        return {"state": self.state.tolist(), "misfit": self.misfit, "prior_distance": self.prior_distance}


@dataclass(frozen=True, eq=False)
class Search:
    """What a search for twins found, and what was searched.

    Attributes
    ----------
    twins : best first
    starts, fitted : how many starts there are, and from how many of them a fit was made: fewer where an orbit is costly
    """

    twins: tuple[Twin, ...] = ()
    starts: int = 0
    fitted: int = 0

    def to_dict(self) -> dict[str, int]:
        """What was searched, as JSON keeps it."""
        return {"starts": self.starts, "fitted": self.fitted}


NO_SEARCH = Search()


def find_twins(
    problem: Problem,
    inputs: Inputs,
    first: Array,
    unit: Array,
    root: Array,
    announce: Callable[[str], object] = lambda step: None,
) -> Search:
    """Twins of the orbit that leaves from `first` (n,), best first; the orbit is without process noise.

    Each start is fitted to the noiseless measurements of the reference by Levenberg-Marquardt in units of `unit` (n,).  With
    process noise a filter follows the measurements from there, and its innovations are compared instead.  Where the fits of all
    starts would cost too much, those are made whose measurements come nearest.

    Parameters
    ----------
    root : (n, n), triangular factor of the Fisher information in those units: tells whether two states are the same solution
    announce : told which start is being fitted
    """
    whole = _noiseless(problem, inputs, first)
    if whole is None:
        return NO_SEARCH
    begun = _head(whole, _SEARCHED)
    left = max(_LEAST, _BUDGET / (max(int(begun.count.sum()), 1) * len(first) ** 2))
    queue = list(starts(problem, first, unit, root))
    if left < len(queue) * _ITERATIONS:
        queue = _nearest(problem, begun, queue)
    found: list[Array] = []
    fitted = 0
    for start in queue:
        if left < 1:
            break
        fitted += 1
        announce(f"looking for twins: start {fitted} of {len(queue)}")

        def known(state: Array) -> bool:
            return not all(_differ(state, other, unit, root) for other in (first, *found))

        state, misfit, passes = fit(problem, begun, start, unit, _ITERATIONS, left, known)
        left -= passes
        if misfit <= LISTED and not known(state):
            found.append(state)
    if begun is not whole:
        few = max(_FEWEST, _WORK // whole.epochs)
        found = [fit(problem, whole, state, unit, _ITERATIONS, few)[0] for state in found]
    twins = [Twin(s, _misfit(problem, whole, s), _prior_distance(problem, s)) for s in found]
    twins.sort(key=lambda twin: (round(twin.misfit, 6), twin.state.tolist()))
    kept: list[Twin] = []
    for twin in twins:
        if twin.misfit <= LISTED and all(_differ(twin.state, o, unit, root) for o in (first, *(k.state for k in kept))):
            kept.append(twin)
    return Search(tuple(kept), len(queue), fitted)


def _nearest(problem: Problem, inputs: Inputs, queue: list[Array]) -> list[Array]:
    """The same starts, those first whose measurements differ least over the first part of the run."""
    steps = np.cumsum(inputs.count)
    glance = _head(inputs, max(1, int(np.searchsorted(steps, steps[-1] / _GLANCE))))
    with np.errstate(all="ignore"):
        costs = [_residuals(from_first(problem, glance, start).innovations)[1] for start in queue]
    return [queue[i] for i in np.argsort(costs, kind="stable")]


def fit(
    problem: Problem,
    inputs: Inputs,
    start: Array,
    unit: Array,
    iterations: int,
    passes: float = np.inf,
    known: Callable[[Array], bool] = lambda state: False,
) -> tuple[Array, float, int]:
    """The first state (n,) near `start` that fits best, its misfit, infinite where none has a finite one, and passes taken.

    It takes so many iterations at most, and passes over the measurements; a solution that is `known` is not polished.
    """
    x, damping, taken = np.array(start, dtype=float), 1e-6, 1
    with np.errstate(all="ignore"):
        shot = from_first(problem, inputs, x)
        r, cost = _residuals(shot.innovations)
        costs = [cost]
        for _ in range(iterations):
            if not np.isfinite(cost) or cost < 1e-16 * len(r) or not np.isfinite(shot.rows).all():
                break
            T = factor(np.column_stack([shot.rows * unit, r]))  # the same least squares in n + 1 rows
            J, rest = T[:, :-1], T[:, -1]
            scale = np.linalg.norm(J, axis=0)
            ridge = np.diag(np.where(scale > 0, scale, 1.0))
            while damping < 1e9 and taken < passes:
                taken += 1
                step = np.linalg.lstsq(np.vstack([J, np.sqrt(damping) * ridge]), np.append(rest, 0.0 * scale), rcond=None)[0]
                trial = from_first(problem, inputs, x + unit * step)
                r_new, cost_new = _residuals(trial.innovations)
                if cost_new < cost:
                    break
                damping *= 10.0 if cost > _FOUND**2 * len(r) else 1e9  # nearer than that it fails by rounding
            else:
                break
            small = cost - cost_new < 1e-9 * cost
            x, shot, r, cost, damping = x + unit * step, trial, r_new, cost_new, max(damping / 10.0, 1e-9)
            costs.append(cost)
            if small or _stuck(costs, len(r)) or (cost < LISTED**2 * len(r) and known(x)):
                break
    return x, float(np.sqrt(cost / max(len(r), 1))) if np.isfinite(cost) else np.inf, taken


def _stuck(costs: list[float], count: int) -> bool:
    """Whether a fit of so many residuals is far off and hardly comes nearer: a minimum of its own."""
    return len(costs) > _LATELY and costs[-1] > LISTED**2 * count and costs[-1] > _SLOW * costs[-1 - _LATELY]


def _noiseless(problem: Problem, inputs: Inputs, first: Array) -> Inputs | None:
    """The same run with the noiseless measurements of the orbit from `first`; None where that is not finite."""
    with np.errstate(all="ignore"):
        z = predicted(problem, inputs, propagated(problem, inputs, first))
    z = np.where(np.isnan(inputs.z), np.nan, z)
    return replace(inputs, z=z) if np.isfinite(z[~np.isnan(inputs.z)]).all() else None


def _head(inputs: Inputs, epochs: int) -> Inputs:
    """The run up to so many epochs; itself where it is no longer."""
    if inputs.epochs <= epochs:
        return inputs
    last = inputs.first_row[epochs]
    return Inputs(
        np.ascontiguousarray(inputs.t[:epochs]),
        inputs.t_prior,
        np.ascontiguousarray(inputs.count[:epochs]),
        np.ascontiguousarray(inputs.scale[:epochs]),
        np.ascontiguousarray(inputs.first_row[: epochs + 1]),
        np.ascontiguousarray(inputs.z[:last]),
        np.ascontiguousarray(inputs.station[:last]),
    )


def _residuals(innovations: Array) -> tuple[Array, float]:
    """Innovations as one vector, missing ones as zero, and their sum of squares (of a failed filter: infinite)."""
    r = innovations.reshape(-1)
    r = np.where(np.isnan(r), 0.0, r)
    cost = float(r @ r)
    return r, cost if np.isfinite(cost) else np.inf


def _misfit(problem: Problem, inputs: Inputs, state: Array) -> float:
    with np.errstate(all="ignore"):
        nu = from_first(problem, inputs, state).innovations
    there = int((~np.isnan(inputs.z)).sum())
    return float(np.sqrt(_residuals(nu)[1] / max(there, 1)))


def _differ(a: Array, b: Array, unit: Array, root: Array) -> bool:
    """Whether two states are different solutions: farther apart than measurements could hide to first order."""
    return bool(np.linalg.norm(root @ ((a - b) / unit)) > SAME)


def _prior_distance(problem: Problem, state: Array) -> float | None:
    sigma = np.sqrt(np.diag(problem.covariance))
    if not sigma.min() > 0:
        return None
    values, vectors = np.linalg.eigh(problem.covariance / np.outer(sigma, sigma))
    if values.min() <= 1e-13:
        return None
    return float(np.linalg.norm(vectors.T @ ((state - problem.mean) / sigma) / np.sqrt(values)))
