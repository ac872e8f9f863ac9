"""Batch least squares: the initial state and the constants that fit all measurements, without process noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain
from piazzi.estimate.considered import nominal, with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch, View
from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.gauss_newton import Outcome, optimize
from piazzi.estimate.gradients import ended_exactly
from piazzi.estimate.width import undetermined
from piazzi.kernels.spec import FILLS_REGISTERS
from piazzi.problem import Problem, Tracking
from piazzi.problem.arcs import Arc, arc
from piazzi.problem.checks import Array, numeric
from piazzi.problem.inputs import Inputs, prepare, with_prior_node

MAX_FROM_PRIOR = 15  # iterations from the prior before the graph is asked; where it converges at all, half of them suffice


class OrbitChain(Chain):
    """A chain whose states are one orbit, linearised while it is followed: by a multi-step method, or interval by interval.

    For methods whose states cannot be linearised several at a time.
    """

    dynamics = "linearize_given"

    def __init__(self, problem: Problem, inputs: Inputs) -> None:
        super().__init__(problem, inputs)
        self.steps = problem.steps(float(inputs.t[0]), float(inputs.t[-1]))
        self._arc: Arc | None = None

    def orbit(self, first: Array) -> Array:
        """States at all nodes (K, n) of the orbit from `first`."""
        if self._arc is None or not np.array_equal(self._arc.x[0], first):
            self._arc = arc(self.problem, self.inputs.t, first, self.steps, derivative=True)
        return self._arc.x

    def linearize(self) -> float:
        self.x[:] = self.orbit(self.x[0])
        assert self._arc is not None
        self.f[:-1], self.Phi[:-1] = self.x[1:], self._arc.Phi
        return super().linearize()

    @staticmethod
    def applies(problem: Problem, inputs: Inputs) -> bool:
        """Whether it is the faster way."""
        assert problem.integrator is not None
        if not problem.moves_in_lanes or problem.model.n > FILLS_REGISTERS:
            return True  # with lanes or without them: the way, and so the rounding, is a matter of the problem alone
        return bool(problem.integrator.arc_scheme) and problem.steps(float(inputs.t[0]), float(inputs.t[-1])).grid is not None


class ShootingSolver(BorderedSolver):
    """The bordered solver for orbits that hold the dynamics throughout: only their first state and the constants move."""

    name = "batch"

    def __init__(self, chain: Chain) -> None:
        super().__init__(chain)
        if isinstance(chain, OrbitChain):
            return
        i = chain.inputs
        self.x: Array = np.empty_like(chain.x)
        library = kernels.load(chain.problem.spec("transition", "propagate"))
        self._propagate: Callable[[], None] = library.run_propagation.bind(
            i.epochs, i.t, i.count, chain.problem.given_bundle, self.x
        )

    def begin(self, states: Array) -> Array:
        return self._orbit(states[0])

    def moved(self, states: Array, step: Array) -> Array:
        return self._orbit(states[0] + step[0])

    def _orbit(self, first: Array) -> Array:
        """States at all nodes (K, n) of the orbit from `first`."""
        if isinstance(self.chain, OrbitChain):
            return self.chain.orbit(first).copy()
        self.x[0] = first
        self._propagate()
        return self.x.copy()


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
            | _steps(noise_free, nodes),
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
    noise = replace(problem.process_noise, covariance=np.zeros_like(problem.process_noise.covariance))
    return replace(problem, process_noise=noise, manoeuvres=[replace(m, covariance=None) for m in problem.manoeuvres])


def _steps(problem: Problem, nodes: Inputs) -> dict[str, float]:
    """The step of a multi-step method's grid in seconds, where there is one."""
    grid = problem.steps(float(nodes.t[0]), float(nodes.t[-1])).grid
    return {} if grid is None else {"grid_step": grid}
