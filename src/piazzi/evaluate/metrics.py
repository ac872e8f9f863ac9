"""Errors of an estimate, and whether its covariance admits them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.estimate.chi_square import quantile
from piazzi.estimate.estimator import Estimate
from piazzi.model import Sensor
from piazzi.problem.checks import Array

_CHUNK = 1 << 14  # epochs at a time: the work space stays in the processor's cache
_DOUBTFUL = 1e-9  # pivots of correlations from here down may be rounding errors: eigenvalues decide
_OUTLIER = 0.1  # weight below which a row is taken for an outlier
FAR = 10.0  # times the 99.9 % quantile of chi-square: no matched run comes near, however correlated in time


@dataclass(frozen=True, eq=False)
class Consistency:
    """Squared errors in units of their covariance, and the number of directions that each was summed over.

    `rank` is zero where there is nothing to compare, below the number of components where some are missing, and smaller still
    where the covariance is singular: `value` is then taken with the pseudo-inverse.  `value` is NaN where the estimate is.
    """

    value: Array
    rank: Array

    def mean(self, rows: slice = slice(None)) -> float | None:
        """Mean over the rows that can be compared, None where there are none."""
        known = self.value[rows][self.rank[rows] > 0]
        return float(known.mean()) if known.size else None

    def ideal(self, rows: slice = slice(None)) -> float | None:
        """What that mean should be: the mean number of directions, None where there are none."""
        known = self.rank[rows][self.rank[rows] > 0]
        return float(known.mean()) if known.size else None


def errors(estimate: Estimate) -> Array | None:
    """Estimate minus truth, (K, n), NaN where either is; None where nothing of the truth is known.

    A truth without columns for the estimated constants leaves their errors unknown.

    Raises
    ------
    ValueError
        For a truth of another width.
    """
    truth = known_truth(estimate)
    return None if truth is None else estimate.mean - truth


def known_truth(estimate: Estimate) -> Array | None:
    """Truth with a column for everything estimated, (K, n), NaN where unknown; None where nothing is known."""
    truth, model = estimate.tracking.truth, estimate.problem.model
    if truth is None or np.isnan(truth).all():
        return None
    columns = truth.shape[1]
    if columns not in (len(model.states), model.n):
        raise ValueError(f"truth has {columns} columns; the model has {len(model.states)} states ({', '.join(model.states)})")
    out = np.full_like(estimate.mean, np.nan)
    out[:, :columns] = truth
    return out


def rmse(error: Array | None, columns: Sequence[int], rows: slice = slice(None), known: Array | None = None) -> float | None:
    """Square root of the mean over epochs of the squared length of the error (K, n) in these columns, None without truth.

    `known` (K, n) marks where the truth is known, by default everywhere; epochs where it is not are left out.  An error that
    is not finite makes the result so.
    """
    if error is None:
        return None
    part = error[rows, list(columns)]
    if known is not None and not known.all():
        part = part[known[rows, list(columns)].all(axis=1)]
    return float(np.sqrt(np.einsum("ki,ki->", part, part) / len(part))) if len(part) else None


def convergence_time(error: Array, columns: Sequence[int], times: Array) -> float | None:
    """Seconds from the first epoch until the error (K, n) in these columns has come down, None where it is never finite.

    From then on, the root of the mean square of all errors that follow is at most twice that of the last half (rows K//2
    onward).  Epochs without an error are left out.
    """
    part = error[:, list(columns)]
    squared = np.einsum("ki,ki->k", part, part)
    there = np.isfinite(squared)
    half = squared[len(squared) // 2 :][there[len(squared) // 2 :]]
    if not half.size:
        return None
    rest = np.cumsum(squared[there][::-1])[::-1] / np.arange(int(there.sum()), 0, -1)
    return float(times[there][np.argmax(rest <= 4.0 * half.mean())] - times[0])


def nees(estimate: Estimate) -> Consistency | None:
    """Normalised estimation error squared, e^T P^-1 e, of every epoch, (K,); None without truth."""
    truth = known_truth(estimate)
    return None if truth is None else squared_in_sigmas(estimate.mean - truth, estimate.covariance, ~np.isnan(truth))


def nis(estimate: Estimate) -> Consistency:
    """Normalised innovation squared, nu^T S^-1 nu, of every row of measurements, (J,), over the components that are there."""
    return squared_in_sigmas(estimate.innovations, estimate.innovation_covariances, used(estimate))


def used(estimate: Estimate) -> Array:
    """Which components of which rows are there and were used, (J, m)."""
    measured: Array = ~np.isnan(estimate.tracking.padded(estimate.innovations.shape[1]))
    if "rejected" in estimate.details:  # a gate's outliers say nothing about what the filter used
        measured &= ~np.asarray(estimate.details["rejected"], dtype=bool)[:, None]
    if "weights" in estimate.details:  # nor do those of a loss; hardly a good row gets so small a weight
        measured &= np.asarray(estimate.details["weights"])[:, None] >= _OUTLIER
    return measured


def outliers(estimate: Estimate) -> int | None:
    """How many rows a loss gave hardly any weight, None where there is no loss."""
    weights = estimate.details.get("weights")
    return None if weights is None else int((np.asarray(weights) < _OUTLIER).sum())


def squared_in_sigmas(e: Array, P: Array, present: Array) -> Consistency:
    """e^T P^-1 e for vectors (K, n) and covariances (K, n, n), over the components that are `present`, (K, n).

    Elimination on the correlations of many epochs at once, which is a Cholesky solve; where a pivot vanishes, or the matrix is
    not semidefinite, the pseudo-inverse.
    """
    value, rank = np.empty(len(e)), np.empty(len(e), dtype=np.int64)
    for start in range(0, len(e), _CHUNK):
        part = slice(start, start + _CHUNK)
        value[part], rank[part] = _squared_in_sigmas(e[part], P[part], present[part])
    return Consistency(value, rank)


def _squared_in_sigmas(e: Array, P: Array, present: Array) -> tuple[Array, Array]:
    n = e.shape[1]
    both = present[:, :, None] & present[:, None, :]
    # what is missing becomes an error of zero that is independent of the rest: it adds nothing to the sum
    P = np.where(both, P, np.eye(n))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        unit = np.where(sigma > 0, sigma, 1.0)
        y = np.where(present, e, 0.0) / unit
        C = P / (unit[:, :, None] * unit[:, None, :])
        value, lowest = _eliminate(y, C)
    finite = np.isfinite(y).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    value[~finite] = np.nan
    rank = present.sum(axis=1)
    singular = np.flatnonzero(finite & ~(lowest > _DOUBTFUL))
    if singular.size:
        value[singular], found = _pseudo_inverse(y[singular], C[singular])
        rank[singular] += found - n
    value[rank == 0] = np.nan
    return value, rank


def _eliminate(y: Array, C: Array) -> tuple[Array, Array]:
    """y^T C^-1 y and the smallest pivot; epochs last, so that every operation runs over all of them."""
    y, C = np.array(y.T, order="C"), np.array(np.moveaxis(C, 0, -1), order="C")
    value, lowest = np.zeros(y.shape[1]), np.full(y.shape[1], np.inf)
    for j in range(len(y)):
        pivot = C[j, j]
        lowest = np.minimum(lowest, pivot)
        value += y[j] ** 2 / pivot
        factor = C[j + 1 :, j] / pivot
        y[j + 1 :] -= factor * y[j]
        C[j + 1 :, j + 1 :] -= factor[:, None] * C[j, None, j + 1 :]
    return value, lowest


def _pseudo_inverse(y: Array, C: Array) -> tuple[Array, Array]:
    """y^T C^+ y and the rank of C."""
    values, vectors = np.linalg.eigh(C)
    kept = values > 8 * C.shape[1] * np.finfo(float).eps * np.maximum(values[:, -1:], 0.0)
    projected = np.einsum("kji,kj->ki", vectors, y)
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = np.where(kept, projected**2 / np.where(kept, values, 1.0), 0.0)
    return terms.sum(axis=1), kept.sum(axis=1)


def rms_in_sigmas(error: Array, P: Array) -> float:
    """Root mean e^T P^-1 e per direction, of errors (K, n) and covariances (K, n, n); infinite where it has no value."""
    found = squared_in_sigmas(error, P, np.ones(error.shape, dtype=bool))
    with np.errstate(invalid="ignore", divide="ignore"):
        size = float(np.sqrt(found.value.sum() / found.rank.sum()))
    return size if np.isfinite(size) else np.inf


def has_diverged(estimate: Estimate) -> bool:
    """Whether the estimate has left the truth and does not know it.

    True where a mean is not finite.  Else only where, in the last half of the run (rows K//2 onward), both hold:

    * its own covariance denies the error: the median NEES is beyond ten times the 99.9 % quantile of chi-square, far outside
      what correlation in time or a mild nonlinearity explains;
    * the error is not coming down: in no group of states is the RMS error of the last quarter less than half of that of the
      quarter before, and less than the error at the first epoch.

    Without truth, NIS and the innovations take the place of NEES and the errors, the first epoch aside: one innovation is
    mostly noise.  Both kinds of divergence in Fitzgerald, IEEE
    Trans. Automatic Control 16(6), 1971, are meant: errors that grow, and errors that stay far beyond their covariance.
    """
    return diverged(estimate, errors(estimate), nees(estimate))


def diverged(estimate: Estimate, error: Array | None, consistency: Consistency | None) -> bool:
    """The same from the errors and the NEES of the estimate."""
    if not np.isfinite(estimate.mean).all():
        return True
    if error is not None and consistency is not None:
        return _inconsistent(consistency) and _not_decreasing(error, list(groups(estimate).values()), from_first=True)
    columns = [(i,) for i in range(estimate.innovations.shape[1])]
    return _inconsistent(nis(estimate)) and _not_decreasing(estimate.innovations, columns, from_first=False)


def groups(estimate: Estimate) -> dict[str, tuple[int, ...]]:
    """Columns of every group of states that the model names, or of every state where it names none."""
    model = estimate.problem.model
    return model.group_indices or {name: (i,) for i, name in enumerate(model.names)}


def _inconsistent(consistency: Consistency) -> bool:
    half = slice(len(consistency.value) // 2, None)
    known = consistency.rank[half] > 0
    if not known.any():
        return False
    typical = np.median(consistency.rank[half][known])
    return bool(np.median(consistency.value[half][known]) > FAR * quantile(0.999, float(typical)))


def not_decreasing(first: Any, earlier: Any, later: Any) -> Any:
    """Whether an error does not come down, by its sizes at the first epoch and in the last two quarters: numbers or arrays."""
    return (later >= 0.5 * earlier) | (later > first)


def _not_decreasing(error: Array, columns: Sequence[Sequence[int]], from_first: bool) -> bool:
    """Whether the error of every group of columns stays; False for a run too short."""
    K = len(error)
    found, known = [], ~np.isnan(error)
    quarters = slice(0, 1), slice(K // 2, 3 * K // 4), slice(3 * K // 4, None)
    for group in columns:
        first, earlier, later = (rmse(error, group, rows, known) for rows in quarters)
        if earlier is not None and later is not None:
            found.append(not_decreasing(first if from_first and first is not None else np.inf, earlier, later))
    return bool(found) and all(found)


def apart(answer: Estimate, other: Estimate, k: int = -1, states: int | None = None) -> float:
    """The largest difference of the first so many states at an epoch, in sigma of the answer.

    What an estimator in real time says before the end is made of other measurements: it is compared there, in its own sigma.
    """
    k, sure = (k, answer) if other.view == "delayed" else (-1, other)
    with np.errstate(all="ignore"):
        sigma = np.sqrt(np.maximum(np.diag(sure.covariance[k])[:states], 0.0))
        off = np.abs(other.mean[k, :states] - answer.mean[k, :states])
        return float(np.max(np.where(off == 0.0, 0.0, off / sigma)))


def residual_rms(estimate: Estimate) -> dict[str, float]:
    """Root mean square of measurement minus estimate of every component, by name; empty where the estimator kept none.

    Components of the same name, at several stations, are taken together.
    """
    residuals = estimate.details.get("residuals")
    return {} if residuals is None else _rms_by(estimate, residuals, lambda sensor, component: component)


def residual_rms_by_unit(estimate: Estimate, residuals: Array) -> dict[str, float]:
    """Root mean square of residuals (J, m) over all components of a unit, such as "m" and "rad": of the rows that were used."""
    used_only = np.where(used(estimate), residuals, np.nan)
    return _rms_by(estimate, used_only, lambda sensor, component: dict(sensor.units)[component])


def _rms_by(estimate: Estimate, residuals: Array, key: Callable[[Sensor, str], str]) -> dict[str, float]:
    problem = estimate.problem
    station = estimate.tracking.stations_of(problem)
    found: dict[str, list[Array]] = {}
    for s, place in enumerate(problem.stations):
        rows, sensor = residuals[station == s], problem.model.sensor(place.sensor)
        for i, component in enumerate(sensor.components):
            found.setdefault(key(sensor, component), []).append(rows[:, i][~np.isnan(rows[:, i])])
    together = {name: np.concatenate(values) for name, values in found.items()}
    return {name: float(np.sqrt((v**2).mean())) for name, v in together.items() if v.size}
