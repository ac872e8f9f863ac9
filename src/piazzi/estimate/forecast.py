"""What an estimate says about times after its last epoch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.estimate.soundness import defect
from piazzi.kernels.bundle import Belief, Beliefs, Run
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array, Locked, numeric
from piazzi.text import brief

MOST_PARTS = 10**7
STEP = 0.1  # of a considered parameter's sigma, to either side: small beside what bends, large beside rounding


@dataclass(frozen=True, eq=False)
class Forecast(Locked):
    """Beliefs propagated from the last epoch of an estimate.

    Attributes
    ----------
    problem : what was estimated
    start : float, time of the last epoch, s
    times : (P,), s
    mean : (P, n), covariance : (P, n, n)
    sigma : (P, n), standard deviations, NaN where a variance is negative
    growth : (P, n), sigma over that at the last epoch; 1 where a value is known and stays so, infinite where it was known
    success, message : every belief is finite with a semidefinite covariance; else which is not
    """

    problem: Problem
    start: float
    times: Array
    mean: Array
    covariance: Array
    growth: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        for a in (self.times, self.mean, self.covariance, self.growth):
            a.setflags(write=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `mean`."""
        return self.problem.model.names

    @property
    def success(self) -> bool:
        return not self.message

    @cached_property
    def message(self) -> str:
        return defect(self.mean, self.covariance, self.names, lambda k: f"at t = {self.times[k]:g} s", "the prediction")

    @property
    def sigma(self) -> Array:
        return _sigma(self.covariance)

    def __str__(self) -> str:
        lines = [f"{'t [s]':>14s}" + "".join(f"  {name:>14s} {'sigma':>9s} {'growth':>8s}" for name in self.names)]
        for t, m, s, g in zip(self.times, self.mean, self.sigma, self.growth, strict=True):
            cells = (f"  {a:14.7g} {b:9.3g} {c:7.3g}x" for a, b, c in zip(m, s, g, strict=True))
            lines.append(f"{t:14.7g}" + "".join(cells))
        return "\n".join(lines)


def forecast(
    problem: Problem, epochs: Array, last: tuple[Array, Array], considered: Mapping[str, Array], at: Array
) -> Forecast:
    """The belief at the last of the epochs (K,) at later times; `considered` are its changes by a sigma of each parameter."""
    start, (x, P_last) = float(epochs[-1]), last
    way = (at, start, *_parts(problem, epochs, x, at))
    own = P_last - sum((np.outer(s, s) for s in considered.values()), np.zeros_like(P_last))
    mean, P = _carried(problem, way, x, own)
    for name, s in considered.items():
        above, below = (_carried(moved(problem, name, side), way, x + side * s, own)[0] for side in (STEP, -STEP))
        s_then = (above - below) / (2 * STEP)
        P += s_then[:, :, None] * s_then[:, None, :]
    before, after = _sigma(P_last[None]), _sigma(P)
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = np.where((after == 0) & (before == 0), 1.0, after / before)
    return Forecast(problem, start, at, mean, P, growth)


def moved(problem: Problem, name: str, sigmas: float) -> Problem:
    """The problem with another value of a considered parameter."""
    given = problem.parameters[name]
    value = given.mean[0] + sigmas * np.sqrt(given.covariance[0, 0])
    return replace(problem, parameters={**problem.parameters, name: Gaussian(value, given.covariance)})


def _carried(problem: Problem, way: tuple[Any, ...], x: Array, P: Array) -> tuple[Array, Array]:
    """Means (P, n) and covariances (P, n, n) at the times of `way`."""
    (t, start, parts, count, scale), n = way, problem.model.n
    first_row, Q = np.zeros(len(t) + 1, dtype=np.int64), problem.process_noise.covariance
    run = Run(epochs=len(t), t_prior=start, t=t, count=count, scale=scale, first_row=first_row, Q=Q)
    last = Belief(mean=np.ascontiguousarray(x), covariance=np.ascontiguousarray(P))
    beliefs = Beliefs.empty(K=len(t), N=n)
    library = kernels.load(problem.spec("transition", problem.noise_fragment, "forecast"))
    library.run_forecast(run, parts, problem.given_over(float(start), float(t[-1])), last, beliefs)
    return beliefs.members  # type: ignore[no-any-return]


def _sigma(covariance: Array) -> Array:
    """Standard deviations (P, n) of covariances (P, n, n), NaN for negative variances."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))


def checked_times(times: Any, start: float) -> Array:
    """Times (P,) that do not decrease, none before `start`; raises ValueError for others."""
    at = np.array(numeric(times, "times").reshape(-1))
    if not at.size:
        raise ValueError("there are no times to predict")
    for i, t in enumerate(at.tolist()):
        if not np.isfinite(t):
            raise ValueError(f"time {i} is {t}; it must be finite")
        if t < start:
            raise ValueError(
                f"time {i} is {t:g} s, before the last epoch at {start:g} s: for an estimate there, give the tracking a row of "
                "missing values (NaN) at that time"
            )
        if i and t < at[i - 1]:
            raise ValueError(f"times must not decrease: time {i} is {t:g} s, after {at[i - 1]:g} s")
    return at


def _parts(problem: Problem, epochs: Array, x: Array, at: Array) -> tuple[Array, Array, Array]:
    """The way to each time: in how many parts, the substeps of a part, and its noise scale.

    Equal parts no longer than the tracking's median interval: a fixed number of substeps, a step that is the model itself and
    noise per step all mean one such interval.
    """
    known = epochs if problem.prior_time is None else np.append(problem.prior_time, epochs)
    usual = [gap for gap in np.diff(known).tolist() if gap > 0]
    dt = np.diff(at, prepend=epochs[-1])
    wanted = np.ceil(dt / np.median(usual) * (1 - 1e-9)) if usual else np.sign(dt)
    if wanted.sum() > MOST_PARTS:
        raise ValueError(
            f"the last time is {wanted.sum():.3g} of the tracking's intervals ahead; at most {MOST_PARTS:g} are allowed"
        )
    part = dt / np.maximum(wanted, 1)
    return (
        wanted.astype(np.int64),
        problem.counts(part, float(epochs[-1]), float(at[-1]), x),
        problem.process_noise.scale(part),
    )
