"""Estimated constants: how far the most probable path of everything together is from the most probable constants alone.

Where a constant multiplies a state that process noise moves, the path bends towards the noise of the measurements, and the more
epochs there are, the more sigmas the constants of the joint mode are off (Neyman and Scott 1948).  By Laplace's approximation
their marginal density has, beside the cost, half the log determinant of the states' information given the constants.  For
process noise of any rank that is half the sum of the logarithms of the innovations' variances.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.estimate.bank import log_determinant, root, with_prior
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain, CovarianceSolver, Solver
from piazzi.estimate.gauss_newton import Outcome
from piazzi.estimate.robust import RobustChain, chain_for, minimize, solve_at
from piazzi.problem.checks import Array

STEP = 0.1  # sigma of the constants, for differences
BIASED = 0.5  # sigma: a joint mode further off is told
SETTLED, ROUNDS = 1e-3, 10  # sigma: where the marginal mode is good enough, for an approximation


def applies(chain: Chain) -> bool:
    """Whether there are constants that stay constant, and states that process noise moves."""
    problem, constants = chain.problem, len(chain.problem.model.constants)
    unsure = constants > 0 and bool((np.diag(problem.covariance)[-constants:] > 0.0).all())
    return unsure and bool(problem.process_noise.covariance.any()) and BorderedSolver.applies(problem)


def shift(chain: Chain, solver: Solver, covariance: Array) -> Array:
    """From the joint to the marginal mode of the constants (C,), in the first order; the chain is left where it stands."""
    c = slice(len(chain.problem.model.moving), None)
    x, A = chain.x.copy(), root(covariance[-1][c, c])
    unit = np.sqrt(np.diag(covariance[-1])[c])
    follow = (covariance[:, :, c] / unit).reshape(-1, len(unit)).T
    away = np.linalg.lstsq(A / unit[:, None], follow, rcond=None)[0].reshape(len(unit), *x.shape)
    slope = np.empty(len(unit))
    for j, states in enumerate(away):  # which follow one sigma of a combination of the constants
        above, below = (_log_determinant(chain, solver, x + side * STEP * states) for side in (1.0, -1.0))
        slope[j] = (above - below) / (2 * STEP)
    solve_at(chain, solver, x)
    return np.asarray(A @ (-0.5 * slope))


def _log_determinant(chain: Chain, solver: Solver, states: Array) -> float:
    """That of the states' information over their prior's, given the constants; up to a constant."""
    solve_at(chain, solver, states)
    return log_determinant(chain) + float(np.linalg.slogdet(solver.of_constants())[1])


def bias_message(chain: Chain, solver: Solver, covariance: Array) -> str:
    """What is to be said about the constants of a joint mode, "" where they agree with the marginal ones."""
    moved, names = shift(chain, solver, covariance), chain.problem.model.constants
    sigmas = moved / np.sqrt(np.diagonal(covariance[-1])[-len(moved) :])
    worst = int(np.argmax(np.abs(sigmas)))
    if not abs(sigmas[worst]) > BIASED:
        return ""
    off = f"{names[worst]!r} is about {abs(sigmas[worst]):.1f} sigma from its marginal mode"
    why = "because it acts on states that process noise moves"
    return f"the joint mode is biased: {off}, {why}; FactorGraph(constants='marginal') or the smoother corrects for that"


def marginal(chain: Chain, solver: Solver, outcome: Outcome, max_iterations: int, tolerance: float) -> Outcome:
    """The outcome with the constants at their marginal mode, and the states at theirs for these; the chain is left there.

    The log determinant is taken as linear near the constants: a linear term of the cost is a shift of their prior's mean.
    """
    problem, c = chain.problem, slice(len(chain.problem.model.moving), None)
    loss = chain.loss if isinstance(chain, RobustChain) else None
    covariance, iterations = outcome.covariance, outcome.iterations
    for _ in range(ROUNDS):
        before, S = chain.x[-1, c].copy(), covariance[-1][c, c]
        slope = -np.linalg.solve(S, shift(chain, solver, covariance))
        mean = problem.mean - problem.covariance[:, c] @ slope
        shifted = chain_for(with_prior(problem, np.ascontiguousarray(mean), problem.covariance), chain.inputs, loss)
        found = minimize(shifted, type_of(solver)(shifted), chain.x.copy(), max_iterations, tolerance)
        iterations += found.iterations
        if found.failure:
            return replace(outcome, iterations=iterations, failure=f"for the marginal mode of the constants: {found.failure}")
        solve_at(chain, solver, shifted.x)
        covariance = solver.marginals()
        if (np.abs(chain.x[-1, c] - before) <= SETTLED * np.sqrt(np.diag(S))).all():
            return replace(outcome, covariance=covariance, iterations=iterations)
    return replace(outcome, iterations=iterations, failure="the marginal mode of the constants does not converge")


def type_of(solver: Solver) -> type[BorderedSolver] | type[CovarianceSolver]:
    """Which of the two a solver is."""
    return BorderedSolver if isinstance(solver, BorderedSolver) else CovarianceSolver
