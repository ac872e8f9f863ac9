"""How much the length of the steps matters, in units of what the filter claims to know."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.estimate.kalman import update_fragments
from piazzi.kernels.bundle import Beliefs
from piazzi.problem import Problem, ProcessNoise, Tracking, Truth
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

FINER = 4  # times as many substeps stand for the truth: even at order 1 that leaves a quarter of the error unseen
MOST = 2**20


@dataclass(frozen=True, eq=False)
class StepError:
    """Displacement of an extended Kalman filter's estimate by the error of its steps.

    Attributes
    ----------
    times : (K,)
    bias : (K, n), estimate with these steps minus estimate with exact ones, to first order
    sigma : (K, n), standard deviations that the filter claims
    names : names of the columns
    """

    times: Array
    bias: Array
    sigma: Array
    names: tuple[str, ...]

    @property
    def sigmas(self) -> Array:
        """Displacement in standard deviations, (K, n); zero where nothing is claimed to be uncertain."""
        ratio = np.abs(self.bias) / np.where(self.sigma > 0, self.sigma, np.inf)
        return np.where(np.isnan(ratio), np.inf, ratio)

    @property
    def worst(self) -> float:
        """The largest displacement of any state at any epoch, in standard deviations."""
        return float(self.sigmas.max())

    @property
    def where(self) -> tuple[str, float]:
        """State and time of the largest displacement."""
        k, i = np.unravel_index(int(np.argmax(self.sigmas)), self.sigmas.shape)
        return self.names[i], float(self.times[k])


def substep_error(problem: Problem, tracking: Any) -> StepError:
    """What the chosen integrator's steps do to the filter, along its own run or along the motion of the prior mean.

    Every step is repeated with four times as many substeps; the difference is carried along as a bias, which the transition
    matrix moves and every update reduces as it does any other error.  Methods that answer for their own error have none.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking, or times (K,) at which every station measures

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem.
    """
    assert problem.integrator is not None
    seen = tracking if isinstance(tracking, Tracking) else _undisturbed(problem, tracking)
    inputs = prepare(problem, seen)
    K, n = inputs.epochs, problem.model.n
    if problem.integrator.chooses_steps:
        return StepError(inputs.t, np.zeros((K, n)), np.ones((K, n)), problem.model.names)
    parts = ("transition", problem.noise_fragment, *update_fragments(problem, "auto"), "step_error")
    run, *rest = inputs.bundles(problem)
    beliefs = Beliefs.empty(K=K, N=n)
    kernels.load(problem.spec(*parts)).run_step_error(run, FINER * inputs.count, *rest, beliefs)
    bias, P = beliefs.members
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    return StepError(inputs.t, bias, sigma, problem.model.names)


def _undisturbed(problem: Problem, times: Any) -> Tracking:
    """Noiseless measurements of a motion that starts at the prior mean and that nothing disturbs."""
    calm = ProcessNoise(np.zeros(len(problem.model.names)), "step")
    fixed = {c: problem.parameters[c].mean[0] for c in problem.model.constants}
    exact = [replace(m, covariance=None) for m in problem.manoeuvres]
    truth = Truth(problem.mean[: len(problem.model.states)], fixed, calm, measurement_noise=False, manoeuvres=exact)
    from piazzi.simulation import simulate

    return simulate(replace(problem, truth=truth), times, np.random.default_rng(0))


def choose_substeps(problem: Problem, times: Any, tolerance: float = 0.01) -> Problem:
    """The problem with the fewest substeps that displace the filter by at most `tolerance` standard deviations.

    An integrator with `max_step` keeps that form, as do methods that answer for their own error.  A truth with an integrator of
    its own gets its own number.

    Raises
    ------
    ValueError
        For a tolerance that is not positive, or that no number of substeps reaches.
    """
    if not tolerance > 0:
        raise ValueError(f"tolerance is {tolerance}; it must be positive, in standard deviations")
    chosen = _chosen(problem, times, tolerance)
    if problem.truth is not None and problem.truth.integrator is not None:
        from piazzi.simulation import true_problem

        actual = _chosen(true_problem(problem), times, tolerance)
        chosen = replace(chosen, truth=replace(problem.truth, integrator=actual.integrator))
    return chosen


def _chosen(problem: Problem, times: Any, tolerance: float) -> Problem:
    assert problem.integrator is not None
    if problem.integrator.chooses_steps:
        return problem
    high = 1
    while not substep_error(_with_substeps(problem, times, high), times).worst <= tolerance:
        high *= 2
        if high > MOST:
            raise ValueError(
                f"no number of substeps up to {MOST} keeps the step error below {tolerance:g} sigma: use DormandPrince"
            )
    low = high // 2
    while high - low > max(1, high // 16):
        middle = (low + high) // 2
        enough = substep_error(_with_substeps(problem, times, middle), times).worst <= tolerance
        low, high = (low, middle) if enough else (middle, high)
    return _with_substeps(problem, times, high)


def _with_substeps(problem: Problem, times: Any, count: int) -> Problem:
    """So many substeps in every interval; where `max_step` is used, in the longest one."""
    assert problem.integrator is not None
    if problem.integrator.max_step is None:
        return replace(problem, integrator=replace(problem.integrator, substeps=count))
    epochs = times.times if isinstance(times, Tracking) else np.asarray(times, dtype=float)
    start = epochs[0] if problem.prior_time is None else problem.prior_time
    longest = float(np.diff(epochs, prepend=start).max()) or 1.0
    return replace(problem, integrator=replace(problem.integrator, max_step=longest / count))
