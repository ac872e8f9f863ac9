"""The extended Kalman filter in square-root form."""

from __future__ import annotations

from dataclasses import dataclass

from piazzi.estimate.considered import with_considered
from piazzi.estimate.estimator import Estimate
from piazzi.estimate.gradients import told_of
from piazzi.estimate.guarded import check_gate
from piazzi.estimate.live_root import LiveRootFilter
from piazzi.estimate.root import Root, linear_root, root_estimate
from piazzi.problem import Problem, Tracking


@dataclass(frozen=True)
class SquareRootKalmanFilter:
    """The extended Kalman filter, propagating a square root of the covariance, which stays semidefinite.

    Parameters
    ----------
    gate : float, optional
        Probability that a good measurement passes, as in `ExtendedKalmanFilter`.

    Notes
    -----
    Equal to `ExtendedKalmanFilter` up to rounding.  Prediction by Householder's reflections (Schmidt 1970), update after
    Potter (1963); see Kaminski, Bryson and Schmidt, IEEE Trans. Automatic Control 16 (1971).  A root spans half the orders of
    magnitude of a covariance, so it keeps as many digits as a covariance would in twice the precision.
    """

    gate: float | None = None

    def __post_init__(self) -> None:
        check_gate(self.gate)

    @with_considered
    @told_of
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Filtered means and covariances at every epoch.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem.
        """
        return root_estimate(self._root, problem, tracking)

    def start(self, problem: Problem) -> LiveRootFilter:
        """A filter that takes one measurement at a time, beginning at the prior."""
        return LiveRootFilter(problem, self._root)

    @property
    def _root(self) -> Root:
        return linear_root(self.gate)
