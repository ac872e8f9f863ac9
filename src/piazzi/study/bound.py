"""The Cramer-Rao bound of a point: how small errors can be at best, averaged over truths that happen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.simulation import true_problem
from piazzi.study.lanes import Layout, compiles, filter_runs, in_lanes
from piazzi.study.plan import BOUND_RUNS, Study
from piazzi.study.runs import simulated
from piazzi.study.tasks import Task

SLOW_RUNS = 64  # truths where each takes a filter and a smoother of its own


def bound_at(study: Study, point: int) -> dict[str, Array]:
    """Bound on the variance of each group of states, averaged over truths, NaN where there is none.

    Linearised at each truth, with the numbers of the problem as it is (Tichavsky, Muravchik and Nehorai, IEEE Trans. Signal
    Processing 46(5), 1998; here the bounds of single truths are averaged, not their information).

    Returns
    -------
    bound : (2, T, G), of estimates in real time and delayed, at the epochs that are kept, standard deviations
    bound_whole, bound_last_half : (2, G), roots of the means over the whole run and over its last half
    bound_runs : (2,), how many truths, the first of the point, were averaged over
    """
    views = [view for _, view in study.rows]
    runs = simulated(study, Task(point, 0, min(study.runs, BOUND_RUNS, study.largest_piece)))  # memory stays flat
    good = [i for i, wrong in enumerate(runs.wrong) if not wrong]
    K, G = len(study.times), len(study.groups)
    variance, count = np.full((2, K, G), np.nan), np.zeros(2)
    actual = replace(true_problem(runs.world), truth=None)
    few = [runs.tracking(i) for i in good[:SLOW_RUNS]]
    if good and "realtime" in views:
        variance[0], count[0] = _realtime(study, actual, runs.truth[good], runs.z[good], few)
    if good and "delayed" in views:
        variance[1], count[1] = _mean(study, actual, few, "delayed")
    count[count > 0] = [good[int(c) - 1] + 1 for c in count if c]  # runs without a truth are passed over
    return _arrays(study, variance, count)


def no_bound(study: Study) -> dict[str, Array]:
    """The same where it is not known."""
    return _arrays(study, np.full((2, len(study.times), len(study.groups)), np.nan), np.zeros(2))


def _arrays(study: Study, variance: Array, count: Array) -> dict[str, Array]:
    half = variance[:, variance.shape[1] // 2 :]
    return {
        "bound": np.sqrt(variance[:, study.kept]).astype(np.float32),
        "bound_whole": np.sqrt(variance.mean(axis=1)),
        "bound_last_half": np.sqrt(half.mean(axis=1)),
        "bound_runs": count.astype(np.int64),
    }


def _realtime(study: Study, actual: Problem, truth: Array, z: Array, trackings: list[Tracking]) -> tuple[Array, int]:
    layout = Layout(actual, study.times)
    if not (in_lanes(actual) and compiles(filter_runs, layout, z[:1], truth[:1])):
        return _mean(study, actual, trackings, "realtime")
    _, _, scores = filter_runs(layout, z, truth, at_truth=True)
    assert scores is not None
    return np.asarray(scores.spread.mean(axis=0).T), len(z)


def _mean(study: Study, actual: Problem, trackings: list[Tracking], view: str) -> tuple[Array, int]:
    """Mean variance of each group, (K, G), over truths that have a bound, and how many truths were looked at."""
    from piazzi.evaluate.bounds import posterior_bounds

    found = [posterior_bounds(actual, tracking) for tracking in trackings]
    out = []
    for bounds in found:
        if bounds is not None:
            diagonal = np.diagonal(bounds.of(view), axis1=1, axis2=2)
            out.append(np.stack([diagonal[:, list(c)].sum(axis=1) for c in study.groups.values()], axis=1))
    return np.mean(out, axis=0) if out else np.full((len(study.times), len(study.groups)), np.nan), len(found)
