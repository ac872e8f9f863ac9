"""Gauss-Newton with step control over a chain of states: the decisions between linear solves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np

from piazzi.estimate.chain import DEFECT, GRADIENT, ROUNDING, STEP, STEP_SMOOTHED, Chain, Solver
from piazzi.estimate.extrapolation import NEAR, Extrapolation
from piazzi.estimate.width import TOO_WIDE
from piazzi.problem.checks import Array

FIRST_DAMPING, LARGEST_DAMPING = 1e-4, 1e12
SMALL_STEP, ROUNDING_FACTOR = 3e-3, 10.0  # steps below so much of a sigma may be rounding, within so many times its estimate
PARTS = (0.5, 0.25, 0.125)  # of a step near a solution, where the whole goes too far
ACCEPTABLE = 1e-3  # sigma: as good as converged for any use, and worth a remark
MOST_AMPLIFIED = 1e3  # times the last bits of the states: steps beyond that are none of rounding, which is dear to estimate
SHRINKING = 0.05  # of the step before, or less: what a step near a solution is, unless it is rounding or converges slowly


@dataclass(frozen=True, eq=False)
class Outcome:
    """How an optimisation ended: covariances (K, n, n), steps taken, why it failed ("" if it did not), and figures."""

    covariance: Array
    iterations: int
    failure: str
    details: dict[str, Any]


def optimize(
    chain: Chain, solver: Solver, start: Array, max_iterations: int, tolerance: float, widest: float = np.inf
) -> Outcome:
    """Iterate from the states `start` until no state and no measurement moves by more than `tolerance` standard deviations.

    Measurements count too because a combination of states can be known much better than each of them; where steps shrink
    slowly, what counts is where they lead (`Extrapolation`).  Small steps that do not shrink much and are no larger than what
    rounding of the states makes of them end the iterations as well, and iterations that are spent within `ACCEPTABLE` standard
    deviations of the end are a success with a remark.
    A step that raises the merit is damped as much as it takes (Levenberg-Marquardt, scaled by the prior), except the first.
    The merit is the cost under the process noise that the step was solved with, and for directions without noise, where the
    dynamics must hold, twice the defect at the price of its multiplier (an exact penalty: Nocedal and Wright 2006, eq. 15.24).
    Ends at once, with the failure `TOO_WIDE`, where a predicted measurement has more than `widest` times the variance of its
    noise.
    """
    start = solver.begin(start)
    chain.x[:] = start
    if not np.isfinite(start).all():
        return _without_start(chain)
    cost, damping, failure, stopped = chain.linearize(), 0.0, f"not converged after {max_iterations} iterations", ""
    costs, covariance, iteration, before, past = [cost], None, 0, np.inf, Extrapolation()
    for iteration in range(1, max_iterations + 1):
        solver.solve(0.0)
        if iteration == 1 and widest < solver.widest() < np.inf:
            return Outcome(chain.P_pred, iteration, TOO_WIDE, _figures(chain, solver, costs))
        size = _size(chain)
        ahead = past.step(chain, size)
        near = _distance(chain, size, ahead) <= tolerance
        at_rounding = not near and _at_rounding(chain, solver, size, before)
        if isfinite(cost) and (at_rounding or near):
            covariance = _ended(chain, solver, ahead, SMALL_STEP if at_rounding else tolerance)
            if covariance is not None:
                failure, stopped = "", "steps are rounding" if at_rounding else f"no step above {tolerance:g} sigma"
                break
        before = size
        accepted, cost, damping = _step(chain, solver, cost, damping, ahead, size < NEAR, gated=iteration > 1)
        costs.append(cost)
        if not accepted:
            failure = "no step lowers the cost, however small"
            break
    details = {}
    if failure:
        failure += _weakest(chain)
        solver.solve(0.0)
        size = _size(chain)
        off = _distance(chain, size, past.step(chain, size))
        if off <= ACCEPTABLE and isfinite(cost):
            details, stopped, failure = {"remark": f"found to {off:.1g} sigma only: {failure}"}, failure, ""
    covariance = solver.marginals() if covariance is None else covariance
    return Outcome(covariance, iteration, failure, _figures(chain, solver, costs) | {"stopped": failure or stopped} | details)


def _ended(chain: Chain, solver: Solver, ahead: Array | None, tolerance: float) -> Array | None:
    """Covariances (K, n, n) after a last step, None where that is too large beside these, and is not taken."""
    covariance = solver.marginals()
    last = chain.dx if ahead is None else ahead
    if max(chain.report[STEP_SMOOTHED], 0.0 if ahead is None else chain.largest(ahead, covariance)) > tolerance:
        return None
    chain.x += last  # of one orbit too: so small a step is linear
    chain.d_pred -= last  # predictions are about the states as they now are
    return covariance


def _distance(chain: Chain, size: float, ahead: Array | None) -> float:
    """How far the solution may be, in the measure of `_size`."""
    return size if ahead is None else max(size, _measured(chain, ahead))


def _at_rounding(chain: Chain, solver: Solver, size: float, before: float) -> bool:
    """Whether a step of this size is nothing but rounding, and so where it seems to lead."""
    stuck = SMALL_STEP > size > SHRINKING * before and not chain.reweighted
    return (
        stuck
        and size <= MOST_AMPLIFIED * _measured(chain, _last_bits(chain))
        and size <= ROUNDING_FACTOR * _rounding(chain, solver)
    )


def _size(chain: Chain) -> float:
    """The step that was solved for, in standard deviations: the largest of any state, or of the measurements together."""
    return max(float(chain.report[STEP]), sqrt(chain.report[GRADIENT]))


def _last_bits(chain: Chain) -> Array:
    """The last bits of all states (K, n), drawn anew."""
    bits: Array = ROUNDING * np.abs(chain.x) * np.random.default_rng(0).uniform(-1.0, 1.0, chain.x.shape)
    return bits


def _measured(chain: Chain, changes: Array) -> float:
    """Changes (K, n) in the measure of `_size`."""
    return max(chain.largest(changes, chain.P_pred), chain.change(changes))


def _rounding(chain: Chain, solver: Solver) -> float:
    """How much of a step may be rounding: what changes, in the measure of `_size`, where states are rounded otherwise.

    The last bits of all states decide the last bits of what the dynamics make of them, and measurements have last bits, too.
    """
    f, nu, step = chain.f.copy(), chain.nu.copy(), chain.dx.copy()
    bits = _last_bits(chain)
    solver.disturb(bits)
    chain.nu += chain.by_measurement(bits) + chain.measured_bits * np.random.default_rng(1).uniform(-1.0, 1.0, chain.nu.shape)
    solver.solve(0.0)
    chain.f[:], chain.nu[:] = f, nu
    other = chain.dx.copy()
    solver.solve(0.0)
    return _measured(chain, other - step)


def _step(
    chain: Chain, solver: Solver, cost: float, damping: float, ahead: Array | None, near: bool, gated: bool
) -> tuple[bool, float, float]:
    """Take a step that does not raise the merit (not gated: that stays finite).

    Where the first does, one more from there may make up for it, as in a curved valley.  Returns whether there was a step, the
    cost after it, and the damping of the next.
    """
    x, price = chain.x.copy(), np.abs(chain.multiplier)
    merit = _merit(cost, price, chain.broken)
    chain.keep_noise()
    for step, used, later in _trials(chain, solver, damping, ahead, near):
        new, good = _tried(chain, solver, x, step, merit, price, gated)
        if not good and isfinite(new):
            solver.solve(used)
            new, good = _tried(chain, solver, chain.x.copy(), chain.dx, merit, price, gated)
        if good:
            return True, new, later
        chain.x[:] = x
        chain.linearize()
    return False, cost, damping


def _trials(
    chain: Chain, solver: Solver, damping: float, ahead: Array | None, near: bool
) -> Iterator[tuple[Array, float, float]]:
    """Steps to try, each from the chain as it was, their damping, and that of the next iteration: what was needed is kept."""
    if ahead is not None:
        yield ahead, 0.0, _relaxed(damping)
        solver.solve(damping)
    elif damping > 0.0:
        solver.solve(damping)
    yield chain.dx, damping, _relaxed(damping)
    for part in PARTS if near and damping == 0.0 else ():  # damping would hold back what the step is right about
        solver.solve(0.0)
        yield part * chain.dx, 0.0, 0.0
    while damping <= LARGEST_DAMPING:
        damping = max(10.0 * damping, FIRST_DAMPING)
        solver.solve(damping)
        yield chain.dx, damping, damping


def _relaxed(damping: float) -> float:
    """The damping after one that sufficed."""
    return 0.0 if damping <= FIRST_DAMPING else damping / 10.0


def _tried(chain: Chain, solver: Solver, x: Array, step: Array, merit: float, price: Array, gated: bool) -> tuple[float, bool]:
    """The cost after a step from the states `x`, and whether the merit is good; the chain is left there."""
    chain.x[:] = solver.moved(x, step)
    new = chain.linearize()
    judged, broken = chain.as_solved()
    merit_new = _merit(judged, price, broken)
    return new, isfinite(merit_new) and (not gated or _lower(chain, merit_new, merit))


def _lower(chain: Chain, merit_new: float, merit: float) -> bool:
    """Whether the merit did not rise, up to rounding."""
    allowed = merit + 1e-9 * (1.0 + abs(merit))
    return merit_new <= allowed or (merit_new <= allowed + 1e-3 * abs(merit) and merit_new <= allowed + chain.cost_rounding())


def _merit(cost: float, price: Array, broken: Array) -> float:
    """The cost, and twice the price of the defects in directions without noise."""
    if not broken.any():
        return cost
    with np.errstate(all="ignore"):  # a step that is not finite has no merit
        return cost + 2.0 * float((price * broken).sum())


def _without_start(chain: Chain) -> Outcome:
    """The outcome of a start that is not finite."""
    k, i = np.argwhere(~np.isfinite(chain.x))[0]
    chain.d_pred.fill(np.nan)
    chain.P_pred.fill(np.nan)
    where = f"{chain.problem.model.names[i]!r} is {chain.x[k, i]} from t = {chain.inputs.t[k]:g} s"
    return Outcome(chain.P_pred, 0, f"it is no start: {where}", {})


def _figures(chain: Chain, solver: Solver, costs: list[float]) -> dict[str, Any]:
    return {
        "cost": costs[-1],
        "costs": costs,
        "gradient_norm": float(np.sqrt(chain.report[GRADIENT])),
        "defect": float(chain.report[DEFECT]),
        "step": float(chain.report[STEP_SMOOTHED]),
        "solver": solver.name,
    }


def _weakest(chain: Chain) -> str:
    """Where the last step went wrong, in the problem's own words: the first value that is not finite, else the largest step."""
    names, t, variance = chain.problem.model.names, chain.inputs.t, np.diagonal(chain.P_pred, axis1=1, axis2=2)
    for what, values in (("prediction", chain.d_pred), ("variance", variance), ("step", chain.dx)):
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            return f": the {what} of {names[bad[0, 1]]!r} is not finite from t = {t[bad[0, 0]]:g} s"
    size = np.abs(chain.dx) / np.sqrt(np.maximum(variance, 1e-300))
    k, i = np.unravel_index(int(np.argmax(size)), size.shape)
    return f": {names[i]!r} at t = {t[k]:g} s still moves by {size[k, i]:.2g} sigma"
