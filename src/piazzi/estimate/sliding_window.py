"""A factor graph over the newest states only; older ones live on in the prior of the oldest."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, ClassVar, NamedTuple

import numpy as np

from piazzi import kernels
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.considered import with_considered
from piazzi.estimate.estimator import Estimate, Stopwatch, View
from piazzi.estimate.gradients import told_of
from piazzi.estimate.live_window import LiveWindow, window_opens
from piazzi.estimate.losses import Loss, loss_of
from piazzi.estimate.robust_window import loss_numbers, window_fragments
from piazzi.estimate.width import NOT_BORDERED, TOO_WIDE, last_wide, too_wide, undetermined
from piazzi.kernels import KernelSpec
from piazzi.kernels.bundle import Beliefs, Chain, Innovations, Window
from piazzi.kernels.spec import lanes_for
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare

LOSSY = "with a loss, narrow the prior"


class WindowRun(NamedTuple):
    """Arrays of a run, in the order of the kernel: states as they left the window, newest states, innovations."""

    x: Array
    P_delayed: Array
    mean: Array
    P: Array
    nu: Array
    S: Array


def forward_of(estimate: Estimate) -> tuple[Array, ...]:
    """Means, covariances, innovations and theirs of a filter."""
    return estimate.mean, estimate.covariance, estimate.innovations, estimate.innovation_covariances


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

    Where an estimated constant multiplies states that process noise moves, windows of many states have the bias of the graph's
    joint mode, which can be many sigmas; the filter, the smoother and ``FactorGraph(constants="marginal")`` have not.

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
            if not (isinstance(value, Real) and float(value).is_integer() and float(value) >= 1):
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
    @told_of
    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Real-time means and covariances at every epoch, with the delayed ones beside them.

        Raises
        ------
        ValueError
            Where the tracking does not fit the problem.
        """
        inputs = prepare(problem, tracking)
        begin = self.first_states(inputs.t)
        weights = np.ones(len(inputs.z))
        watch = Stopwatch()
        run, failure, solver = self._run(problem, inputs, begin, weights, problem.mean, problem.covariance), "", "chain"
        if too_wide(problem, inputs, run.S):
            run, failure, solver = self._wide(problem, tracking, inputs, begin, run)
        seconds = watch.seconds()
        lag = self.lag if self.lag_seconds is None else None
        details: dict[str, Any] = {"lag": lag, "lag_seconds": self.lag_seconds, "solver": solver}
        if self.loss is not None:
            details |= {"loss": str(self.loss), "weights": weights}
        steps = inputs.epochs * self.iterations
        told = failure or undetermined(problem, run.P_delayed[0], run.x, run.P[-1])
        late = Estimate(problem, tracking, run.x, run.P_delayed, run.nu, run.S, steps, seconds, "delayed", None, details, told)
        return Estimate(problem, tracking, run.mean, run.P, run.nu, run.S, steps, seconds, "realtime", late, details, failure)

    def _run(
        self, problem: Problem, inputs: Inputs, begin: Array, weights: Array, prior_mean: Array, prior_covariance: Array
    ) -> WindowRun:
        """The window over these epochs, begun at a prior."""
        library = kernels.load(window_spec(problem, self.loss))
        K, N, (J, M) = inputs.epochs, problem.model.n, inputs.z.shape
        chain = window_chain(problem, inputs, begin, loss_numbers(problem, self.loss), weights)
        window = Window(
            iterations=self.iterations,
            m=prior_mean.copy(),
            P=prior_covariance.copy(),
            delayed=np.empty((K, N, N)),
            newest=np.empty((N, N)),
        )
        run, p, measured, _ = inputs.bundles(problem)
        beliefs, innovations = Beliefs.empty(K=K, N=N), Innovations.empty(J=J, M=M)
        library.run_window(begin, window, run, p, measured, chain, beliefs, innovations)
        return WindowRun(chain.x, window.delayed, *beliefs.members, *innovations.members)

    def _wide(
        self, problem: Problem, tracking: Tracking, inputs: Inputs, begin: Array, run: WindowRun
    ) -> tuple[WindowRun, str, str]:
        """The run for a prior too wide for covariances, what cannot be had of it, and how it was solved.

        Up to the last epoch that finds the state so open, the filter in square-root form, and states as they leave the window
        beside the chain of the measurements until then; from there on the window, with the filter's belief as its prior.
        """
        from piazzi.estimate.diffuse import first_epochs, last_epochs, smoothed
        from piazzi.estimate.root import linear_root, root_estimate

        if self.loss is not None or not BorderedSolver.applies(problem):
            why = LOSSY if self.loss is not None else NOT_BORDERED
            return run, f"{TOO_WIDE} beside the noise of the measurements: {why}", "chain"
        forward = root_estimate(linear_root(), problem, tracking)
        open_until = last_wide(problem, inputs, forward.innovation_covariances)
        if open_until < 0:  # only to the last digits of a covariance
            return run, "", "chain"
        K, own = inputs.epochs, open_until + 1
        whole = WindowRun(*(np.array(a) for a in (run.x, run.P_delayed, *forward_of(forward))))
        if own < K:
            rest = last_epochs(inputs, own)
            later = self._run(
                problem,
                rest,
                np.maximum(begin[own:] - own, 0),
                np.ones(len(rest.z)),
                np.array(forward.mean[open_until]),
                np.array(forward.covariance[open_until]),
            )
            row = inputs.first_row[own]
            for array, part, at in zip(whole, later, (own, own, own, own, row, row), strict=True):
                array[at:] = part
        for k in range(own):
            until = int(np.searchsorted(begin, k, side="right"))
            mean, covariance, _ = smoothed(problem, first_epochs(inputs, until), forward.mean[:until])
            whole.x[k], whole.P_delayed[k] = mean[k], covariance[k]
        return whole, "", "square root, then chain"

    def start(self, problem: Problem) -> LiveWindow:
        """A window that takes one measurement at a time, beginning at the prior."""
        return LiveWindow(problem, self.lag, self.lag_seconds, self.iterations, self.loss)


def window_chain(problem: Problem, inputs: Inputs, begin: Array, loss: Array, weights: Array) -> Chain:
    """All states, and buffers of the largest window; `loss` and `weights` of rows as `Chain` has them."""
    N, M = problem.model.n, problem.model.width
    newest = np.arange(len(begin))
    W = int((newest - begin).max()) + 1
    rows = int((inputs.first_row[newest + 1] - inputs.first_row[begin]).max())
    return Chain(
        x=np.empty((len(begin), N)),
        f=np.empty((W, N)),
        Phi=np.empty((W, N, N)),
        Q_all=np.empty((W if problem.noise_varies else 1, N, N)),
        nu=np.empty((rows, M)),
        H=np.empty((rows, M, N)),
        d_pred=np.empty((W, N)),
        P_pred=np.empty((W, N, N)),
        gains=np.empty((inputs.most_rows * M + N, N + 1)),
        multiplier=np.empty((W, N)),
        dx=np.empty((W, N)),
        scaling=np.empty((N, N)),
        loss=loss,
        weights=weights,
    )


def window_spec(problem: Problem, loss: Loss | None) -> KernelSpec:
    """The module of a problem's window."""
    return problem.spec(*window_fragments(problem, loss, "window"), lanes=lanes_for(problem.model.n))
