"""Whether beliefs can be used: finite, and with covariances that are positive semidefinite."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np

from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

INDEFINITE = 1e-9  # times n: an eigenvalue of correlations further below zero is none of rounding
NOTHING = 5e-324  # the least number, for a variance of zero, so that a covariance beside it shows
FULL = 1e-290  # variances below may have lost digits, as numbers near the smallest do


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
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            return False
        return np.linalg.cholesky(covariance).size > 0 and bool(np.diagonal(covariance, axis1=1, axis2=2).min() > FULL)
    except np.linalg.LinAlgError:
        return False


def semidefinite(P: Array) -> Array:
    """For each of the covariances (K, n, n), whether it is positive semidefinite up to rounding, (K,)."""
    sound = (np.diagonal(P, axis1=1, axis2=2) >= 0).all(axis=1) & (lowest_eigenvalues(P) >= -INDEFINITE * P.shape[1])
    return np.asarray(sound)


def lowest_eigenvalues(P: Array) -> Array:
    """The smallest eigenvalue of the correlations of each covariance (K, n, n), minus infinity where it has none, (K,)."""
    with np.errstate(all="ignore"):
        variance = np.diagonal(P, axis1=1, axis2=2)
        sigma = np.sqrt(np.where(variance > 0.0, variance, NOTHING))
        correlations = P / sigma[:, :, None] / sigma[:, None, :]
    there = np.isfinite(correlations).all(axis=(1, 2))
    lowest = np.full(len(P), -np.inf)
    lowest[there] = np.linalg.eigvalsh(correlations[there])[:, 0]
    return lowest


def check_start(problem: Problem, inputs: Inputs, first: Array) -> None:
    """Raise ValueError where the very first update failed, so that `first` is not finite: the prior itself is."""
    if all(map(isfinite, first.tolist())) or inputs.t_prior != inputs.t[0]:
        return
    names = sorted({problem.stations[s].name for s in inputs.station[: inputs.first_row[1]]})
    at = ", ".join(f"{name} = {value:g}" for name, value in zip(problem.model.names, problem.mean, strict=True))
    raise ValueError(f"station {', '.join(map(repr, names))} has no derivative at the prior mean ({at})")
