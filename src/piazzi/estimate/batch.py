"""Batch least squares: the initial state and the constants that fit all measurements, without process noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from piazzi.estimate.chain import Chain
from piazzi.estimate.considered import nominal, with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch, View
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.gauss_newton import Outcome, optimize
from piazzi.estimate.gradients import ended_exactly
from piazzi.estimate.shooting import OrbitChain, ShootingSolver, steps_taken
from piazzi.estimate.width import undetermined
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array, numeric
from piazzi.problem.inputs import prepare, with_prior_node

MAX_FROM_PRIOR = 15  # iterations from the prior before the graph is asked; where it converges at all, half of them suffice


@dataclass(frozen=True, eq=False)
class BatchLeastSquares:
    """Classical differential correction of the initial state and the estimated constants, with their prior.

    Parameters
    ----------
    start : (n,) or None
        First state and constants to start from, at the time of the prior; default the prior's mean.
    max_iterations : int
    tolerance : float
        Converged when no state moves by more than this many of its standard deviations.
    graph : bool
        Ask the full graph where the iterations do not converge.

    Notes
    -----
    Tapley, Schutz and Born, Statistical Orbit Determination (2004), ch. 4.  The dynamics are taken as exact: process noise
    and the errors of manoeuvres are left out.  The normal equations are never formed: the measurements are rotated into a
    triangle, column by column in units of the prior (Bierman 1977).  Where the iterations do not converge from the prior,
    they are continued from the full graph of the same problem, which needs no good start; ``details["start"]`` tells.
    """

    views: ClassVar[tuple[View, ...]] = ("delayed",)

    start: Any = None
    max_iterations: int = 50
    tolerance: float = 1e-6
    graph: bool = True

    def __post_init__(self) -> None:
        if self.max_iterations < 1:
            raise ValueError(f"max_iterations is {self.max_iterations}; it must be 1 or more")
        if not self.tolerance > 0:
            raise ValueError(f"tolerance is {self.tolerance}; it must be positive")

    @with_considered
    @ended_exactly(lambda near: near.details["first_state"])
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Means and covariances at every epoch; `success` is False where the iterations do not converge.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem, or the start has the wrong shape.
        """
        noise_free = undisturbed(problem)
        inputs = prepare(noise_free, tracking)
        nodes = with_prior_node(inputs)
        skip = nodes.epochs - inputs.epochs
        watch = Stopwatch()
        chain = (OrbitChain if OrbitChain.applies(noise_free, nodes) else Chain)(noise_free, nodes)
        solver = ShootingSolver(chain)
        outcome, used = self._optimize(chain, solver, noise_free, tracking)
        nu, S = chain.innovations()
        return Estimate(
            problem,
            tracking,
            chain.x[skip:],
            outcome.covariance[skip:],
            nu,
            S,
            outcome.iterations,
            watch.seconds(),
            "delayed",
            None,
            outcome.details
            | {"start": used, "first_state": chain.x[0].copy(), "residuals": chain.residuals()}
            | steps_taken(chain),
            outcome.failure or undetermined(noise_free, outcome.covariance[0], chain.x),
        )

    def _optimize(self, chain: Chain, solver: ShootingSolver, noise_free: Problem, tracking: Tracking) -> tuple[Outcome, str]:
        """Optimise from the start, and where that fails from the full graph."""
        first = self._first(noise_free)
        used = "prior" if self.start is None else "given"
        limit = self.max_iterations if self.start is not None else min(self.max_iterations, MAX_FROM_PRIOR)
        outcome = optimize(chain, solver, np.broadcast_to(first, chain.x.shape), limit, self.tolerance)
        if not (outcome.failure or "remark" in outcome.details) or not self.graph:
            return outcome, used
        graph = nominal(FactorGraph(), noise_free, tracking)
        begin = np.asarray(graph.details["first_state"]) if graph.success else chain.x[0].copy()
        again = optimize(chain, solver, np.broadcast_to(begin, chain.x.shape), self.max_iterations, self.tolerance)
        spent = outcome.iterations + graph.iterations + again.iterations
        failure = f"{again.failure}; the full graph: {graph.message}" if again.failure and not graph.success else again.failure
        return replace(again, iterations=spent, failure=failure), f"{used}, then graph" if graph.success else used

    def _first(self, problem: Problem) -> Array:
        if self.start is None:
            return problem.mean
        first = numeric(self.start, "start").reshape(-1)
        if first.shape != (problem.model.n,) or not np.isfinite(first).all():
            names = ", ".join(problem.model.names)
            raise ValueError(f"start has shape {np.shape(self.start)}; it must be ({problem.model.n},) ({names}), and finite")
        return first


def undisturbed(problem: Problem) -> Problem:
    """The problem with exact dynamics: no process noise, and manoeuvres as commanded."""
    if problem.is_noise_free:
        return problem  # another one would be checked anew
    noise = replace(problem.process_noise, covariance=np.zeros_like(problem.process_noise.covariance))
    return replace(problem, process_noise=noise, manoeuvres=[replace(m, covariance=None) for m in problem.manoeuvres])
