"""The extended Kalman filter: its two steps, and whole runs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any, Literal, get_args

import numpy as np

from piazzi import kernels
from piazzi.estimate.considered import with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch
from piazzi.estimate.gradients import told_of
from piazzi.estimate.guarded import Guard, GuardedLiveFilter, check_gate, gate_details, guarded_run
from piazzi.estimate.live import LiveFilter
from piazzi.estimate.root import linear_root, root_estimate
from piazzi.estimate.soundness import check_start
from piazzi.estimate.width import TOO_WIDE, too_wide
from piazzi.kernels import KernelSpec
from piazzi.kernels.bundle import Belief, Beliefs, Innovations
from piazzi.problem import Gaussian, Problem, Tracking
from piazzi.problem.checks import Array, covariance, finite_vector, numeric
from piazzi.problem.inputs import Inputs, measured_by, prepare
from piazzi.text import brief

Update = Literal["auto", "joint", "components"]


def update_fragments(problem: Problem, update: Update) -> tuple[str, ...]:
    """The fragments that do the update: by components where every R is diagonal, unless told otherwise."""
    if update == "auto":
        update = "joint" if problem.is_correlated else "components"
    return ("decorrelate", "update_components", "epoch") if update == "components" else ("update_joint", "epoch")


@dataclass(frozen=True)
class ExtendedKalmanFilter:
    """Kalman filter about the current estimate, with the Jacobian of the step that was taken.

    Parameters
    ----------
    update : "auto", "joint" or "components"
        All components of a measurement at once, or one after the other (a full R is decorrelated first); the results are
        equal.  "auto" takes components where every R is diagonal.
    iterations : int
        Gauss-Newton steps per epoch, on the prediction and the measurements of the epoch together: from the second on, the
        measurements are linearised at the estimate that they gave.  1 is the standard EKF.
    gate : float, optional
        Probability that a good measurement passes, such as 0.999.  A row whose nu^T S^-1 nu at the prediction lies beyond that
        quantile of chi-square is left out; ``details["rejected"]`` marks such rows, ``details["rejected_count"]`` counts them.
        After five such rows in a row the belief is doubted instead: the gate is open until a row lies within it again, which
        `message` and ``details["reopened"]`` say.
        Default: every row is taken.

    Notes
    -----
    Where a prior is 1e10 times as wide as the noise of a measurement, in variance, a covariance keeps less than six digits of
    what is left: such runs are done again by `SquareRootKalmanFilter`, and ``details["solver"]`` says so.

    Jazwinski, Stochastic Processes and Filtering Theory (1970), ch. 8; covariance updates in Joseph form.  All measurements
    of one epoch are linearised once, at the predicted state (or, iterated, at the estimate so far).

    Iterating pays where an epoch sees all that it is nonlinear in, and sees it sharply: range and bearing of two radars, 100
    runs, RMS error 0.030 instead of 0.087 and mean NEES 3.8 instead of 4300, for 4 states.  Where an epoch sees less, its mode
    is a sharp guess about the rest, and iterating is worse: on 500 runs of b612-range (ranges alone) the median position RMSE
    is 1.3 m plain, 2.1 m with 5 iterations and 3.3 m with 20.  A window or a graph iterates over many epochs, and gains.
    """

    update: Update = "auto"
    iterations: int = 1
    gate: float | None = None

    def __post_init__(self) -> None:
        if self.update not in get_args(Update):
            raise ValueError(f"update is {self.update!r}; it must be one of {', '.join(get_args(Update))}")
        if self.iterations != int(self.iterations) or not 1 <= self.iterations <= 1000:
            raise ValueError(f"iterations is {self.iterations}; it must be a whole number from 1 to 1000")
        check_gate(self.gate)

    @cached_property
    def guard(self) -> Guard | None:
        """What goes beyond the plain filter, None where nothing does."""
        return None if self.iterations == 1 and self.gate is None else Guard(int(self.iterations), self.gate)

    @with_considered
    @told_of
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Filtered means and covariances at every epoch.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem.
        """
        inputs, guard = prepare(problem, tracking), self.guard
        if guard is None:
            mean, P, nu, S, seconds = filter_run(problem, inputs, self.update)
            if not too_wide(problem, inputs, S):
                return Estimate(problem, tracking, mean, P, nu, S, len(mean), seconds)
            return self._in_root_form(problem, tracking)
        watch = Stopwatch()
        mean, P, nu, S, gate = guarded_run(problem, inputs, update_fragments(problem, self.update), guard)
        seconds = watch.seconds()
        check_start(problem, inputs, mean[0])
        wide = too_wide(problem, inputs, S)
        if wide and self.iterations == 1:
            return self._in_root_form(problem, tracking)
        details = {} if self.gate is None else gate_details(gate, tracking)
        failure = f"{TOO_WIDE} beside the noise of the measurements: take one iteration per epoch" if wide else ""
        steps = inputs.epochs * guard.iterations
        return Estimate(problem, tracking, mean, P, nu, S, steps, seconds, details=details, failure=failure)

    def _in_root_form(self, problem: Problem, tracking: Tracking) -> Estimate:
        """The same filter with a square root of its covariance, for priors too wide for a covariance."""
        return root_estimate(linear_root(self.gate), problem, tracking, {"solver": "square root"})

    def start(self, problem: Problem) -> LiveFilter:
        """A filter that takes one measurement at a time, beginning at the prior."""
        fragments = update_fragments(problem, self.update)
        return LiveFilter(problem, fragments) if self.guard is None else GuardedLiveFilter(problem, fragments, self.guard)


