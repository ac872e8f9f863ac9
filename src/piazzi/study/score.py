"""Scores of runs: of an ensemble at once, and of one estimate, alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.chi_square import quantile
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.metrics import FAR, errors, known_truth, not_decreasing, squared_in_sigmas
from piazzi.evaluate.rows import evaluate
from piazzi.problem.checks import Array
from piazzi.study.ensemble import Scores

# name -> whether there is one number for each group of states
NUMBERS = {
    "rmse": True,
    "rmse_last_half": True,
    "mean_nees": False,
    "mean_nees_last_half": False,
    "mean_nis": False,
    "seconds": False,
    "iterations": False,
}


@dataclass(frozen=True, eq=False)
class Scored:
    """Scores of M runs of one estimator in one view.

    Attributes
    ----------
    numbers : mapping of the names in `NUMBERS` to (M,) or (M, G)
    success, diverged : (M,) bool
    error : (M, T, G), length of the error at the epochs that are kept
    nees : (M, T)
    rank : (M, T), how many directions `nees` sums over, zero where it is not known
    """

    numbers: dict[str, Array]
    success: Array
    diverged: Array
    error: Array
    nees: Array
    rank: Array


def empty_scores(runs: int, groups: int, kept: int) -> Scored:
    """Runs without results."""
    numbers = {name: np.full((runs, groups) if grouped else runs, np.nan) for name, grouped in NUMBERS.items()}
    no = np.zeros(runs, dtype=bool)
    return Scored(
        numbers, no, no.copy(), np.full((runs, kept, groups), np.nan), np.full((runs, kept), np.nan), np.zeros((runs, kept))
    )


def score_ensemble(scores: Scores, n: int, kept: Array, seconds: float) -> Scored:
    """Scores of an ensemble, all of which succeeded, with definite covariances."""
    M, K = scores.nees.shape
    half = slice(K // 2, None)
    squared = scores.squared  # sums run along memory: the same bits whatever runs beside them
    later, earlier = squared[:, :, 3 * K // 4 :], squared[:, :, K // 2 : 3 * K // 4]
    numbers = {
        "rmse": _root_mean(squared),
        "rmse_last_half": _root_mean(squared[:, :, half]),
        "mean_nees": scores.nees.mean(axis=1),
        "mean_nees_last_half": scores.nees[:, half].mean(axis=1),
        "mean_nis": scores.nis.mean(axis=1),
        "seconds": np.full(M, seconds / M),
        "iterations": np.full(M, float(K)),
    }
    diverged = np.median(scores.nees[:, half], axis=1) > FAR * quantile(0.999, float(n))
    if earlier.shape[2]:
        diverged &= not_decreasing(np.sqrt(squared[:, :, 0]), _root_mean(earlier), _root_mean(later)).all(axis=1)
    else:
        diverged[:] = False
    error = np.sqrt(squared[:, :, kept]).transpose(0, 2, 1)
    return Scored(numbers, np.ones(M, dtype=bool), diverged, error, scores.nees[:, kept], np.full((M, len(kept)), n))


def _root_mean(squared: Array) -> Array:
    return np.asarray(np.sqrt(squared.mean(axis=2)))


def score_estimate(name: str, estimate: Estimate, groups: dict[str, tuple[int, ...]], kept: Array) -> tuple[Scored, str]:
    """Scores of one run, M = 1, and why it failed, "" where it did not."""
    row = evaluate(name, estimate, thorough=False)
    out = empty_scores(1, len(groups), len(kept))
    for key, values in (("rmse", row.rmse), ("rmse_last_half", row.rmse_last_half)):
        out.numbers[key][0] = [_number(values.get(group)) for group in groups]
    for key in ("mean_nees", "mean_nees_last_half", "mean_nis", "seconds", "iterations"):
        out.numbers[key][0] = _number(getattr(row, key))
    out.success[0], out.diverged[0] = row.success, row.diverged
    error, truth = errors(estimate), known_truth(estimate)
    if error is not None and truth is not None:
        part = error[kept]
        out.error[0] = np.stack([np.sqrt((part[:, list(c)] ** 2).sum(axis=1)) for c in groups.values()], axis=1)
        found = squared_in_sigmas(part, estimate.covariance[kept], ~np.isnan(truth[kept]))
        out.nees[0], out.rank[0] = found.value, found.rank
    return out, "" if row.success else row.message


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)
