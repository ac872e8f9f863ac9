"""What is random about runs, children of the seed of a study; their truths and measurements, as an ensemble where possible."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from piazzi.problem import Problem, Tracking, Truth
from piazzi.problem.checks import Array
from piazzi.problem.lost_root import check_roots, has_roots
from piazzi.simulation import (
    MOST_DRAWS,
    NoTruthError,
    Rule,
    check_finite,
    is_restricted,
    placed,
    propagate,
    seen,
    true_problem,
)
from piazzi.study.ensemble import Layout, simulate_runs
from piazzi.study.plan import Plan
from piazzi.study.tasks import Task

PRIOR, PROCESS, MEASUREMENT = range(3)


@dataclass(frozen=True, eq=False)
class Runs:
    """Truths and measurements of runs, and for each, why there is none."""

    world: Problem
    assumed: Problem
    layout: Layout
    assumed_layout: Layout
    truth: Array
    z: Array
    wrong: list[str]

    def tracking(self, i: int) -> Tracking:
        stations = [s.name for s in self.world.stations]
        names = np.array(stations)[self.layout.station] if len(stations) > 1 else None
        return Tracking(np.repeat(self.layout.times, len(stations)), self.z[i], names, self.truth[i], self.world.epoch)


@lru_cache(maxsize=4)
def _at_point(study: Plan, point: int) -> tuple[Problem, Problem, Problem, Layout, Layout]:
    """The problem as it is measured, as it is believed to be and as it moves; layouts of the first two."""
    world, assumed = study.problems(point)
    return world, assumed, true_problem(world), Layout(world, study.times), Layout(assumed, study.times)


def simulated(study: Plan, task: Task) -> Runs:
    """Truths and measurements of the runs of a task."""
    world, assumed, actual, layout, assumed_layout = _at_point(study, task.point)
    draws = draw(world, actual, task.runs, study.seed, len(study.times))
    noisy = world.truth is None or world.truth.measurement_noise
    if actual.runs_in_ensemble:
        truth, z = simulate_runs(layout, actual, draws.first, draws.w, draws.v, noisy)
    else:
        truth, z = _one_by_one(world, actual, study.times, draws, noisy)
    if is_restricted(world):  # a run has all rows, those that are not measured without a value
        z[~seen(actual, study.times, truth).reshape(len(truth), -1)] = np.nan
    return Runs(world, assumed, layout, assumed_layout, truth, z, _faults(world, actual, study.times, draws, truth, z))


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
            empty = np.isnan(z[i]).all() and is_restricted(world)
            out[i] = "no station sees anything" if empty else "the simulated measurements are not finite"
        except ValueError as error:
            out[i] = str(error)
    return [text or _lost(actual, times, truth[i], z[i]) for i, text in enumerate(out)] if has_roots(actual.model) else out


def _lost(actual: Problem, times: Array, truth: Array, z: Array) -> str:
    """Which root has no solution where a station sees, "" where all have."""
    try:
        check_roots(actual, times, np.arange(len(actual.stations)), truth, z, seen(actual, times, truth))
    except ValueError as error:
        return str(error)
    return ""


@dataclass(frozen=True, eq=False)
class Draws:
    """First states (M, n), unit normal draws of process (M, K, n) and measurement noise (M, J, m), and runs without a truth."""

    first: Array
    w: Array
    v: Array
    refused: Array


def child(seed: int, run: int, purpose: int) -> np.random.Generator:
    """The generator of a run for one purpose: the same whatever else is drawn."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(run, purpose))))


def draw(world: Problem, actual: Problem, runs: range, seed: int, epochs: int) -> Draws:
    """Everything random about these runs.

    First states are drawn from the prior until the rule of the truth accepts one; `refused` marks runs where it never does.
    """
    n, rows, m = world.model.n, epochs * len(world.stations), world.model.width
    w, v = np.empty((len(runs), epochs, n)), np.empty((len(runs), rows, m))
    for i, run in enumerate(runs):
        child(seed, run, PROCESS).standard_normal(out=w[i])
        child(seed, run, MEASUREMENT).standard_normal(out=v[i])
    first, refused = first_states(world, actual, runs, seed)
    return Draws(first, w, v, refused)


def first_states(world: Problem, actual: Problem, runs: range, seed: int) -> tuple[Array, Array]:
    """True first states (M, n), and marks of runs that have none."""
    truth = world.truth or Truth()
    rule = Rule(truth.accept, actual)
    values, vectors = np.linalg.eigh(actual.covariance)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    generators = [child(seed, run, PRIOR) for run in runs]
    out, waiting = np.empty((len(runs), world.model.n)), np.arange(len(runs))
    for _ in range(MOST_DRAWS if truth.accept else 1):
        units = np.array([generators[i].standard_normal(world.model.n) for i in waiting])
        x = np.tile(actual.mean, (len(waiting), 1))
        for j in range(world.model.n):  # one product at a time: a matrix product rounds by how many runs there are
            x += units[:, j, None] * root[:, j]
        out[waiting] = placed(world, truth, x)
        waiting = waiting[~rule.accepts(out[waiting])]
        if not waiting.size:
            break
    refused = np.zeros(len(runs), dtype=bool)
    refused[waiting] = True
    return out, refused


def why_refused(world: Problem, actual: Problem) -> str:
    """What is said about a run without a truth."""
    return str(NoTruthError(Rule(world.truth.accept if world.truth else (), actual)))
