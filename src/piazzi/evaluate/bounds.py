"""The smallest covariance that any estimator can have: the posterior Cramer-Rao bound, at the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.bank import with_first
from piazzi.estimate.bordered import BorderedSolver
from piazzi.estimate.chain import Chain, CovarianceSolver, Solver
from piazzi.estimate.width import DIFFUSE
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare, with_prior_node

_BLOCK = 1 << 12  # epochs worked on at once: their matrices stay in the processor's cache


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
    inputs = prepare(problem, tracking)
    with np.errstate(all="ignore"):
        chain, solver, skip = _solved(problem, inputs, truth)
        smoothed = solver.marginals()
        P, d = chain.P_pred[skip:], chain.d_pred[skip:]
        # in place: long runs fill the memory
        _update_in_place(P, d, chain.nu, chain.H, inputs.first_row, np.empty_like(chain.nu))
    if not (np.isfinite(P).all() and np.isfinite(smoothed[skip:]).all()):
        return None
    return Bounds(P, smoothed[skip:], np.add(truth, d, out=d))


def _solved(problem: Problem, inputs: Inputs, states: Array) -> tuple[Chain, Solver, int]:
    """The chain linearised about states (K, n) and solved, and how many nodes are before its first epoch."""
    nodes = with_prior_node(inputs)
    chain = Chain(problem, nodes)
    chain.x[:] = with_first(chain, states)
    chain.linearize()
    bordered = BorderedSolver.applies(problem) and bool(problem.model.constants)
    solver: Solver = BorderedSolver(chain) if bordered else CovarianceSolver(chain)
    solver.solve(0.0)
    if not bordered and not solver.widest() <= DIFFUSE and BorderedSolver.applies(problem):
        solver = BorderedSolver(chain)
        solver.solve(0.0)
    return chain, solver, nodes.epochs - inputs.epochs


def linearized(problem: Problem, tracking: Tracking, states: Array) -> Linearized:
    """The problem linearised about these states, (K, n)."""
    inputs, M = prepare(problem, tracking), problem.model.width
    with np.errstate(all="ignore"):
        chain, solver, skip = _solved(problem, inputs, states)
        smoothed, cross = solver.marginals(), solver.cross()
        predicted, d = chain.P_pred[skip:], chain.d_pred[skip:]
        whitened, updated, deviation = update_covariances(predicted, d, chain.nu, chain.H, inputs.first_row)
    nodes = chain.inputs
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


def residuals_at(problem: Problem, tracking: Tracking, states: Array) -> Array:
    """Measurements minus what states (K, n) say they should be, (J, m), NaN where missing."""
    chain = Chain(problem, prepare(problem, tracking))
    chain.x[:] = states
    with np.errstate(all="ignore"):
        return chain.residuals()


def _scaled(problem: Problem, scale: Array) -> Array:
    return np.asarray(scale[1:, None, None] * problem.process_noise.covariance)


def update_covariances(P: Array, d: Array, nu: Array, H: Array, first_row: Array) -> tuple[Array, Array, Array]:
    """Standardised innovations (J, m); covariances (K, n, n) and deviations (K, n) after the measurements of every epoch.

    Scalars one after the other, of many epochs at once, so that rows of one epoch are whitened against each other too.

    Parameters
    ----------
    P, d : (K, n, n) and (K, n), predicted covariances and deviations
    nu, H : (J, m) and (J, m, n), innovations and Jacobians in units of the noise, NaN innovations where missing
    first_row : (K + 1,), first row of each epoch
    """
    P, d, out = P.copy(), d.copy(), np.empty_like(nu)
    _update_in_place(P, d, nu, H, first_row, out)
    return out, P, d


def _update_in_place(P: Array, d: Array, nu: Array, H: Array, first_row: Array, out: Array) -> None:
    """The same in place, block by block of epochs, so that the work space does not grow with them."""
    out.fill(np.nan)
    for start in range(0, len(P), _BLOCK):
        block = slice(start, start + _BLOCK)
        ends = first_row[start : start + _BLOCK + 1]
        part = slice(ends[0], ends[-1])
        _update_block(P[block], d[block], nu[part], H[part], ends[:-1] - ends[0], np.diff(ends), out[part])


def _update_block(P: Array, d: Array, nu: Array, H: Array, first_row: Array, rows: Array, out: Array) -> None:
    for slot in range(int(rows.max())):
        for i in range(nu.shape[1]):
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
