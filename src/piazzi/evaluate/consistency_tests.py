"""Whether the covariance of one run is consistent with its errors: the tests of `consistency`, made for an estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.bounds import Linearized, linearized, linearized_rows, update_covariances
from piazzi.evaluate.consistency import Check, bias_check, nees_check, nis_check, whiteness_check
from piazzi.evaluate.metrics import Consistency, used
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

LONGEST = 300_000  # epochs from which NEES is not tested: it would take more memory than the estimators do


@dataclass(frozen=True)
class ConsistencyTests:
    """What one run says about an estimator's consistency; None where there is nothing to test.

    A matched run passes each test with probability 0.95: exactly so for linear problems, else as nearly as the problem is
    linear over its own errors.

    Attributes
    ----------
    nees, nees_last_half : mean NEES over the whole run and over rows K//2 onward
        The bounds allow for the correlation in time that the model implies: `effective` is the number of independent epochs.
    nis : mean NIS per row of measurements
    whiteness : Ljung-Box statistic of the standardised innovations, summed over stations and components
    bias : squared mean of the standardised innovations in units of its variance, summed likewise
    """

    nees: Check | None = None
    nees_last_half: Check | None = None
    nis: Check | None = None
    whiteness: Check | None = None
    bias: Check | None = None


def check_consistency(estimate: Estimate, consistency: Consistency | None) -> ConsistencyTests:
    """The tests of an estimate, whose NEES (K,) come in `consistency`; None without truth."""
    long, one_row = len(estimate.mean) > LONGEST, int(np.diff(estimate.tracking.first_row).max()) == 1
    if not estimate.success or (long and not one_row):
        return ConsistencyTests()
    with np.errstate(all="ignore"):
        found = None if long else linearized(estimate.problem, estimate.tracking, estimate.mean)
        R = None if consistency is None or found is None else error_correlation(estimate, found)
        w = own_innovations(estimate, found)
    series, rows = _series(estimate, w), int((~np.isnan(w)).any(axis=1).sum())
    whole, half = _nees(consistency, R, 0), _nees(consistency, R, len(estimate.mean) // 2)
    if not np.isfinite(w[~np.isnan(w)]).all():
        return ConsistencyTests(whole, half)
    return ConsistencyTests(whole, half, nis_check(w, rows), whiteness_check(series), bias_check(series))


def _nees(consistency: Consistency | None, R: Array | None, first: int) -> Check | None:
    if consistency is None or R is None:
        return None
    value, rank = consistency.value[first:], consistency.rank[first:]
    known = rank > 0
    if not known.any() or not np.isfinite(value[known]).all():
        return None
    return nees_check(value, rank, R[first:])


def error_correlation(estimate: Estimate, found: Linearized) -> Array | None:
    """Correlation (K - 1, n, n) of each epoch's whitened error with the next, where the model holds; None where it has none.

    Whatever the view, Cov(e[k], e[k+1]) = G[k] P[k+1] with the smoother's gain G: what an estimate of state k changes when
    measurement k + 1 becomes known is independent of the error that remains.
    """
    P = estimate.covariance
    L = _factors(P)
    if estimate.view == "realtime":
        ahead = found.Phi @ P[:-1] @ np.swapaxes(found.Phi, 1, 2) + found.noise
        R = np.swapaxes(found.Phi @ L[:-1], 1, 2) @ _solved(ahead, L[1:])
    else:
        R = _solved_by_factor(L[:-1], P[:-1], found.cross @ _solved(found.smoothed[1:], L[1:]))
    return _at_most_one(R) if np.isfinite(R).all() else None


def _factors(P: Array) -> Array:
    """L (K, n, n) with L L^T = P: by Cholesky, where a matrix is singular by its eigenvectors."""
    try:
        return np.asarray(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(np.nan_to_num(P))
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :])


def _solved(P: Array, B: Array) -> Array:
    """P^-1 B, of singular P with the pseudo-inverse; scaled to correlations first."""
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    unit = np.where(sigma > 0, sigma, 1.0)
    C, B = P / (unit[:, :, None] * unit[:, None, :]), B / unit[:, :, None]
    try:
        X = np.linalg.solve(C, B)
    except np.linalg.LinAlgError:
        X = np.linalg.pinv(np.nan_to_num(C), hermitian=True) @ B
    return np.asarray(X / unit[:, :, None])


def _solved_by_factor(L: Array, P: Array, B: Array) -> Array:
    """L^-1 B for L L^T = P, or L^T P^+ B where P is singular."""
    try:
        return np.asarray(np.linalg.solve(L, B))
    except np.linalg.LinAlgError:
        return np.asarray(np.swapaxes(L, 1, 2) @ _solved(P, B))


def _at_most_one(R: Array) -> Array:
    """The same with singular values of at most 1, which correlations have but for rounding and mismatch."""
    largest = np.sqrt(np.maximum(np.linalg.eigvalsh(R @ np.swapaxes(R, 1, 2))[:, -1], 1.0))
    return np.asarray(R / largest[:, None, None])


def own_innovations(estimate: Estimate, found: Linearized | None) -> Array:
    """Standardised innovations (J, m) of an estimate, NaN where missing or rejected: white, of unit variance, and independent.

    Rows of one epoch were predicted from the same state, so they are whitened against each other; where there are any, `found`
    is needed.
    """
    inputs = prepare(estimate.problem, estimate.tracking)
    nu = np.where(used(estimate), estimate.innovations, np.nan)
    if found is None or inputs.most_rows == 1:
        return standardized(nu, estimate.innovation_covariances)
    if estimate.view == "delayed":
        return np.where(np.isnan(nu), np.nan, found.whitened)
    P = np.swapaxes(found.Phi, 1, 2)
    ahead = np.concatenate([found.predicted[:1], found.Phi @ estimate.covariance[:-1] @ P + found.noise])
    rows = linearized_rows(estimate.problem, estimate.tracking, np.vstack([found.first, found.ahead]))
    white = update_covariances(ahead, np.zeros_like(estimate.mean), *rows, inputs.first_row)[0]
    return np.where(np.isnan(nu), np.nan, white)


def standardized(nu: Array, S: Array) -> Array:
    """L^-1 nu for each row, with L L^T = S over the components that are there: vectors (J, m) and covariances (J, m, m)."""
    out, there = np.full_like(nu, np.nan), ~np.isnan(nu)
    y = np.where(there, nu, 0.0)
    C = np.where(there[:, :, None] & there[:, None, :], S, np.eye(nu.shape[1]))
    for i in range(nu.shape[1]):
        pivot = C[:, i, i]
        out[:, i] = y[:, i] / np.sqrt(pivot)
        factor = C[:, i + 1 :, i] / pivot[:, None]
        y[:, i + 1 :] -= factor * y[:, i, None]
        C[:, i + 1 :, i + 1 :] -= factor[:, :, None] * C[:, i, None, i + 1 :]
    return np.where(there, out, np.nan)


def _series(estimate: Estimate, w: Array) -> list[Array]:
    """One series in time for each component of each station that has any value."""
    station = estimate.tracking.stations_of(estimate.problem)
    found = [w[station == s, i] for s in np.unique(station) for i in range(w.shape[1])]
    return [series for series in found if not np.isnan(series).all()]
