"""A piece of a study: some runs at one point, simulated, estimated and scored.  The same whatever other pieces there are."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.estimate import ExtendedKalmanFilter
from piazzi.estimate.registry import views_of
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.simulation import check_finite, propagate, true_problem
from piazzi.study.bound import bound_at, no_bound
from piazzi.study.draws import Draws, draw, why_refused
from piazzi.study.lanes import Layout, filter_runs, in_lanes, simulate_runs
from piazzi.study.plan import Study
from piazzi.study.score import NUMBERS, Scored, nothing, score_estimate, score_lanes

LOGGER = logging.getLogger("piazzi.study")
_DOUBTFUL = 1e-9  # smallest pivot of a correlation matrix down to which elimination in lanes is as good as any


@dataclass(frozen=True)
class Task:
    """Runs `first` to `first + count - 1` at a point; no runs mean the point's Cramer-Rao bound."""

    point: int
    first: int
    count: int

    @property
    def runs(self) -> range:
        return range(self.first, self.first + self.count)


@dataclass(frozen=True, eq=False)
class Piece:
    """Results of a task: arrays by name, row by row of the study; and for each row and run without success, why.

    A bound that is not known has one message, of no row and no run: -1 stands for both.
    """

    task: Task
    arrays: Mapping[str, Array]
    messages: tuple[tuple[int, int, str], ...] = ()


@dataclass(frozen=True, eq=False)
class _Runs:
    """Truths and measurements of runs, and for each, why there is none."""

    world: Problem
    belief: Problem
    layout: Layout
    believed: Layout
    truth: Array
    z: Array
    wrong: list[str]

    def tracking(self, i: int) -> Tracking:
        stations = [s.name for s in self.world.stations]
        names = np.array(stations)[self.layout.station] if len(stations) > 1 else None
        return Tracking(np.repeat(self.layout.times, len(stations)), self.z[i], names, self.truth[i])


def run_task(study: Study, task: Task) -> Piece:
    """The results of a task."""
    if not task.count:
        return Piece(task, bound_at(study, task.point))
    parts = [
        _run(study, Task(task.point, first, min(study.largest_piece, task.first + task.count - first)))
        for first in range(task.first, task.first + task.count, study.largest_piece)
    ]
    if len(parts) == 1:
        return parts[0]
    arrays = {name: np.concatenate([p.arrays[name] for p in parts], axis=1) for name in parts[0].arrays}
    return Piece(task, arrays, tuple(m for p in parts for m in p.messages))


def lost(study: Study, task: Task, message: str) -> Piece:
    """A piece without results, each of whose runs failed with this message; for a bound, one that is not known, and why."""
    if not task.count:
        return Piece(task, no_bound(study), ((-1, -1, message),))
    found = [(nothing(task.count, len(study.groups), len(study.kept)), [message] * task.count) for _ in study.rows]
    return _piece(task, found)


def _run(study: Study, task: Task) -> Piece:
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
        "rank": np.stack([scored.rank for scored, _ in found]).astype(np.uint8),
    }
    messages = [(row, task.first + i, text) for row, (_, texts) in enumerate(found) for i, text in enumerate(texts) if text]
    return Piece(task, arrays, tuple(messages))


# ---- simulation --------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=4)
def _at_point(study: Study, point: int) -> tuple[Problem, Problem, Problem, Layout, Layout]:
    """The problem as it is measured, as it is believed to be and as it moves; layouts of the first two."""
    world, belief = study.problems(point)
    return world, belief, true_problem(world), Layout(world, study.times), Layout(belief, study.times)


def simulated(study: Study, task: Task) -> _Runs:
    """Truths and measurements of the runs of a task."""
    world, belief, actual, layout, believed = _at_point(study, task.point)
    draws = draw(world, actual, task.runs, study.seed, len(study.times))
    noisy = world.truth is None or world.truth.measurement_noise
    if in_lanes(actual) and compiles(simulate_runs, layout, actual, draws.first[:1], draws.w[:1], draws.v[:1], noisy):
        truth, z = simulate_runs(layout, actual, draws.first, draws.w, draws.v, noisy)
    else:
        truth, z = _one_by_one(world, actual, study.times, draws, noisy)
    return _Runs(world, belief, layout, believed, truth, z, _faults(world, actual, study.times, draws, truth, z))


def _one_by_one(world: Problem, actual: Problem, times: Array, draws: Draws, noisy: bool) -> tuple[Array, Array]:
    truth, z = np.full(draws.w.shape, np.nan), np.full(draws.v.shape, np.nan)
    index = np.arange(len(world.stations), dtype=np.int64)
    for i in np.flatnonzero(~draws.refused):
        try:
            truth[i], z[i] = propagate(world, actual, times, index, draws.first[i], draws.w[i], draws.v[i] if noisy else None)
        except ValueError:
            continue  # `_faults` finds the same, and says so
    return truth, z


