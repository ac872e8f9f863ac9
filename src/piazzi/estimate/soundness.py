"""Whether beliefs can be used: finite, and with covariances that are positive semidefinite."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from piazzi.problem.checks import Array


def defect(
    mean: Array, covariance: Array, names: Sequence[str], where: Callable[[int], str], what: str = "the estimate"
) -> str:
    """What is wrong with the first of the beliefs (K, n), (K, n, n) that cannot be used, "" where all can.

    Parameters
    ----------
    mean, covariance : (K, n), (K, n, n)
    names : of the n values
    where : words for the place of belief k
    what : words for the beliefs
    """
    if _is_definite(mean, covariance):
        return ""
    finite = np.isfinite(mean).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    if not finite.all():
        k = int(np.argmin(finite))
        bad = [name for name, value in zip(names, mean[k].tolist(), strict=True) if not np.isfinite(value)]
        return f"{what} is not finite {where(k)}" + (f" ({', '.join(bad)})" if bad else "")
    sound = semidefinite(covariance)
    return "" if sound.all() else f"the covariance is not semidefinite {where(int(np.argmin(sound)))}"


def _is_definite(mean: Array, covariance: Array) -> bool:
    """Whether all is finite and every covariance has a Cholesky factor: what nearly all have, and quickly told."""
    try:
        return bool(np.isfinite(mean).all() and np.isfinite(covariance).all() and np.linalg.cholesky(covariance).size)
    except np.linalg.LinAlgError:
        return False


def semidefinite(P: Array, tolerance: float = 1e-8) -> Array:
    """For each of the covariances (K, n, n), whether it is positive semidefinite up to rounding, (K,).

    Elimination without pivoting on the correlation matrices, all epochs at once.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    unit = np.where(sigma > 0, sigma, 1.0)
    C = P / (unit[:, :, None] * unit[:, None, :])
    good = (np.diagonal(P, axis1=1, axis2=2) >= 0).all(axis=1)
    for j in range(P.shape[1]):
        pivot = C[:, j, j]
        column = C[:, j + 1 :, j]
        firm = pivot > tolerance
        good &= (pivot >= -tolerance) & (firm | (np.abs(column) <= 10 * np.sqrt(tolerance)).all(axis=1))
        step = np.where(firm, 1.0 / np.where(firm, pivot, 1.0), 0.0)
        C[:, j + 1 :, j + 1 :] -= column[:, :, None] * column[:, None, :] * step[:, None, None]
    return np.asarray(good)
