"""The fixed-interval smoother: the extended Kalman filter forward and once back, and again along what that found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.bank import with_first
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain, CovarianceSolver, chain_fragments
from piazzi.estimate.considered import with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch, View
from piazzi.estimate.gradients import told_of
from piazzi.estimate.soundness import check_start
from piazzi.estimate.width import NOT_BORDERED, TOO_WIDE, too_wide, undetermined
from piazzi.kernels import KernelSpec
from piazzi.kernels.bundle import Chain as Linearized
from piazzi.kernels.bundle import Innovations, Smoothed
from piazzi.kernels.spec import lanes_for
from piazzi.problem import Problem, Tracking
from piazzi.problem.inputs import prepare, with_prior_node


@dataclass(frozen=True)
class Smoother:
    """Every state given all measurements, linearised along the extended Kalman filter.

    Parameters
    ----------
    iterations : int
        Passes: the second and later ones are linearised along the states that the one before found (the iterated smoother:
        Bell, SIAM J. Optimization 4, 1994).
    cross_covariances : bool
        Keep Cov(x[k], x[k+1]) as ``details["cross_covariances"]``, shape (K - 1, n, n).

    Notes
    -----
    Rauch, Tung and Striebel (AIAA Journal 3, 1965), in the form of Bryson and Frazier (1963), which divides by no predicted
    covariance: process noise may be singular or zero.  After one pass the last state is the filter's.  Where the filter
    was far off, so is the linearisation: three passes mend what a filter lost over a gap, and `FactorGraph` repeats it until
    nothing moves, with step control, and equals this smoother on linear problems.
    """

    views: ClassVar[tuple[View, ...]] = ("delayed",)

    cross_covariances: bool = False
    iterations: int = 1

    def __post_init__(self) -> None:
        if self.iterations != int(self.iterations) or not 1 <= self.iterations <= 1000:
            raise ValueError(f"iterations is {self.iterations}; it must be a whole number from 1 to 1000")

    @with_considered
    @told_of
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Smoothed means and covariances at every epoch; innovations are the filter's.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem.
        """
        inputs = prepare(problem, tracking)
        library = kernels.load(smoother_spec(problem))
        K, n, (J, m) = inputs.epochs, problem.model.n, inputs.z.shape
        cross = np.empty((max(K - 1, 1), n, n))
        smoothed = Smoothed(
            mean=np.empty((K, n)), covariance=np.empty((K, n, n)), keep_cross=int(self.cross_covariances), cross=cross
        )
        innovations = Innovations.empty(J=J, M=m)
        chain = Linearized.empty(X=K, C=K, N=n, L=K if problem.noise_varies else 1, B=J, M=m, A=inputs.most_rows * m)
        watch = Stopwatch()
        library.run_smoother(*inputs.bundles(problem), chain, smoothed, innovations)
        (mean, covariance, *_), (nu, S) = smoothed.members, innovations.members
        seconds = watch.seconds()
        first = slice(inputs.first_row[1])
        seen = ~np.isnan(inputs.z[first])
        check_start(problem, inputs, (nu[first] + np.diagonal(S[first], axis1=1, axis2=2))[seen])
        if too_wide(problem, inputs, S):
            return self._beside_the_chain(problem, tracking)
        details: dict[str, Any] = {"cross_covariances": cross[: K - 1]} if self.cross_covariances else {}
        once = Estimate(problem, tracking, mean, covariance, nu, S, K, seconds, "delayed", details=details)
        return once if self.iterations == 1 or not once.success else self._again(once, watch)

    def _again(self, first: Estimate, watch: Stopwatch) -> Estimate:
        """Further passes: Gauss-Newton steps of all states, each taken as it is."""
        problem, tracking = first.problem, first.tracking
        inputs = prepare(problem, tracking)
        nodes = with_prior_node(inputs)
        skip = nodes.epochs - inputs.epochs
        chain = Chain(problem, nodes)
        solver = CovarianceSolver(chain)
        chain.x[:] = with_first(chain, first.mean)
        for _ in range(self.iterations - 1):
            chain.linearize()
            solver.solve(0.0)
            covariance = solver.marginals()
            chain.x += chain.dx
        nu, S = chain.innovations()
        details: dict[str, Any] = {"cross_covariances": solver.cross()[skip:]} if self.cross_covariances else {}
        K = self.iterations * inputs.epochs
        return Estimate(
            problem, tracking, chain.x[skip:], covariance[skip:], nu, S, K, watch.seconds(), "delayed", details=details
        )

    def _beside_the_chain(self, problem: Problem, tracking: Tracking) -> Estimate:
        """The same for a prior too wide for covariances: along the square-root filter, the first state beside the chain."""
        from piazzi.estimate.diffuse import smoothed
        from piazzi.estimate.root import linear_root, root_estimate

        inputs, watch = prepare(problem, tracking), Stopwatch()
        forward = root_estimate(linear_root(), problem, tracking)
        nu, S = forward.innovations, forward.innovation_covariances
        details: dict[str, Any] = {"solver": "bordered"}
        K = inputs.epochs
        if not BorderedSolver.applies(problem):
            failure = f"{TOO_WIDE} beside the noise of the measurements: {NOT_BORDERED}"
            return Estimate(
                problem, tracking, forward.mean, forward.covariance, nu, S, K, watch.seconds(), "delayed", failure=failure
            )
        mean = forward.mean
        for _ in range(self.iterations):
            mean, covariance, cross = smoothed(problem, inputs, mean)
        if self.cross_covariances:
            details["cross_covariances"] = cross
        failure = undetermined(problem, covariance[0], mean, covariance[-1])
        return Estimate(problem, tracking, mean, covariance, nu, S, K, watch.seconds(), "delayed", None, details, failure)


def smoother_spec(problem: Problem) -> KernelSpec:
    """The module of a problem's smoother."""
    return problem.spec(*chain_fragments(problem, "smoother"), lanes=lanes_for(problem.model.n))
