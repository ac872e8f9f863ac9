"""Whether an estimator's steps are too long for it: runs with finer and finer ones, until two agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.arrays import median
from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.estimate.kalman import ExtendedKalmanFilter
from piazzi.estimate.substeps import FINER, StepError
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array

SMALL = 0.1  # of a standard deviation: adds half a per cent to the mean squared error
LOOKED_AT = 20_000  # epochs: some 40 ms of a filter
FINEST = FINER**6
WORK = 20_000_000  # substeps of a run: a second or two
LOST = 25.0  # typical squared innovation or error, in variances, of a filter that has lost its track


def step_warning(problem: Problem, tracking: Tracking, limit: float = SMALL, estimator: Estimator | None = None) -> str:
    """A sentence where finer steps move an estimate by more than `limit` standard deviations, "" where they do not.

    The estimator runs again with four times as many substeps; no other kernel is needed, so a warm call costs what that run
    does.  Where the two differ by more than `limit`, it goes on with 16, 64, ... times as many until two runs in a row agree,
    and says so where none do.  An estimator that is lost, its innovations (or, where the truth is known, its errors) mostly
    beyond five of its own standard deviations, is told of too, and before steps that move it by less: its sigma says nothing.
    Of a long recording only the first
    20,000 epochs are looked at.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    limit : float
    estimator : an estimator that gives every epoch's state in real time; default the extended Kalman filter
    """
    assert problem.integrator is not None
    if problem.integrator.chooses_steps:
        return ""
    seen, runner = _beginning(tracking, LOOKED_AT), estimator or ExtendedKalmanFilter()
    work = float(problem.intervals(seen.times)[1].sum())
    coarse = before = runner.estimate(problem, seen)
    finer = FINER
    while True:
        fine = runner.estimate(_finer(problem, finer), seen)
        between = _moved(before, fine)
        if between.worst <= max(limit, _lost(fine, seen.truth)[0]) or finer >= FINEST or finer * FINER * work > WORK:
            break
        before, finer = fine, finer * FINER
    if not fine.success:
        return ""  # as the estimate says of itself
    return _sentence(coarse, fine, between, finer, limit, seen.truth)


def _sentence(coarse: Estimate, fine: Estimate, between: StepError, finer: int, limit: float, truth: Array | None) -> str:
    """What is to be said of a run, one with `finer` times as many substeps, and the distance of that to the one before it."""
    advice = "give it more substeps, or a method of higher order"
    far, lost = _lost(fine, truth)
    if finer > FINER and not between.worst <= max(limit, far):
        return (
            f"the integrator's steps are far too long: even {finer // FINER} and {finer} times as many differ by "
            f"{_at_worst(between)}; {advice}, or use DormandPrince"
        )
    if lost:
        return f"the estimate diverges with steps of any length: {lost}; its sigma is meaningless"
    if not coarse.success:
        return f"the integrator's steps are too long: the estimate is not finite, and is with {finer} times as many; {advice}"
    moved = _moved(coarse, fine)
    if not moved.worst > limit:
        return ""
    state, time = moved.where
    return (
        f"the integrator's steps are too long: {finer} times as many move {state!r} by {moved.worst:.2g} sigma at "
        f"t = {time:g} s; {advice}"
    )


def _moved(one: Estimate, other: Estimate) -> StepError:
    """How far two runs are apart, in the second one's standard deviations."""
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.diagonal(other.covariance, axis1=1, axis2=2))
        return StepError(other.times, one.mean - other.mean, sigma, other.problem.model.names)


def _at_worst(moved: StepError) -> str:
    state, time = moved.where
    return f"{moved.worst:.2g} sigma in {state!r} at t = {time:g} s"


def _lost(estimate: Estimate, truth: Array | None) -> tuple[float, str]:
    """How many sigma an estimate that has lost its track is off, and what shows it; 0 and "" where nothing does.

    Judged by the median of squares, whatever outliers do.  Where steps move it by less than that, they are not what is wrong.
    """
    S = np.diagonal(estimate.innovation_covariances, axis1=1, axis2=2)
    P = np.diagonal(estimate.covariance, axis1=1, axis2=2)
    found = {"innovations": (estimate.innovations, S)}
    if truth is not None and truth.shape == estimate.mean.shape:
        found["errors"] = (estimate.mean - truth, P)
    for what, (off, variance) in found.items():
        there = np.isfinite(off) & np.isfinite(variance) & (variance > 0)
        with np.errstate(over="ignore"):
            typical = median((off[there] / np.sqrt(variance[there])) ** 2) if there.any() else 0.0
        if typical > LOST:
            return typical**0.5, f"half of its {what} are beyond {typical**0.5:.2g} sigma"
    return 0.0, ""


def _finer(problem: Problem, factor: int) -> Problem:
    """The problem with so many times as many substeps in every interval."""
    integrator = problem.integrator
    assert integrator is not None
    if integrator.max_step is not None:
        return replace(problem, integrator=replace(integrator, max_step=integrator.max_step / factor))
    assert integrator.substeps is not None
    return replace(problem, integrator=replace(integrator, substeps=factor * integrator.substeps))


def _beginning(tracking: Tracking, epochs: int) -> Tracking:
    """The rows of the first so many epochs."""
    if len(tracking.times) <= epochs:
        return tracking
    rows = slice(int(tracking.first_row[epochs]))
    names = None if tracking.row_stations is None else tracking.row_stations[rows]
    truth = None if tracking.truth is None else tracking.truth[:epochs]
    return Tracking(tracking.row_times[rows], tracking.values[rows], names, truth, tracking.epoch)
