"""The chain of states with a loss on its measurements: rows that do not fit the others are weighted down."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from piazzi.estimate.chain import MEASUREMENT, Chain, Solver
from piazzi.estimate.gauss_newton import Outcome, optimize
from piazzi.estimate.guarded import Guard, guarded_run
from piazzi.estimate.kalman import update_fragments
from piazzi.estimate.losses import Huber, Loss
from piazzi.estimate.width import TOO_WIDE
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

# how far, and how often, a loss is followed that only leads to the next
HUBER_TOLERANCE, HUBER_ITERATIONS = 1e-2, 15
# reweighting converges linearly, where Gauss-Newton alone is nearly quadratic
REWEIGHTED_FACTOR = 4
# mean weight below which a solution may be one that rejects most measurements: on Gaussian noise it is 0.87 to 0.96
LOW_WEIGHT = 0.8
# share of good measurements that the filter behind a start takes
GATE = 0.999


class RobustChain(Chain):
    """A chain whose measurements are weighted row by row, after each linearisation, as its `loss` wants.

    Innovations and Jacobians are scaled by the root of the weight, so that every solver works on them as they are and the
    gradient is that of the robust cost.
    """

    reweighted: ClassVar[bool] = True

    def __init__(self, problem: Problem, inputs: Inputs, loss: Loss) -> None:
        super().__init__(problem, inputs)
        self.loss = loss
        self.weights = np.ones(len(inputs.z))
        self._there = ~np.isnan(inputs.z)
        self._components = self._there.sum(axis=1)

    def linearize(self) -> float:
        """Linearise about `x` and weigh; half the robust cost there."""
        super().linearize()
        with np.errstate(all="ignore"):
            s = np.where(self._there, self.nu**2, 0.0).sum(axis=1)
            square = self.loss.squares(self.nu.shape[1])[self._components]
            sound = np.isfinite(s)  # a measurement without a prediction keeps its weight, so that it shows
            self.weights = np.where(sound, self.loss.weight(s, square), 1.0)
            self.report[MEASUREMENT] = np.where(sound, self.loss.cost(s, square), s).sum()
        root = np.sqrt(self.weights)
        self.nu *= root[:, None]
        self.H *= root[:, None, None]
        return self.cost()

    @property
    def mostly_rejects(self) -> bool:
        """Whether so many rows are weighted down that these may be the good ones."""
        measured = self._components > 0
        return bool(self.weights[measured].mean() < LOW_WEIGHT)


def chain_for(problem: Problem, inputs: Inputs, loss: Loss | None) -> Chain:
    """The chain, with a loss or without."""
    return Chain(problem, inputs) if loss is None else RobustChain(problem, inputs, loss)


def gated_run(problem: Problem, inputs: Inputs) -> Array:
    """Means (K, n) of an extended Kalman filter that leaves out what it cannot believe."""
    mean: Array = guarded_run(problem, inputs, update_fragments(problem, "auto"), Guard(1, GATE))[0]
    return mean


def solve_at(chain: Chain, solver: Solver, states: Array) -> None:
    """Leave the chain at `states` (K, n), linearised and solved there."""
    chain.x[:] = states
    if np.isfinite(states).all():
        chain.linearize()
        solver.solve(0.0)
    else:
        chain.d_pred.fill(np.nan)
        chain.P_pred.fill(np.nan)


def minimize(
    chain: Chain,
    solver: Solver,
    start: Array,
    max_iterations: int,
    tolerance: float,
    widest: float = np.inf,
    direct: bool = False,
) -> Outcome:
    """`optimize`; a loss that adds minima is followed from where the one that adds none leads, which is Huber's.

    With `direct`, for starts that mean something, it is followed from `start` itself too, and the cheaper solution stays.
    """
    if not isinstance(chain, RobustChain):
        return optimize(chain, solver, start, max_iterations, tolerance, widest)
    if isinstance(chain.loss, Huber):
        return optimize(chain, solver, start, REWEIGHTED_FACTOR * max_iterations, tolerance, widest)
    wanted, chain.loss = chain.loss, Huber()
    first = optimize(chain, solver, start, min(HUBER_ITERATIONS, max_iterations), HUBER_TOLERANCE, widest)
    chain.loss = wanted
    if first.failure == TOO_WIDE:
        return first
    last = optimize(chain, solver, chain.x.copy(), REWEIGHTED_FACTOR * max_iterations, tolerance)
    indirect = replace(last, iterations=first.iterations + last.iterations)
    return _or_from_start(chain, solver, start, REWEIGHTED_FACTOR * max_iterations, tolerance, indirect) if direct else indirect


def _or_from_start(
    chain: Chain, solver: Solver, start: Array, max_iterations: int, tolerance: float, indirect: Outcome
) -> Outcome:
    """The outcome `indirect`, at which the chain stands, or that from `start` itself where cheaper; the chain is left there."""
    states = chain.x.copy()
    own = optimize(chain, solver, start, max_iterations, tolerance)
    iterations = indirect.iterations + own.iterations
    if not own.failure and (indirect.failure or own.details["cost"] < indirect.details["cost"]):
        return replace(own, iterations=iterations)
    solve_at(chain, solver, states)
    return replace(indirect, iterations=iterations)