def filter_run(problem: Problem, inputs: Inputs, update: Update = "auto") -> tuple[Array, Array, Array, Array, float]:
    """Means (K, n), covariances (K, n, n), innovations (J, m), their covariances (J, m, m), and the seconds it took."""
    library = kernels.load(filter_spec(problem, update))
    K, n, (J, m) = len(inputs.t), len(problem.mean), inputs.z.shape
    beliefs, innovations = Beliefs.empty(K=K, N=n), Innovations.empty(J=J, M=m)
    started = time.perf_counter()
    library.run_filter(*inputs.bundles(problem), beliefs, innovations)
    seconds = time.perf_counter() - started
    (mean, P), (nu, S) = beliefs.members, innovations.members
    if not isfinite(mean.item(0)):  # a failed update leaves no number of the state
        check_start(problem, inputs, mean[0])
    return mean, P, nu, S, seconds


def filter_spec(problem: Problem, update: Update = "auto") -> KernelSpec:
    """The module of a problem's filter."""
    kind = update, problem.noise_fragment, problem.is_correlated
    spec = problem.specs.get(kind)
    if spec is None:
        fragments = ("transition", problem.noise_fragment, *update_fragments(problem, update), "filter")
        spec = problem.specs[kind] = problem.spec(*fragments)
    return spec


@dataclass(frozen=True, eq=False)
class Prediction:
    """A belief propagated forward: mean (n,), covariance (n, n), the transition matrix Phi and the process noise Q."""

    mean: Array
    covariance: Array
    Phi: Array
    Q: Array

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Updated:
    """A belief after a measurement: mean (n,), covariance (n, n), innovation (m,) and its covariance (m, m)."""

    mean: Array
    covariance: Array
    innovation: Array
    innovation_covariance: Array

    __repr__ = brief


def predict(problem: Problem, belief: Any, t: float, dt: float) -> Prediction:
    """Carry a belief (anything with `mean` and `covariance`) from time `t` over `dt` seconds.

    Raises
    ------
    ValueError
        For wrong shapes, or `dt` not positive.
    """
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt is {dt} s; a prediction goes forward")
    x, P = _belief(problem, belief)
    interval = np.array([float(dt)])
    count, scale = int(problem.counts(interval, float(t), float(t + dt), x)[0]), float(problem.process_noise.scale(interval)[0])
    Phi, Q = np.empty_like(P), np.empty_like(P)
    library = kernels.load(problem.spec("transition", problem.noise_fragment, "predict"))
    belief, noise = Belief(mean=x, covariance=P), problem.process_noise.covariance
    clock = np.array([float(t), float(dt), scale])
    library.predict_once(clock, np.array([count]), problem.given_over(t, t + dt), noise, belief, Phi, Q)
    return Prediction(x, P, Phi, Q)


def update(problem: Problem, belief: Any, station: str, z: Any, t: float = 0.0, method: Update = "auto") -> Updated:
    """Take in one measurement of a station, NaN where a component is missing.

    Raises
    ------
    ValueError
        For wrong shapes or an unknown station.
    """
    x, P = _belief(problem, belief)
    s = problem.station_index(station)
    width, m = len(problem.stations[s].noise), problem.model.width
    values = numeric(z, f"measurement of station {station!r}").reshape(-1)
    if values.shape != (width,) or np.isinf(values).any():
        raise ValueError(f"measurement of station {station!r} is {z!r}; it must be {width} numbers, NaN where missing")
    row = np.full((1, m), np.nan)
    row[0, :width] = values
    innovations, measured = Innovations.empty(J=1, M=m), measured_by(problem, row, np.array([s]))
    library = kernels.load(problem.spec("transition", *update_fragments(problem, method), "update"))
    library.update_once(float(t), problem.given_over(t, t), measured, Belief(mean=x, covariance=P), innovations)
    nu, S = innovations.members
    return Updated(x, P, nu[0, :width], S[0, :width, :width])


def _belief(problem: Problem, belief: Any) -> tuple[Array, Array]:
    """Writable copies of a belief's mean and covariance."""
    names = problem.model.names
    if belief is problem.prior or (
        isinstance(belief, Gaussian) and np.size(belief.mean) == len(problem.model.states) < len(names)
    ):
        belief = Gaussian([*belief.mean, *problem.mean[len(problem.model.states) :]], problem.covariance)
    mean = finite_vector(belief.mean, len(names), "mean", names)
    return mean.copy(), covariance(belief.covariance, len(names), "covariance", names).copy()
