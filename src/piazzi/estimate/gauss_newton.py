"""Gauss-Newton with step control over a chain of states: the decisions between linear solves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.estimate.chain import DEFECT, GRADIENT, STEP, STEP_SMOOTHED, Chain, Solver
from piazzi.problem.checks import Array

TOO_WIDE = "the prior is too wide for covariances"
FIRST_DAMPING, LARGEST_DAMPING = 1e-4, 1e12


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
    """Iterate from the states `start` until no state moves by more than `tolerance` of its standard deviations.

    A step that raises the merit is damped as much as it takes (Levenberg-Marquardt, scaled by the prior), except the first.
    The merit is the cost, and for directions without noise, where the dynamics must hold, twice the defect at the price of
    its multiplier (an exact penalty: Nocedal and Wright 2006, eq. 15.24).  Ends at once, with the failure `TOO_WIDE`, where
    a predicted measurement has more than `widest` times the variance of its noise.
    """
    chain.x[:] = start
    cost, damping, failure = chain.linearize(), 0.0, f"not converged after {max_iterations} iterations"
    costs, covariance, iteration = [cost], None, 0
    for iteration in range(1, max_iterations + 1):
        solver.solve(damping)
        if iteration == 1 and widest < np.inf and not chain.widest() <= widest:
            return Outcome(chain.P_pred, iteration, TOO_WIDE, {})
        if damping == 0.0 and chain.report[STEP] <= tolerance:
            covariance = solver.marginals()
            if chain.report[STEP_SMOOTHED] <= tolerance:
                chain.x += chain.dx
                failure = ""
                break
            covariance = None
        accepted, cost, damping = _step(chain, solver, cost, damping, gated=iteration > 1)
        costs.append(cost)
        if not accepted:
            failure = "no step lowers the cost, however small"
            break
    if failure:
        failure += _largest_step(chain)
        solver.solve(0.0)
    covariance = solver.marginals() if covariance is None else covariance
    return Outcome(covariance, iteration, failure, _figures(chain, solver, costs))


def _step(chain: Chain, solver: Solver, cost: float, damping: float, gated: bool) -> tuple[bool, float, float]:
    """Take a step that does not raise the merit (not gated: that stays finite).

    Returns whether there was one, the cost after it, and the damping of the next.
    """
    x, broken = chain.x.copy(), chain.broken.copy()
    while True:
        price = np.abs(chain.multiplier)
        np.add(x, chain.dx, out=chain.x)
        new = chain.linearize()
        merit, merit_new = cost + 2.0 * float((price * broken).sum()), new + 2.0 * float((price * chain.broken).sum())
        if np.isfinite(merit_new) and (not gated or merit_new <= merit + 1e-9 * (1.0 + abs(merit))):
            return True, new, 0.0 if damping <= FIRST_DAMPING else damping / 10.0
        damping = max(10.0 * damping, FIRST_DAMPING)
        chain.x[:] = x
        chain.linearize()
        if damping > LARGEST_DAMPING:
            return False, cost, damping
        solver.solve(damping)


def _figures(chain: Chain, solver: Solver, costs: list[float]) -> dict[str, Any]:
    return {
        "cost": costs[-1],
        "costs": costs,
        "gradient_norm": float(np.sqrt(chain.report[GRADIENT])),
        "defect": float(chain.report[DEFECT]),
        "step": float(chain.report[STEP_SMOOTHED]),
        "solver": solver.name,
    }


def _largest_step(chain: Chain) -> str:
    """Where the last step was largest, in the problem's own words."""
    names, t = chain.problem.model.names, chain.inputs.t
    sigma = np.sqrt(np.maximum(np.diagonal(chain.P_pred, axis1=1, axis2=2), 1e-300))
    with np.errstate(all="ignore"):
        size = np.abs(chain.dx) / sigma
    if not np.isfinite(size).all():
        k, i = np.argwhere(~np.isfinite(size))[0]
        return f": the step of {names[i]!r} is not finite at t = {t[k]:g} s"
    k, i = np.unravel_index(int(np.argmax(size)), size.shape)
    return f": {names[i]!r} at t = {t[k]:g} s still moves by {size[k, i]:.2g} sigma"
