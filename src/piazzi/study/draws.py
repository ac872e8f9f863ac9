"""Random numbers of a run: children of the study's seed by the run's number and by what they are for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.problem import Problem, Truth
from piazzi.problem.checks import Array
from piazzi.simulation import MOST_DRAWS, NoTruthError, Rule, placed

PRIOR, PROCESS, MEASUREMENT = range(3)


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
