"""Truths and measurements of the runs of a task, in lanes where the problem allows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.simulation import check_finite, propagate, true_problem
from piazzi.study.draws import Draws, draw, why_refused
from piazzi.study.lanes import Layout, compiles, simulate_runs
from piazzi.study.plan import Plan
from piazzi.study.tasks import Task


@dataclass(frozen=True, eq=False)
class Runs:
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


@lru_cache(maxsize=4)
def _at_point(study: Plan, point: int) -> tuple[Problem, Problem, Problem, Layout, Layout]:
    """The problem as it is measured, as it is believed to be and as it moves; layouts of the first two."""
    world, belief = study.problems(point)
    return world, belief, true_problem(world), Layout(world, study.times), Layout(belief, study.times)


def simulated(study: Plan, task: Task) -> Runs:
    """Truths and measurements of the runs of a task."""
    world, belief, actual, layout, believed = _at_point(study, task.point)
    draws = draw(world, actual, task.runs, study.seed, len(study.times))
    noisy = world.truth is None or world.truth.measurement_noise
    if actual.runs_in_lanes and compiles(simulate_runs, layout, actual, draws.first[:1], draws.w[:1], draws.v[:1], noisy):
        truth, z = simulate_runs(layout, actual, draws.first, draws.w, draws.v, noisy)
    else:
        truth, z = _one_by_one(world, actual, study.times, draws, noisy)
    return Runs(world, belief, layout, believed, truth, z, _faults(world, actual, study.times, draws, truth, z))


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