def _faults(world: Problem, actual: Problem, times: Array, draws: Draws, truth: Array, z: Array) -> list[str]:
    """For each run, why it has no truth or no measurements, "" where it has."""
    out = [""] * len(truth)
    usable = np.isfinite(truth).all(axis=(1, 2)) & ~np.isinf(z).any(axis=(1, 2)) & ~np.isnan(z).all(axis=(1, 2))
    for i in np.flatnonzero(draws.refused | ~usable):
        if draws.refused[i]:
            out[i] = why_refused(world, actual)
            continue
        try:
            check_finite(world, times, draws.first[i], truth[i])
            out[i] = "the simulated measurements are not finite"
        except ValueError as error:
            out[i] = str(error)
    return out


# ---- estimation --------------------------------------------------------------------------------------------------------


def _estimated(study: Study, label: str, estimator: Any, runs: _Runs) -> list[tuple[Scored, list[str]]]:
    """Scores and messages of every view of one estimator."""
    views = views_of(estimator)
    M, G, T = len(runs.truth), len(study.groups), len(study.kept)
    found = [(nothing(M, G, T), list(runs.wrong)) for _ in views]
    left = [i for i in range(M) if not runs.wrong[i]]
    if _filters_in_lanes(estimator, runs.belief):
        left = _filter(study, runs, left, found[0][0])
    for i in left:
        for view, (scored, message) in _one(study, label, estimator, runs, i).items():
            if view in views:
                out, texts = found[views.index(view)]
                _copy(scored, 0, out, i)
                texts[i] = message
    return found


def _filters_in_lanes(estimator: Any, belief: Problem) -> bool:
    plain = type(estimator) is ExtendedKalmanFilter and estimator.guard is None and estimator.update != "joint"
    return plain and in_lanes(belief) and not belief.considered


def _filter(study: Study, runs: _Runs, left: list[int], out: Scored) -> list[int]:
    """Put the scores of the extended Kalman filter of these runs in place; returns the runs that need a closer look."""
    if not left:
        return []
    layout = runs.believed
    if not compiles(filter_runs, layout, runs.z[left[:1]], runs.truth[left[:1]]):
        return left
    whole = len(left) == len(runs.truth)
    z, truth = (runs.z, runs.truth) if whole else (runs.z[left], runs.truth[left])
    started = time.perf_counter()
    mean, _, scores = filter_runs(layout, z, truth)
    seconds = time.perf_counter() - started
    assert scores is not None
    sound = np.isfinite(mean).all(axis=1) & np.isfinite(scores.nees).all(axis=1) & np.isfinite(scores.nis).all(axis=1)
    sound &= scores.lowest > _DOUBTFUL
    scored = score_lanes(scores, runs.belief.model.n, study.kept, seconds)
    if whole and sound.all():
        _copy(scored, slice(None), out, slice(None))
        return []
    for i, run in enumerate(left):
        if sound[i]:
            _copy(scored, i, out, run)
    return [run for i, run in enumerate(left) if not sound[i]]


def _one(study: Study, label: str, estimator: Any, runs: _Runs, i: int) -> dict[str, tuple[Scored, str]]:
    """Scores and message of every view of one run."""
    try:
        estimate = estimator.estimate(runs.belief, runs.tracking(i))
        found = [estimate] if estimate.delayed is None else [estimate, estimate.delayed]
        return {e.view: score_estimate(label, e, study.groups, study.kept) for e in found}
    except Exception as error:
        LOGGER.debug("%s failed on run %d", label, i, exc_info=True)
        text = " ".join(str(error).split())
        message = text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}".rstrip(": ")
        empty = nothing(1, len(study.groups), len(study.kept))
        return dict.fromkeys(views_of(estimator), (empty, message))


def _copy(source: Scored, i: int | slice, target: Scored, j: int | slice) -> None:
    for name, values in target.numbers.items():
        values[j] = source.numbers[name][i]
    for field in ("success", "diverged", "error", "nees", "rank"):
        getattr(target, field)[j] = getattr(source, field)[i]


_refused: dict[tuple[Any, ...], bool] = {}


def compiles(function: Callable[..., Any], layout: Layout, *args: Any) -> bool:
    """Whether the kernel in lanes can be made for this problem; a model of constants, say, has no lanes to speak of."""
    problem = layout.problem
    assert problem.integrator is not None
    key = (function.__name__, problem.model, problem.integrator.scheme)
    if key not in _refused:
        try:
            function(layout, *args)
            _refused[key] = False
        except Exception:  # Numba's own kinds of errors, which are not imported here
            LOGGER.debug("no lanes for %s", problem.name, exc_info=True)
            _refused[key] = True
    return not _refused[key]
