"""Filters that propagate a square root of their covariance: what the square-root and the unscented filter have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.estimate.estimator import Estimate
from piazzi.estimate.guarded import Guard
from piazzi.estimate.kalman import check_start
from piazzi.estimate.stopwatch import Stopwatch
from piazzi.kernels.spec import machine_lanes
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare

MOST_LANES = 16


@dataclass(frozen=True)
class Root:
    """One way to carry and to measure a root.

    Attributes
    ----------
    fragment : "root_linear", by Jacobians, or "root_unscented", by sigma points
    unknowns : unit variances that an epoch's measurements depend on, in multiples of n
    settings : numbers that the fragment reads
    gate : probability that a good row passes, None where every row is taken
    """

    fragment: str
    unknowns: int
    settings: tuple[float, ...]
    gate: float | None

    def kernel(self, problem: Problem) -> RootKernel:
        """The compiled filter of a problem."""
        return RootKernel(self, problem)


class RootKernel:
    """A compiled filter of one problem, with its work space: run over all epochs, or over one from where it stands."""

    def __init__(self, root: Root, problem: Problem) -> None:
        self.problem, n, m = problem, problem.model.n, problem.model.width
        together = root.fragment == "root_unscented" and problem.moves_in_lanes
        parts = (
            "transition",
            problem.noise_fragment,
            "epoch_guarded",
            "semidefinite",
            "triangle",
            root.fragment,
            "root",
            "filter_root",
        )
        self._library = kernels.load(problem.spec(*parts, lanes=machine_lanes() if together else 1))
        self._numbers = (np.array(root.settings or (0.0,)), Guard(1, root.gate).thresholds(m))
        A = root.unknowns * n
        # sigma points, rows to be triangularised, sensitivities, joint root, correction, and scratch
        shapes = ((2 * n + MOST_LANES) * n, (A + n) * n, m * A, A * A, A, A, 2 * m)
        self._space = (*self._numbers, *(np.empty(size) for size in shapes))

    def prior_root(self) -> Array:
        """Root of the prior covariance, (n, n)."""
        U = np.empty((self.problem.model.n, self.problem.model.n))
        self._library.make_root(self.problem.covariance, U)
        return U

    def run(self, inputs: Inputs, start: Array, U: Array) -> tuple[Array, ...]:
        """Means (K, n), covariances (K, n, n), innovations (J, m) with theirs (J, m, m), and 1 for each row rejected, (J,).

        Begins at the mean `start` with the root `U`, which is replaced by the last one.
        """
        K, n, (J, m) = inputs.epochs, self.problem.model.n, inputs.z.shape
        mean, P = np.empty((K, n)), np.empty((K, n, n))
        nu, S, rejected = np.empty((J, m)), np.empty((J, m, m)), np.zeros(J, dtype=np.int64)
        self._library.run_root_filter(
            K,
            inputs.t,
            inputs.t_prior,
            inputs.count,
            inputs.scale,
            *inputs.measured(self.problem),
            self.problem.given,
            self.problem.process_noise.covariance,
            start,
            U,
            *self._space,
            rejected,
            mean,
            P,
            nu,
            S,
        )
        return mean, P, nu, S, rejected


def linear_root(gate: float | None = None) -> Root:
    """The extended Kalman filter in square-root form."""
    return Root("root_linear", 1, (), gate)


def root_estimate(
    root: Root, problem: Problem, tracking: Tracking, about: Mapping[str, Any] = MappingProxyType({})
) -> Estimate:
    """Filtered means and covariances at every epoch, with details `about` the way.

    Raises ValueError where the tracking does not fit the problem.
    """
    inputs = prepare(problem, tracking)
    kernel = root.kernel(problem)
    watch = Stopwatch()
    mean, P, nu, S, rejected = kernel.run(inputs, problem.mean, kernel.prior_root())
    seconds = watch.seconds()
    check_start(problem, inputs, mean[0])
    details: dict[str, Any] = dict(about)
    if root.gate is not None:
        out = rejected.astype(bool)
        out.setflags(write=False)
        details |= {"rejected": out, "rejected_count": int(out.sum())}
    return Estimate(problem, tracking, mean, P, nu, S, inputs.epochs, seconds, details=details)
