"""The longest steps that keep an arc within a tolerance: chosen once for a problem and a span, by two resolutions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from piazzi.kernels.multistep import second_order
from piazzi.problem.arcs import FEWEST, Arc, Moving, Steps, arc
from piazzi.problem.checks import Array

COARSEST, MOST = 8, 2**17  # steps over the span
SPARE = 1.05  # of the number of steps, against what its order leaves out
STAGES = 12  # evaluations of a step of order 8
NEARBY = 1e-3  # of the state: displacements that transition matrices serve, whose own errors count for so much less
ROUNDING = 1e-6  # relative errors below this that do not fall with the step are rounding


def chosen_steps(problem: Moving, first: Array, start: float, end: float) -> Steps:
    """Steps for a span of times from the state `first` at its start: as long as the tolerance allows, or those given.

    Raises
    ------
    ValueError
        Where the tolerance cannot be reached.
    """
    integrator = problem.integrator
    assert integrator is not None
    multistep = bool(integrator.arc_scheme) and bool(second_order(problem.model))
    if not integrator.needs_times:
        one = integrator.max_step
        return Steps(one if integrator.arc_scheme else None, one if multistep else None)
    tolerance, length = getattr(integrator, "tolerance", 0.0), end - start
    if not length > 0:
        return Steps(1.0, 1.0 if multistep else None)

    def error_of(steps: Callable[[float], Steps], nodes: int) -> Callable[[int], float]:
        """Error of so many equal steps, each with so many nodes, against twice as many."""

        def error(count: int) -> float:
            at = start + np.arange(nodes * count + 1) * (length / (nodes * count))
            fine = start + np.arange(2 * count + 1) * (length / (2 * count))
            coarse_arc = arc(problem, at, first, steps(length / count), derivative=True)
            fine_arc = arc(problem, fine, first, steps(length / (2 * count)), derivative=True)
            return distance(problem, coarse_arc, _joined(fine_arc, 2 // nodes))

        return error

    one = _fewest(error_of(Steps, 1), COARSEST, tolerance)
    if not multistep:
        return Steps(length / one)
    begun = STAGES * integrator.arc_scheme[-1]  # evaluations of the first steps
    try:
        grid = _fewest(error_of(lambda h: Steps(length / one, h), 2), 2 * FEWEST, tolerance, STAGES * one - begun)
    except ValueError:
        return Steps(length / one)
    return Steps(length / one, length / grid if begun + grid < STAGES * one else None)


def _fewest(error: Callable[[int], float], count: int, tolerance: float, most: int = MOST) -> int:
    """The fewest steps whose error stays within the tolerance: by doubling, then by the order that two errors show."""
    before = np.inf
    while not (off := error(count)) <= tolerance:
        if off < ROUNDING and off > 0.5 * before:
            raise ValueError(
                f"tolerance {tolerance:g} cannot be reached: steps of any length leave {off:.1g}, which is rounding"
            )
        before, count = off, 2 * count
        if count > most:
            raise ValueError(
                f"tolerance {tolerance:g} is not reached by {count // 2} steps, which leave {off:.1g}: the motion is not "
                "smooth, or the span too long for steps of one length; use DormandPrince or give max_step"
            )
    if not np.isfinite(before) or off <= 0:
        return count
    order = np.clip(np.log2(before / off), 1.0, 16.0)
    fewer = int(np.ceil(0.5 * count * SPARE * (before / tolerance) ** (1 / order)))
    return fewer if fewer < count and error(fewer) <= tolerance else count


def _joined(fine: Arc, step: int) -> Arc:
    """Every node of an arc, or every second one."""
    return fine if step == 1 else Arc(fine.x[::2], fine.Phi[1::2] @ fine.Phi[::2])


def distance(problem: Moving, one: Arc, other: Arc) -> float:
    """How far two arcs are apart at the worst node, relative to the length of the vectors of the state.

    That of the states, or `NEARBY` times that of the transition matrices, added up, in the same units.
    """
    sizes = _sizes(problem, other.x)
    with np.errstate(all="ignore"):
        states = np.abs(one.x - other.x) / sizes
        matrices = np.abs(one.Phi - other.Phi) * sizes / sizes[:, None]
        worst = max(float(states.max()), NEARBY * float(matrices.max(axis=(1, 2)).sum()))
    return worst if np.isfinite(worst) else np.inf


def _sizes(problem: Moving, x: Array) -> Array:
    """For each value, the largest length of its vector on the way, (n,); of one that stays zero its prior sigma."""
    out = np.abs(x).max(axis=0)
    for members in sorted(problem.model.group_indices.values(), key=len, reverse=True):
        where = list(members)
        out[where] = np.linalg.norm(x[:, where], axis=1).max()
    sigma = np.sqrt(np.diag(problem.covariance))
    return np.where(out > 0, out, np.where(sigma > 0, sigma, 1.0))
