"""Filters that propagate a square root of their covariance: what the square-root and the unscented filter have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.estimate.estimator import Estimate, Stopwatch
from piazzi.estimate.guarded import Guard, gate_bundle, gate_details
from piazzi.estimate.soundness import check_start
from piazzi.kernels import KernelSpec
from piazzi.kernels.bundle import Beliefs, Gate, Innovations, JointRoot, Measured, RootForm, Run
from piazzi.kernels.spec import machine_lanes
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

MOST_LANES = 16
Results = tuple[Gate, Beliefs, Innovations]


@dataclass(frozen=True)
class Root:
    """One way to carry and to measure a root.

    Attributes
    ----------
    fragment : "root_linear", by Jacobians, or "root_unscented", by sigma points
    unknowns : unit variances that an epoch's measurements depend on, in multiples of n
    eta, share : spread of sigma points, and the share of the sum of their even parts that each gets; zero without points
    gate : probability that a good row passes, None where every row is taken
    """

    fragment: str
    unknowns: int
    gate: float | None
    eta: float = 0.0
    share: float = 0.0

    def spec(self, problem: Problem) -> KernelSpec:
        """The module of a problem's filter."""
        points = self.fragment == "root_unscented"
        together = points and problem.moves_in_lanes
        # what is compiled apart is called with lanes; a whole program has the motion of one state in lanes, rounded alike,
        # if that needs not be done one by one now and then
        moved = "step_lanes" if together and (problem.model.reads_data or problem.model.events) else "step_alone"
        parts = (
            "transition",
            *((moved,) if points else ()),
            problem.noise_fragment,
            "epoch_guarded",
            "semidefinite",
            "triangle",
            self.fragment,
            "root",
            "filter_root",
        )
        return problem.spec(*parts, lanes=machine_lanes() if together else 1)

    def kernel(self, problem: Problem) -> RootKernel:
        """The compiled filter of a problem."""
        return RootKernel(self, problem)


class RootKernel:
    """A compiled filter of one problem, with its work space: run over all epochs, or over one from where it stands."""

    def __init__(self, root: Root, problem: Problem) -> None:
        self.problem, n, m = problem, problem.model.n, problem.model.width
        self._library = kernels.load(root.spec(problem))
        self._limits = Guard(1, root.gate).thresholds(m)
        A = root.unknowns * n
        self._root = RootForm(
            mean=np.empty(n),
            U=np.empty((n, n)),
            eta=root.eta,
            share=root.share,
            points=np.empty((2 * n + MOST_LANES, n)),
            rows=np.empty((A + n, n)),
        )
        self._joint = JointRoot.empty(A=A, M=m)

    def prior_root(self) -> Array:
        """Root of the prior covariance, (n, n)."""
        self._library.begin_root(self.problem.prior_bundle, self._root)
        return self._root.U.copy()  # type: ignore[no-any-return]

    def results(self, epochs: int, rows: int) -> Results:
        """Room for what a run over so many epochs and rows gives."""
        n, m = self.problem.model.n, self.problem.model.width
        return gate_bundle(1, self._limits, rows), Beliefs.empty(K=epochs, N=n), Innovations.empty(J=rows, M=m)

    def run(self, run: Run, measured: Measured, start: Array, U: Array, results: Results) -> Array:
        """Write the results of a run from the mean `start` with the root `U`; the last root, whose array is reused."""
        root = self._root
        root.mean[:], root.U[:] = start, U
        self._library.run_root_filter(run, self.problem.given_bundle, measured, root, self._joint, *results)
        return root.U  # type: ignore[no-any-return]


def linear_root(gate: float | None = None) -> Root:
    """The extended Kalman filter in square-root form."""
    return Root("root_linear", 1, gate)


def root_estimate(
    root: Root, problem: Problem, tracking: Tracking, about: Mapping[str, Any] = MappingProxyType({})
) -> Estimate:
    """Filtered means and covariances at every epoch, with details `about` the way.

    Raises ValueError where the tracking does not fit the problem.
    """
    inputs = prepare(problem, tracking)
    run, _, measured, _ = inputs.bundles(problem)
    kernel = root.kernel(problem)
    watch = Stopwatch()
    gate, beliefs, innovations = kernel.results(inputs.epochs, len(inputs.z))
    kernel.run(run, measured, problem.mean, kernel.prior_root(), (gate, beliefs, innovations))
    seconds = watch.seconds()
    (mean, P), (nu, S) = beliefs.members, innovations.members
    check_start(problem, inputs, mean[0])
    details: dict[str, Any] = dict(about)
    if root.gate is not None:
        details |= gate_details(gate, tracking)
    return Estimate(problem, tracking, mean, P, nu, S, inputs.epochs, seconds, details=details)
