"""A prior propagated back to where the measurements begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.estimate.forecast import moved
from piazzi.estimate.kalman import Prediction, predict
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array
from piazzi.problem.manoeuvres import check_after

MOST_CORRELATION = 0.02  # of the moved prior's error with the process noise of the gap: sigmas are then right to 1 %
NEWTON = 10  # steps from the state integrated backwards to the one whose step forward ends at the prior mean
SAME = 1e-6  # of a sigma, by which the step forward may miss the prior mean
_ROUNDING = 1e-12
_NOT_FOUND = "no state was found there that moves to the prior mean; give an earlier prior time"


def with_prior_at(problem: Problem, t: float) -> Problem:
    """The problem with its prior propagated back to time `t`, for measurements that begin before `prior_time`.

    The mean x solves f(x) = m, with f the step forward over the gap and m the prior mean; with Phi the derivative of f at x and
    Q the process noise of the gap, the covariance is Phi^-1 (P + Q) Phi^-T.  A problem whose prior is at `t` or earlier, or at
    the first measurement, is returned as it is: estimators propagate a prior forward by themselves.

    Raises
    ------
    ValueError
        Where the moved prior would not be a sound one: for a model that is a step or has memories; where the equations cannot
        be integrated backwards; where an uncertain parameter drives the motion, so that its error would be correlated with
        that of the states; and where the noise of the gap is not small beside the prior (its correlation with the moved
        prior's error would be lost, and standard deviations could be off by more than 1 %).
    """
    prior_time = problem.prior_time
    if prior_time is None or prior_time <= t:
        return problem
    where = f"the prior at {prior_time:g} s cannot be propagated back to the first measurement at {t:g} s"
    if problem.model.discrete or problem.model.memory:
        raise ValueError(
            f"{where}: the model is a step or has memories, so it cannot run backwards; give an earlier prior time"
        )
    check_after(problem.manoeuvres, prior_time)
    x, step = _start(problem, float(t), float(prior_time - t), where)
    P = _moved_covariance(problem, step, where)
    _check_parameters(problem, x, P, float(t), float(prior_time - t), where)
    states = len(problem.model.states)
    own = {name: Gaussian([x[i]], [[P[i, i]]]) for i, name in enumerate(problem.model.constants, start=states)}
    prior = Gaussian(x[:states], P[:states, :states])
    return replace(problem, prior=prior, prior_time=float(t), parameters={**problem.parameters, **own})


def _start(problem: Problem, t: float, gap: float, where: str) -> tuple[Array, Prediction]:
    """The state at `t` that moves to the prior mean, by Newton's method from where integration backwards ends; and its step."""
    m, sigma = problem.mean, np.sqrt(np.diag(problem.covariance))
    near = SAME * np.where(sigma > 0, sigma, 1e-3 * np.abs(m).max() + 1e-300)
    with np.errstate(all="ignore"):
        x = problem.step(m, -gap, t + gap)[0]
    found: tuple[Array, Prediction] | None = None
    smallest = np.inf
    for _ in range(NEWTON):
        if not np.isfinite(x).all():
            break
        step = predict(problem, Gaussian(x, np.zeros_like(problem.covariance)), t, gap)
        miss = float(np.max(np.abs(m - step.mean) / near))
        if not (miss < smallest and np.isfinite(step.Phi).all()):
            break
        smallest, found = miss, (x, step)
        try:
            x = x + np.linalg.solve(step.Phi, m - step.mean)
        except np.linalg.LinAlgError:
            break
    if found is None or smallest > 1:
        raise ValueError(f"{where}: {_NOT_FOUND}")
    return found


def _moved_covariance(problem: Problem, step: Prediction, where: str) -> Array:
    """Phi^-1 (P + Q) Phi^-T; ValueError where Q is not small beside P.

    Estimators take the noise of the gap as independent of the prior's error, which it is not of a prior that was moved back:
    with both whitened, their correlation is the largest singular value of (P + Q)^-1/2 Q^1/2, r say, and the variance of any
    linear estimate is claimed within a factor of 1 -+ r.
    """
    total = problem.covariance + step.Q
    scale = np.sqrt(np.diag(total))
    unit = np.outer(*2 * [np.where(scale > 0, scale, 1.0)])
    values, vectors = np.linalg.eigh(total / unit)
    kept = values > 1e-14 * values[-1]
    V = vectors[:, kept] / np.sqrt(values[kept])
    r = float(np.sqrt(max(np.linalg.eigvalsh(V.T @ (step.Q / unit) @ V)[-1], 0.0))) if kept.any() else 0.0
    if not r <= MOST_CORRELATION:
        raise ValueError(
            f"{where}: the process noise in between is {100 * r * r / max(1 - r * r, 1e-300):.2g} % of the prior's variance "
            "and would be counted twice; give an earlier prior time"
        )
    half = np.linalg.solve(step.Phi, total)
    out = np.linalg.solve(step.Phi, half.T)
    if not np.isfinite(out).all():
        raise ValueError(f"{where}: {_NOT_FOUND}")
    return np.asarray(0.5 * (out + out.T))


def _check_parameters(problem: Problem, x: Array, P: Array, t: float, gap: float, where: str) -> None:
    """Raise ValueError for an uncertain parameter that drives the motion over the gap."""
    sigma = np.sqrt(np.diag(P))
    for i, name in enumerate(problem.model.constants, start=len(problem.model.states)):
        others = np.delete(np.abs(P[i]) > _ROUNDING * sigma[i] * sigma, i)
        if others.any():
            raise ValueError(_driven(name, where))
    nominal = problem.step(x, gap, t)[0]
    for name in problem.considered:
        shift = np.abs(moved(problem, name, 1.0).step(x, gap, t)[0] - nominal)
        if (shift > _ROUNDING * np.abs(nominal)).any():
            raise ValueError(_driven(name, where))


def _driven(name: str, where: str) -> str:
    return f"{where}: parameter {name!r} is uncertain and drives the motion in between; give an earlier prior time"
