"""The unscented Kalman filter."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, sqrt

from piazzi.estimate.considered import with_considered
from piazzi.estimate.estimator import Estimate
from piazzi.estimate.guarded import check_gate
from piazzi.estimate.live_root import LiveRootFilter
from piazzi.estimate.root import Root, root_estimate
from piazzi.problem import Problem, Tracking


@dataclass(frozen=True)
class UnscentedKalmanFilter:
    """Kalman filter whose means and covariances come from 2 n + 1 points that are propagated and measured, not from Jacobians.

    Parameters
    ----------
    alpha : float
        Spread: the points are alpha sqrt(n + kappa) standard deviations from the mean.  From 1e-4 to 1 in the literature.  At
        1 the points lie where the belief does, and no weight of the mean is negative; small ones see the mean's neighbourhood
        alone, which goes wrong where the equations bend within a standard deviation, and rounding grows as 1 / alpha^2.
    beta : float
        What is known of the distribution beyond its covariance; 2 is best for a Gaussian.
    kappa : float
        Second spread; more than -n.
    gate : float, optional
        Probability that a good measurement passes, as in `ExtendedKalmanFilter`.

    Notes
    -----
    Julier and Uhlmann, Proc. IEEE 92 (2004), scaled after Wan and van der Merwe (2000).  A small alpha takes the second
    derivatives at the mean, one near 1 an average over the distribution.  With beta 0 the default is the cubature Kalman filter
    (Arasaratnam and Haykin, IEEE Trans. Automatic Control 54, 2009).  The points are those of the Cholesky factor, drawn
    anew after process noise is added: on linear problems that makes the filter exact.  A square root of the covariance is
    propagated (van der Merwe and Wan 2001), so singular covariances are ordinary and none turns indefinite.  Angles are
    averaged as differences from the central point's.  Process noise along an interval is the central point's.  All rows of
    one epoch are measured at the same predicted points.
    """

    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0
    gate: float | None = None

    def __post_init__(self) -> None:
        if not (isfinite(self.alpha) and self.alpha > 0):
            raise ValueError(f"alpha is {self.alpha}; it must be positive, usually from 1e-4 to 1")
        if not (isfinite(self.beta) and self.beta >= 0):
            raise ValueError(f"beta is {self.beta}; it must be zero or more, and is 2 for a Gaussian")
        if not isfinite(self.kappa):
            raise ValueError(f"kappa is {self.kappa}; it must be finite, usually 0 or 3 - n")
        check_gate(self.gate)

    @with_considered
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Filtered means and covariances at every epoch.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem, or the weights do not fit its number of states.
        """
        return root_estimate(self.root(problem), problem, tracking)

    def start(self, problem: Problem) -> LiveRootFilter:
        """A filter that takes one measurement at a time, beginning at the prior; raises ValueError as `estimate` does."""
        return LiveRootFilter(problem, self.root(problem))

    def root(self, problem: Problem) -> Root:
        """How it carries a root; raises ValueError where the weights do not fit the problem's number of states."""
        n = problem.model.n
        if not n + self.kappa > 0:
            raise ValueError(f"kappa is {self.kappa:g}; with {n} values it must be more than {-n}")
        eta = self.alpha * sqrt(n + self.kappa)
        # covariances are a sum with weights 1 for every even part, and beta - alpha^2 for their mean
        total = (self.beta * n + self.alpha**2 * self.kappa) / eta**2
        if total < 0:
            raise ValueError(
                f"alpha {self.alpha:g}, beta {self.beta:g} and kappa {self.kappa:g} allow indefinite covariances with "
                f"{n} values: beta must be at least {-(self.alpha**2) * self.kappa / n:g}"
            )
        return Root("root_unscented", 2, self.gate, eta, (sqrt(total) - 1.0) / n)
