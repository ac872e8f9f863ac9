"""A piece of a study: some runs at one point, simulated, estimated and scored.  The same whatever other pieces there are."""

from __future__ import annotations

import logging
import time
from typing import Any

import numpy as np

from piazzi.estimate.estimator import views_of
from piazzi.estimate.kalman import ExtendedKalmanFilter
from piazzi.estimate.width import DIFFUSE, prior_ratio
from piazzi.problem import Problem
from piazzi.problem.gaps import is_restricted
from piazzi.study.bound import bound_at, no_bound
from piazzi.study.ensemble import filter_runs, library
from piazzi.study.plan import Plan
from piazzi.study.runs import Runs, simulated
from piazzi.study.score import NUMBERS, Scored, empty_scores, score_ensemble, score_estimate
from piazzi.study.tasks import Piece, Task, joined

LOGGER = logging.getLogger("piazzi.study")
_DOUBTFUL = 1e-9  # smallest pivot of a correlation matrix down to which elimination without pivots is as good as any


def run_task(study: Plan, task: Task) -> Piece:
    """The results of a task."""
    if not task.count:
        return Piece(task, bound_at(study, task.point))
    return joined(
        [
            _run(study, Task(task.point, first, min(study.largest_piece, task.first + task.count - first)))
            for first in range(task.first, task.first + task.count, study.largest_piece)
        ]
    )


def failed_piece(study: Plan, task: Task, message: str) -> Piece:
    """A piece without results, each of whose runs failed with this message; for a bound, one that is not known, and why."""
    if not task.count:
        return Piece(task, no_bound(study), ((-1, -1, message),))
    found = [(empty_scores(task.count, len(study.groups), len(study.kept)), [message] * task.count) for _ in study.rows]
    return _piece(task, found)


def _run(study: Plan, task: Task) -> Piece:
    runs = simulated(study, task)
    found: list[tuple[Scored, list[str]]] = []
    for label, estimator in study.variants.items():
        found += _estimated(study, label, estimator, runs)
    return _piece(task, found)


def _piece(task: Task, found: list[tuple[Scored, list[str]]]) -> Piece:
    """Scores of every row, put together."""
    arrays = {name: np.stack([scored.numbers[name] for scored, _ in found]) for name in NUMBERS}
    arrays |= {
        "success": np.stack([scored.success for scored, _ in found]).astype(np.uint8),
        "diverged": np.stack([scored.diverged for scored, _ in found]).astype(np.uint8),
        "error": np.stack([scored.error for scored, _ in found]).astype(np.float32),
        "nees": np.stack([scored.nees for scored, _ in found]).astype(np.float32),
        "rank": np.stack([scored.rank for scored, _ in found]).astype(np.uint16),
    }
    messages = [(row, task.first + i, text) for row, (_, texts) in enumerate(found) for i, text in enumerate(texts) if text]
    return Piece(task, arrays, tuple(messages))


def _estimated(study: Plan, label: str, estimator: Any, runs: Runs) -> list[tuple[Scored, list[str]]]:
    """Scores and messages of every view of one estimator."""
    views = views_of(estimator)
    M, G, T = len(runs.truth), len(study.groups), len(study.kept)
    found = [(empty_scores(M, G, T), list(runs.wrong)) for _ in views]
    left = [i for i in range(M) if not runs.wrong[i]]
    if _filters_in_ensemble(estimator, runs.assumed) and not is_restricted(runs.world):  # an ensemble misses nothing
        left = _filter(study, runs, left, found[0][0])
    for i in left:
        for view, (scored, message) in _one(study, label, estimator, runs, i).items():
            if view in views:
                out, texts = found[views.index(view)]
                _copy(scored, 0, out, i)
                texts[i] = message
    return found


def _filters_in_ensemble(estimator: Any, assumed: Problem) -> bool:
    plain = type(estimator) is ExtendedKalmanFilter and estimator.guard is None and estimator.update != "joint"
    return plain and assumed.runs_in_ensemble and not assumed.considered and prior_ratio(assumed) <= DIFFUSE


def _filter(study: Plan, runs: Runs, left: list[int], out: Scored) -> list[int]:
    """Put the scores of the extended Kalman filter of these runs in place; returns the runs that need a closer look."""
    if not left:
        return []
    whole = len(left) == len(runs.truth)
    z, truth = (runs.z, runs.truth) if whole else (runs.z[left], runs.truth[left])
    library(runs.assumed)  # what is built once is no part of a run's time
    started = time.perf_counter()
    mean, _, scores = filter_runs(runs.assumed_layout, z, truth)
    seconds = time.perf_counter() - started
    sound = np.isfinite(mean).all(axis=1) & np.isfinite(scores.nees).all(axis=1) & np.isfinite(scores.nis).all(axis=1)
    sound &= scores.lowest > _DOUBTFUL
    scored = score_ensemble(scores, runs.assumed.model.n, study.kept, seconds)
    if whole and sound.all():
        _copy(scored, slice(None), out, slice(None))
        return []
    for i, run in enumerate(left):
        if sound[i]:
            _copy(scored, i, out, run)
    return [run for i, run in enumerate(left) if not sound[i]]


def _one(study: Plan, label: str, estimator: Any, runs: Runs, i: int) -> dict[str, tuple[Scored, str]]:
    """Scores and message of every view of one run."""
    try:
        estimate = estimator.estimate(runs.assumed, runs.tracking(i))
        found = [estimate] if estimate.delayed is None else [estimate, estimate.delayed]
        return {e.view: score_estimate(label, e, study.groups, study.kept) for e in found}
    except Exception as error:
        LOGGER.debug("%s failed on run %d", label, i, exc_info=True)
        text = " ".join(str(error).split())
        message = text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}".rstrip(": ")
        empty = empty_scores(1, len(study.groups), len(study.kept))
        return dict.fromkeys(views_of(estimator), (empty, message))


def _copy(source: Scored, i: int | slice, target: Scored, j: int | slice) -> None:
    for name, values in target.numbers.items():
        values[j] = source.numbers[name][i]
    for field in ("success", "diverged", "error", "nees", "rank"):
        getattr(target, field)[j] = getattr(source, field)[i]
