"""What estimators make of a problem beside the best that any could: is it the measurements that limit them, or they."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.estimate.estimator import Estimator
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.kalman import ExtendedKalmanFilter
from piazzi.evaluate.bounds import full_truth, posterior_bounds
from piazzi.evaluate.information import propagated
from piazzi.evaluate.metrics import rms_in_sigmas
from piazzi.evaluate.quantities import finite
from piazzi.evaluate.twins import Twin
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

TRIED: dict[str, Estimator] = {"ekf": ExtendedKalmanFilter(), "graph": FactorGraph()}


@dataclass(frozen=True)
class Attempt:
    """One estimator's result on the tracking at hand.

    Attributes
    ----------
    estimator : its name: "ekf", "graph", or "ekf at the truth", the filter with Jacobians from there
    excess : RMS error per state in the last half (rows K//2 onward), in sigmas of the posterior Cramer-Rao bound: near 1 is the
        best possible; infinite where it failed
    twin : index of the twin whose orbit it ended nearer to than to the truth, None where it did not
    """

    estimator: str
    excess: float
    twin: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """The attempt as JSON keeps it."""
        return {"estimator": self.estimator, "excess": finite(self.excess), "twin": self.twin}


def attempts(problem: Problem, tracking: Tracking, twins: Sequence[Twin]) -> tuple[Attempt, ...]:
    """The filter and the graph on this tracking, from the problem's prior; empty where there is no truth to compare with."""
    truth = full_truth(problem, tracking)
    if truth is None:
        return ()
    half = slice(len(truth) // 2, None)
    tried = {name: _last_half(estimator, problem, tracking) for name, estimator in TRIED.items()}
    bounds = posterior_bounds(problem, tracking)  # after them: what needs much memory is not there at once
    if bounds is None:
        return ()
    orbits = _orbits(problem, tracking, twins)
    found = [Attempt("ekf at the truth", rms_in_sigmas(bounds.states[half] - truth[half], bounds.realtime[half]))]
    for name, result in tried.items():
        if result is None:
            found.append(Attempt(name, np.inf))
            continue
        mean, view = result
        bound = bounds.of(view)
        excess = rms_in_sigmas(mean - truth[half], bound[half])
        distances = [rms_in_sigmas(mean[-1:] - x, bound[-1:]) for x in (truth[-1:], *orbits)]
        nearest = int(np.argmin(distances)) if np.isfinite(distances).any() else 0
        found.append(Attempt(name, excess, nearest - 1 if nearest else None))
    return tuple(found)


def _last_half(estimator: Estimator, problem: Problem, tracking: Tracking) -> tuple[Array, str] | None:
    """Means in the last half, and the estimate's view; None where it failed."""
    try:
        estimate = estimator.estimate(problem, tracking)
    except ValueError:
        return None
    return estimate.mean[len(estimate.mean) // 2 :].copy(), estimate.view


def _orbits(problem: Problem, tracking: Tracking, twins: Sequence[Twin]) -> list[Array]:
    """Where each twin is at the last epoch, (1, n)."""
    inputs = prepare(problem, tracking)
    unmeasured = replace(inputs, z=np.full_like(inputs.z, np.nan))
    return [propagated(problem, unmeasured, twin.state)[-1:] for twin in twins]
