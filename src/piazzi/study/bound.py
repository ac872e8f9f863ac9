"""The Cramer-Rao bound of a point: how small errors can be at best, averaged over truths that happen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.simulation import is_restricted, true_problem
from piazzi.study.ensemble import Layout, filter_runs
from piazzi.study.plan import BOUND_RUNS, Plan
from piazzi.study.runs import Runs, simulated
from piazzi.study.tasks import Task

VIEWS = "realtime", "delayed"
SLOW_RUNS = 64  # truths where each takes a filter and a smoother of its own


def bound_at(study: Plan, point: int) -> dict[str, Array]:
    """Bound on the variance of each group of states, averaged over truths, NaN where there is none.

    Linearised at each truth, with the numbers of the problem as it is (Tichavsky, Muravchik and Nehorai, IEEE Trans. Signal
    Processing 46(5), 1998; here the bounds of single truths are averaged, not their information).

    Returns
    -------
    bound : (2, T, G), of estimates in real time and delayed, at the epochs that are kept, standard deviations
    bound_whole, bound_last_half : (2, G), roots of the means over the whole run and over its last half
    bound_runs : (2,), how many truths, the first of the point, were averaged over
    """
    actual = replace(true_problem(study.problems(point)[0]), truth=None)
    wanted, most = {view for _, view in study.rows}, min(study.runs, BOUND_RUNS)
    means = [_Mean(np.zeros((len(study.times), len(study.groups)))) for _ in VIEWS]
    for first in range(0, most, study.largest_piece):  # memory stays flat
        runs = simulated(study, Task(point, first, min(study.largest_piece, most - first)))
        good = [i for i, wrong in enumerate(runs.wrong) if not wrong]  # runs without a truth are passed over
        looked_at = [
            _add(mean, first, study, actual, runs, good, view)
            for view, mean in zip(VIEWS, means, strict=True)
            if view in wanted
        ]
        if good and not any(looked_at):
            break
    return _arrays(study, np.stack([mean.variance for mean in means]), np.array([mean.runs for mean in means]))


def no_bound(study: Plan) -> dict[str, Array]:
    """The same where it is not known."""
    return _arrays(study, np.full((2, len(study.times), len(study.groups)), np.nan), np.zeros(2))


def _arrays(study: Plan, variance: Array, count: Array) -> dict[str, Array]:
    half = variance[:, variance.shape[1] // 2 :]
    return {
        "bound": np.sqrt(variance[:, study.kept]).astype(np.float32),
        "bound_whole": np.sqrt(variance.mean(axis=1)),
        "bound_last_half": np.sqrt(half.mean(axis=1)),
        "bound_runs": count.astype(np.int64),
    }


@dataclass
class _Mean:
    """Variances of groups (K, G), summed over so many truths that have a bound, among so many that were looked at.

    `runs` counts the runs up to the last of them, those without a truth too.
    """

    total: Array
    known: int = 0
    looked_at: int = 0
    runs: int = 0

    @property
    def variance(self) -> Array:
        return self.total / self.known if self.known else np.full_like(self.total, np.nan)


def _add(mean: _Mean, first: int, study: Plan, actual: Problem, runs: Runs, good: list[int], view: str) -> int:
    """Add the bounds of truths to a mean; of how many: all of an ensemble, `SLOW_RUNS` in all one by one."""
    if good and view == "realtime" and actual.runs_in_ensemble and not is_restricted(actual):
        _, _, scores = filter_runs(Layout(actual, study.times), runs.z[good], runs.truth[good], at_truth=True)
        found = scores.spread.transpose(0, 2, 1)
    else:
        good = good[: SLOW_RUNS - mean.looked_at]
        found = _one_by_one(study, actual, [runs.tracking(i) for i in good], view)
    if good:
        mean.total += found.sum(axis=0)
        mean.known += len(found)
        mean.looked_at += len(good)
        mean.runs = first + good[-1] + 1
    return len(good)


def _one_by_one(study: Plan, actual: Problem, trackings: list[Tracking], view: str) -> Array:
    """Variance of each group (N, K, G), of the truths that have a bound."""
    from piazzi.evaluate.bounds import posterior_bounds

    out = []
    for bounds in (posterior_bounds(actual, tracking) for tracking in trackings):
        if bounds is not None:
            diagonal = np.diagonal(bounds.of(view), axis1=1, axis2=2)
            out.append(np.stack([diagonal[:, list(c)].sum(axis=1) for c in study.groups.values()], axis=1))
    return np.stack(out) if out else np.zeros((0, len(study.times), len(study.groups)))
