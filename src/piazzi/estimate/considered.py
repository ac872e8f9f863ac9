"""Parameters that are uncertain but not estimated: what they do to the covariance of any estimator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.estimate.forecast import STEP, moved
from piazzi.problem import Problem, Tracking
from piazzi.problem.inputs import wrapped

JUMP = 1.0  # standard deviations of the estimate that a parameter's small change may bend it by
_Estimator = TypeVar("_Estimator")
Run = Callable[[_Estimator, Problem, Tracking], Estimate]


def with_considered(run: Run[_Estimator]) -> Run[_Estimator]:
    """An estimator's `estimate` that accounts for considered parameters.

    The estimate is the one for their nominal values.  Its covariance gains s s^T for each, with s the change of the estimate
    by one standard deviation of the parameter (Tapley, Schutz and Born 2004, ch. 6): the derivative of the estimator itself,
    by central differences, so that it holds for filters, windows and graphs alike.  The covariances of the innovations gain
    theirs.  ``details["considered_mu"]`` is s (K, n) for a parameter ``mu``.
    """

    @wraps(run)
    def estimate(self: _Estimator, problem: Problem, tracking: Tracking) -> Estimate:
        nominal = run(self, problem, tracking)
        names = problem.considered
        for name in names if names and nominal.success else ():  # only where there are any: the check takes time
            sides = [run(self, moved(problem, name, side * STEP), tracking) for side in (1.0, -1.0)]
            nominal = _inflated(nominal, name, *sides)
        return nominal

    return estimate


def _inflated(nominal: Estimate, name: str, above: Estimate, below: Estimate) -> Estimate:
    """The estimate with the part of one parameter added to its covariances."""
    for side in (above, below):
        if not side.success:
            return replace(nominal, failure=f"with the considered parameter {name!r} moved by {STEP:g} sigma: {side.message}")
    s = (above.mean - below.mean) / (2 * STEP)
    rows = nominal.tracking.stations_of(nominal.problem)
    e = wrapped(nominal.problem, rows, above.innovations - below.innovations) / (2 * STEP)
    sigma = np.sqrt(np.maximum(np.diagonal(nominal.covariance, axis1=1, axis2=2), 0.0))
    if (np.abs(above.mean + below.mean - 2 * nominal.mean) > JUMP * sigma + 0.5 * np.abs(above.mean - below.mean)).any():
        return replace(nominal, failure=f"the estimate jumps where the considered parameter {name!r} changes a little")
    changes: dict[str, Any] = {
        "covariance": nominal.covariance + s[:, :, None] * s[:, None, :],
        "innovation_covariances": nominal.innovation_covariances + e[:, :, None] * e[:, None, :],
        "seconds": nominal.seconds + above.seconds + below.seconds,
        "details": {**nominal.details, f"considered_{name}": s},
    }
    if "cross_covariances" in nominal.details:
        cross = nominal.details["cross_covariances"] + s[:-1, :, None] * s[1:, None, :]
        changes["details"]["cross_covariances"] = cross
    if nominal.delayed is not None and above.delayed is not None and below.delayed is not None:
        changes["delayed"] = _inflated(nominal.delayed, name, above.delayed, below.delayed)
    return replace(nominal, **changes)


def nominal(estimator: Any, problem: Problem, tracking: Tracking) -> Estimate:
    """An estimator's estimate for the nominal values of considered parameters: where only its means matter, one run does."""
    estimate: Estimate = type(estimator).estimate.__wrapped__(estimator, problem, tracking)
    return estimate
