"""The smallest covariance that any estimator can have: the posterior Cramer-Rao bound, at the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain, CovarianceSolver, Solver
from piazzi.estimate.factor_graph import DIFFUSE, with_first
from piazzi.estimate.inputs import prepare, with_prior_node
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array


@dataclass(frozen=True, eq=False)
class Bounds:
    """Posterior Cramer-Rao bounds.

    Attributes
    ----------
    realtime, delayed : (K, n, n), given the measurements up to each epoch, and given all
    states : (K, n), what the extended Kalman filter would find if its Jacobians were taken at the truth
    """

    realtime: Array
    delayed: Array
    states: Array

    def of(self, view: str) -> Array:
        """The bound that estimates of this view obey."""
        return self.realtime if view == "realtime" else self.delayed


@dataclass(frozen=True, eq=False)
class Linearized:
    """A problem linearised about states (K, n), and what a Kalman filter and smoother make of it.

    Attributes
    ----------
    first : (n,), the prior mean at the first epoch
    ahead : (K - 1, n), where the dynamics take each state by the next epoch
    Phi : (K - 1, n, n), from each epoch to the next
    noise : (K - 1, n, n), process noise of those intervals
    predicted, updated, smoothed : (K, n, n), covariances before and after the measurements of each epoch, and given all
    cross : (K - 1, n, n), smoothed covariance of each state with the next
    states : (K, n), the filter's estimate from these linearisations
    whitened : (J, m), standardised innovations, white and of unit variance where the model holds; NaN where missing
    """

    first: Array
    ahead: Array
    Phi: Array
    noise: Array
    predicted: Array
    updated: Array
    smoothed: Array
    cross: Array
    states: Array
    whitened: Array


def full_truth(problem: Problem, tracking: Tracking) -> Array | None:
    """Truth of everything estimated, (K, n), constants at their prior mean where it lacks them; None where incomplete."""
    truth, model = tracking.truth, problem.model
    if truth is None or np.isnan(truth).any() or truth.shape[1] not in (len(model.states), model.n):
        return None
    out = np.tile(problem.mean, (len(truth), 1))
    out[:, : truth.shape[1]] = truth
    return out


def posterior_bounds(problem: Problem, tracking: Tracking) -> Bounds | None:
    """Bounds along the truth, None where it is not known at every epoch, or where they are not finite.

    Tichavsky, Muravchik and Nehorai, IEEE Trans. Signal Processing 46(5), 1998: for Gaussian noise the recursion of the
    Kalman filter's covariance, linearised at the truth.  Theirs averages over truths; this one is of the one truth there is.
    """
    truth = full_truth(problem, tracking)
    if truth is None:
        return None
    found = linearized(problem, tracking, truth)
    if not (np.isfinite(found.updated).all() and np.isfinite(found.smoothed).all()):
        return None
    return Bounds(found.updated, found.smoothed, found.states)


def linearized(problem: Problem, tracking: Tracking, states: Array) -> Linearized:
    """The problem linearised about these states, (K, n)."""
    inputs = prepare(problem, tracking)
    nodes = with_prior_node(inputs)
    skip, M = nodes.epochs - inputs.epochs, problem.model.width
    chain = Chain(problem, nodes)
    chain.x[:] = with_first(chain, states)
    with np.errstate(all="ignore"):
        chain.linearize()
        bordered = BorderedSolver.applies(problem) and bool(problem.model.constants)
        solver: Solver = BorderedSolver(chain) if bordered else CovarianceSolver(chain)
        solver.solve(0.0)
        if not bordered and not solver.widest() <= DIFFUSE and BorderedSolver.applies(problem):
            solver = BorderedSolver(chain)
            solver.solve(0.0)
        smoothed, cross = solver.marginals(), solver.cross()
        rows = np.diff(inputs.first_row)
        predicted, d = chain.P_pred[skip:], chain.d_pred[skip:]
        whitened, updated, deviation = absorb(predicted, d, chain.nu, chain.H, inputs.first_row[:-1], rows)
    last = nodes.epochs - 1
    noise = chain.Q_all[:last] if problem.noise_varies else _scaled(problem, nodes.scale)
    return Linearized(
        chain.f[0] if skip else problem.mean,
        chain.f[skip:last],
        chain.Phi[skip:last],
        noise[skip:],
        predicted,
        updated,
        smoothed[skip:],
        cross[skip:],
        states + deviation,
        whitened.reshape(-1, M),
    )


def linearized_rows(problem: Problem, tracking: Tracking, states: Array) -> tuple[Array, Array]:
    """Innovations (J, m) and Jacobians (J, m, n) at states (K, n), in units of the noise, NaN innovations where missing."""
    chain = Chain(problem, prepare(problem, tracking))
    chain.x[:] = states
    with np.errstate(all="ignore"):
        chain.linearize()
    return chain.nu, chain.H


def _scaled(problem: Problem, scale: Array) -> Array:
    return np.asarray(scale[1:, None, None] * problem.process_noise.covariance)


def absorb(P: Array, d: Array, nu: Array, H: Array, first_row: Array, rows: Array) -> tuple[Array, Array, Array]:
    """Standardised innovations (J, m); covariances (K, n, n) and deviations (K, n) after the measurements of every epoch.

    Scalars one after the other, of all epochs at once, so that rows of one epoch are whitened against each other too.

    Parameters
    ----------
    P, d : (K, n, n) and (K, n), predicted covariances and deviations
    nu, H : (J, m) and (J, m, n), innovations and Jacobians in units of the noise, NaN innovations where missing
    first_row, rows : (K,), first row of each epoch and how many it has
    """
    M = nu.shape[1]
    P, d = P.copy(), d.copy()
    out = np.full_like(nu, np.nan)
    for slot in range(int(rows.max())):
        for i in range(M):
            k = np.flatnonzero(rows > slot)
            row = first_row[k] + slot
            there = ~np.isnan(nu[row, i])
            k, row = k[there], row[there]
            h, P_k = H[row, i], P[k]
            Ph = np.einsum("kij,kj->ki", P_k, h)
            S = np.einsum("ki,ki->k", h, Ph) + 1.0
            gain = Ph / S[:, None]
            e = nu[row, i] - np.einsum("ki,ki->k", h, d[k])
            out[row, i] = e / np.sqrt(S)
            d[k] += e[:, None] * gain
            B = P_k - Ph[:, :, None] * gain[:, None, :]
            P[k] = B + gain[:, :, None] * (gain - np.einsum("ki,kij->kj", h, B))[:, None, :]
    return out, P, d
