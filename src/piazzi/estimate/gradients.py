"""Problems whose functions from outside give approximate derivatives: what iterations end with, and what filters say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, TypeVar

from piazzi.estimate.estimator import Estimate
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array

ROUGHLY = 1e-2  # sigma: as near as the iterations with approximate derivatives come, which may end about 1e-3 off
_Estimator = TypeVar("_Estimator")
Run = Callable[[_Estimator, Problem, Tracking], Estimate]


def ended_exactly(start_of: Callable[[Estimate], Array]) -> Callable[[Run[_Estimator]], Run[_Estimator]]:
    """Make the `estimate` of an estimator that iterates, with `start` and `tolerance`, one for such problems too.

    It comes near with the approximate derivatives and goes on with those of the values, from what `start_of` takes of the
    estimate so far: its last steps, the test of convergence and the covariances are those of the exact problem.
    ``details["approximate_iterations"]`` counts the steps before.
    """

    def decorated(run: Run[_Estimator]) -> Run[_Estimator]:
        @wraps(run)
        def estimate(self: _Estimator, problem: Problem, tracking: Tracking) -> Estimate:
            if not problem.approximated:
                return run(self, problem, tracking)
            given: Any = self
            exact = problem.with_exact_derivatives()
            near = run(replace(given, tolerance=max(given.tolerance, ROUGHLY)), problem, tracking)
            if not near.success:
                return replace(run(self, exact, tracking), problem=problem)
            found = run(replace(given, start=start_of(near)), exact, tracking)
            modes = {key: near.details[key] for key in ("modes", "mode_states") if key in near.details}
            details = {**modes, **found.details, "start": near.details["start"], "approximate_iterations": near.iterations}
            iterations, seconds = near.iterations + found.iterations, near.seconds + found.seconds
            return replace(found, problem=problem, iterations=iterations, seconds=seconds, details=details)

        return estimate

    return decorated


def told_of(run: Run[_Estimator]) -> Run[_Estimator]:
    """The `estimate` of an estimator that linearises the motion once: of such problems its message says so."""

    @wraps(run)
    def estimate(self: _Estimator, problem: Problem, tracking: Tracking) -> Estimate:
        found = run(self, problem, tracking)
        return found if not problem.approximated else _with_remark(found, problem.approximated)

    return estimate


def _with_remark(found: Estimate, names: Sequence[str]) -> Estimate:
    said = f"covariances are of approximate derivatives: those of {', '.join(names)} are of a lower degree than the values"
    details = {**found.details, "remark": "; ".join(filter(None, [str(found.details.get("remark", "")), said]))}
    delayed = None if found.delayed is None else _with_remark(found.delayed, names)
    return replace(found, details=details, delayed=delayed)
