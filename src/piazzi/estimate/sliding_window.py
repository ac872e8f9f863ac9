"""A factor graph over the newest states only; older ones live on in the prior of the oldest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.considered import with_considered
from piazzi.estimate.determined import undetermined
from piazzi.estimate.estimator import Estimate, View
from piazzi.estimate.live_window import LiveWindow, window_opens
from piazzi.estimate.losses import loss_of
from piazzi.estimate.robust_window import row_space, row_weights, window_fragments
from piazzi.estimate.stopwatch import Stopwatch
from piazzi.kernels.spec import lanes_for
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare


@dataclass(frozen=True)
class SlidingWindow:
    """Factor graph over the most recent `lag` states, moved on by one at every epoch.

    Parameters
    ----------
    lag : int
        States kept, the newest included.
    iterations : int
        Gauss-Newton steps per epoch.
    lag_seconds : float, optional
        Keep the states of the last so many seconds instead.
    loss : Huber, Cauchy or Tukey, or "huber", "cauchy" or "tukey"; optional
        Rows that do not fit the others are weighted down; ``details["weights"]`` (J,) has the weight of each row when its
        state left the window.  Covariances are those of the weighted rows (see `FactorGraph`).

    Notes
    -----
    `Estimate.mean` is the newest state as known in real time; `Estimate.delayed` has each state as it left the window, and
    for those still inside at the end the final window's estimate.  A state that leaves is marginalised by one linearised
    Kalman step: its measurements keep the linearisation of its last step, its dynamics are linearised at its current estimate.
    One state and one iteration are the extended Kalman filter; all states, iterated, are the full graph.  With a loss, the
    rows of the newest epoch are at first weighted by their innovation nu^T S^-1 nu, later by their residual alone, like all
    others: while little is known, a large innovation says nothing against a row.

    A direction that a wide prior left open, and that the measurements did not close, is named by the delayed estimate, which
    then is no success, as by the full graph.
    """

    views: ClassVar[tuple[View, ...]] = ("realtime", "delayed")

    lag: int = 100
    iterations: int = 1
    lag_seconds: float | None = None
    loss: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "loss", loss_of(self.loss))
        for what in ("lag", "iterations"):
            value = getattr(self, what)
            if value != int(value) or value < 1:
                raise ValueError(f"{what} is {value}; it must be a whole number of 1 or more")
        if self.lag_seconds is not None and not 0 <= self.lag_seconds < float("inf"):
            raise ValueError(f"lag_seconds is {self.lag_seconds}; it must be zero or more")

    def first_states(self, times: Array) -> Array:
        """Index of the oldest state in the window at each epoch, (K,) int64."""
        newest = np.arange(len(times), dtype=np.int64)
        if self.lag_seconds is None:
            return np.maximum(newest - (self.lag - 1), 0)
        return np.asarray(np.searchsorted(times, window_opens(times, self.lag_seconds)), dtype=np.int64)

    @with_considered
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Real-time means and covariances at every epoch, with the delayed ones beside them.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem.
        """
        inputs = prepare(problem, tracking)
        begin = self.first_states(inputs.t)
        library = kernels.load(problem.spec(*window_fragments(problem, self.loss, "window"), lanes=lanes_for(problem.model.n)))
        K, N, M = inputs.epochs, problem.model.n, problem.model.width
        J = len(inputs.z)
        x, mean, P, P_delayed = np.empty((K, N)), np.empty((K, N)), np.empty((K, N, N)), np.empty((K, N, N))
        nu, S = np.empty((J, M)), np.empty((J, M, M))
        work = row_space(problem, self.loss, J)
        watch = Stopwatch()
        library.run_window(
            K,
            begin,
            self.iterations,
            inputs.t,
            inputs.t_prior,
            inputs.count,
            inputs.scale,
            *inputs.measured(problem),
            problem.given,
            problem.process_noise.covariance,
            problem.mean,
            problem.covariance,
            *window_space(problem, inputs, begin, work),
            x,
            P_delayed,
            mean,
            P,
            nu,
            S,
        )
        seconds = watch.seconds()
        lag = self.lag if self.lag_seconds is None else None
        details: dict[str, Any] = {"lag": lag, "lag_seconds": self.lag_seconds, "solver": "chain"}
        if self.loss is not None:
            details |= {"loss": str(self.loss), "weights": row_weights(work, J)}
        steps = K * self.iterations
        told = undetermined(problem, P_delayed[0], x, P[-1])
        late = Estimate(problem, tracking, x, P_delayed, nu, S, steps, seconds, "delayed", None, details, told)
        return Estimate(problem, tracking, mean, P, nu, S, steps, seconds, "realtime", late, details)

    def start(self, problem: Problem) -> LiveWindow:
        """A window that takes one measurement at a time, beginning at the prior."""
        return LiveWindow(problem, self.lag, self.lag_seconds, self.iterations, self.loss)


def window_space(problem: Problem, inputs: Inputs, begin: Array, work: Array) -> tuple[Array, ...]:
    """Buffers of the largest window, in the order of the kernel; `work` is the one for linearised rows."""
    N, M = problem.model.n, problem.model.width
    newest = np.arange(len(begin))
    W = int((newest - begin).max()) + 1
    rows = int((inputs.first_row[newest + 1] - inputs.first_row[begin]).max()) * M
    in_epoch = inputs.most_rows * M
    Q_all = np.empty((W if problem.noise_varies else 1, N, N))
    return (
        np.empty((W, N)),
        np.empty((W, N, N)),
        Q_all,
        np.empty(rows),
        np.empty((rows, N)),
        np.empty((W, N)),
        np.empty((W, N, N)),
        np.empty((in_epoch + N, N + 1)),
        np.empty((W, N)),
        np.empty((W, N)),
        work,
        np.empty((N, N)),
    )
