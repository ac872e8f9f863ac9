"""What estimators make of a problem beside the best that any could: is it the measurements that limit them, or they."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.estimate import Estimator, ExtendedKalmanFilter, FactorGraph
from piazzi.estimate.inputs import prepare
from piazzi.evaluate.bounds import full_truth, posterior_bounds
from piazzi.evaluate.information import coast
from piazzi.evaluate.metrics import rms_in_sigmas
from piazzi.evaluate.quantities import finite
from piazzi.evaluate.twins import Twin
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array

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
    bounds, truth = posterior_bounds(problem, tracking), full_truth(problem, tracking)
    if bounds is None or truth is None:
        return ()
    orbits = _orbits(problem, tracking, twins)
    half = slice(len(truth) // 2, None)
    found = [Attempt("ekf at the truth", rms_in_sigmas(bounds.states[half] - truth[half], bounds.realtime[half]))]
    for name, estimator in TRIED.items():
        try:
            estimate = estimator.estimate(problem, tracking)
        except ValueError:
            found.append(Attempt(name, np.inf))
            continue
        bound = bounds.of(estimate.view)
        excess = rms_in_sigmas(estimate.mean[half] - truth[half], bound[half])
        distances = [rms_in_sigmas(estimate.mean[-1:] - x, bound[-1:]) for x in (truth[-1:], *orbits)]
        nearest = int(np.argmin(distances)) if np.isfinite(distances).any() else 0
        found.append(Attempt(name, excess, nearest - 1 if nearest else None))
    return tuple(found)


def _orbits(problem: Problem, tracking: Tracking, twins: Sequence[Twin]) -> list[Array]:
    """Where each twin is at the last epoch, (1, n)."""
    inputs = prepare(problem, tracking)
    still = replace(inputs, z=np.full_like(inputs.z, np.nan))
    return [coast(problem, still, twin.state)[-1:] for twin in twins]
