"""What a finished study says: who diverges how often, how far off they are, whether they know, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np

from piazzi.evaluate.consistency import epoch_bounds
from piazzi.problem.checks import Array

QUANTILES = (0.05, 0.5, 0.95)
CONFIDENCE = 0.95  # of the interval about a rate
NEES_CONFIDENCE = 0.99  # of the bounds about a mean over runs
_Z = 1.959963984540054  # half a normal's width that holds 95 %


@dataclass(frozen=True, eq=False)
class Row:
    """What is stored of one estimator in one view at one point: arrays over runs, see `score.Scored`."""

    numbers: Mapping[str, Array]
    success: Array
    diverged: Array
    error: Array
    nees: Array
    rank: Array


@dataclass(frozen=True, eq=False)
class History:
    """One row of a study over time, at the T epochs that are kept.

    Attributes
    ----------
    quantiles : (3, T, G), length of the error over runs at `QUANTILES`
    rms : (T, G), root mean square over runs
    bound : (T, G), Cramer-Rao bound, NaN where unknown
    nees : (T,), mean over runs, NaN where none has one
    rank : (T,), mean number of directions that the NEES of a run sums over: the mean NEES of errors that are as they should
    nees_bounds : (2, T), where the mean NEES lies at one epoch with a probability of `NEES_CONFIDENCE` if errors are Gaussian
        with the covariance that the estimator gives, be it singular
    """

    quantiles: Array
    rms: Array
    bound: Array
    nees: Array
    rank: Array
    nees_bounds: Array

    @property
    def inside(self) -> float | None:
        """Share of the epochs at which the mean NEES is within its bounds."""
        known = np.isfinite(self.nees)
        if not known.any():
            return None
        low, high = self.nees_bounds
        return float(((self.nees >= low) & (self.nees <= high))[known].mean())

    @property
    def ideal(self) -> float | None:
        """Mean over the epochs of what the mean NEES should be."""
        return _mean(self.rank[self.rank > 0])

    @property
    def band(self) -> tuple[float, float] | None:
        """The bounds where they are the same at every epoch that has some."""
        known = self.nees_bounds[:, np.isfinite(self.nees_bounds).all(axis=0)]
        if not known.size or (known != known[:, :1]).any():
            return None
        return float(known[0, 0]), float(known[1, 0])


@dataclass(frozen=True, eq=False)
class Line:
    """One estimator in one view at one point, over its runs; None where there is nothing to tell.

    Attributes
    ----------
    point : value of every axis
    runs, failed, diverged : how many
    diverged_interval : Wilson's 95 % interval for the rate of divergence among the runs that did not fail
    rmse, rmse_last_half : by group, root mean square over runs
    rmse_last_half_quantiles : by group, of single runs at `QUANTILES`
    over_bound : by group, rmse_last_half over the Cramer-Rao bound, both of the runs that the bound is of
    mean_nees_last_half_quantiles : of single runs at `QUANTILES`
    mean_nees, mean_nees_last_half, median_nees_last_half, mean_nis, seconds, iterations : over runs
    """

    point: Mapping[str, Any]
    estimator: str
    view: str
    runs: int
    failed: int
    diverged: int
    diverged_interval: tuple[float, float] | None
    rmse: Mapping[str, float | None]
    rmse_last_half: Mapping[str, float | None]
    rmse_last_half_quantiles: Mapping[str, tuple[float, ...] | None]
    over_bound: Mapping[str, float | None]
    mean_nees: float | None
    mean_nees_last_half: float | None
    median_nees_last_half: float | None
    mean_nees_last_half_quantiles: tuple[float, ...] | None
    mean_nis: float | None
    seconds: float | None
    iterations: float | None
    history: History

    def to_dict(self) -> dict[str, Any]:
        """The line in plain values."""
        numbers = ("mean_nees", "mean_nees_last_half", "median_nees_last_half", "mean_nis", "seconds", "iterations")
        groups = ("rmse", "rmse_last_half", "rmse_last_half_quantiles", "over_bound")
        c = self.history
        return {
            "point": dict(self.point),
            **{k: getattr(self, k) for k in ("estimator", "view", "runs", "failed", "diverged")},
            "diverged_interval": _listed(self.diverged_interval),
            **{k: {g: list(v) if isinstance(v, tuple) else v for g, v in getattr(self, k).items()} for k in groups},
            **{k: getattr(self, k) for k in numbers},
            "mean_nees_last_half_quantiles": _listed(self.mean_nees_last_half_quantiles),
            "nees_bounds": _listed(c.band),
            "nees_inside": c.inside,
            "nees_ideal": c.ideal,
            "over_time": {
                "nees": json_values(c.nees),
                "nees_bounds": json_values(c.nees_bounds),
                **{
                    g: {
                        "quantiles": json_values(c.quantiles[:, :, i]),
                        "rms": json_values(c.rms[:, i]),
                        "bound": json_values(c.bound[:, i]),
                    }
                    for i, g in enumerate(self.rmse)
                },
            },
        }


def line_of(
    point: Mapping[str, Any], label: str, view: str, groups: list[str], found: Row, bounds: tuple[Array, Array, int]
) -> Line:
    """The line of one row; `bounds` over time, over the last half, and of how many of the first runs."""
    good, (bound, bound_last_half, same) = found.success, bounds
    done = int(good.sum())
    lost = int((found.diverged & good).sum())
    whole, half = (_rms(groups, found.numbers[k][good]) for k in ("rmse", "rmse_last_half"))
    comparable = _rms(groups, found.numbers["rmse_last_half"][:same][good[:same]])
    return Line(
        point,
        label,
        view,
        len(good),
        len(good) - done,
        lost,
        wilson(lost, done),
        whole,
        half,
        {g: _quantiles(found.numbers["rmse_last_half"][good, i]) for i, g in enumerate(groups)},
        {g: _ratio(comparable[g], float(bound_last_half[i])) for i, g in enumerate(groups)},
        _mean(found.numbers["mean_nees"][good]),
        _mean(found.numbers["mean_nees_last_half"][good]),
        _median(found.numbers["mean_nees_last_half"][good]),
        _quantiles(found.numbers["mean_nees_last_half"][good]),
        _mean(found.numbers["mean_nis"][good]),
        _mean(found.numbers["seconds"][good]),
        _mean(found.numbers["iterations"][good]),
        _history(found, bound),
    )


def _history(row: Row, bound: Array) -> History:
    error, nees, rank = (a[row.success].astype(float) for a in (row.error, row.nees, row.rank))
    M, (T, G) = len(error), row.error.shape[1:]
    if not M:
        nothing, none = np.full((T, G), np.nan), np.full(T, np.nan)
        return History(np.full((len(QUANTILES), T, G), np.nan), nothing, bound, none, np.zeros(T), np.full((2, T), np.nan))
    quantiles, rms = np.quantile(error, QUANTILES, axis=0), np.sqrt((error**2).mean(axis=0))
    return History(quantiles, rms, bound, *_nees(nees, rank))


def _nees(nees: Array, rank: Array) -> tuple[Array, Array, Array]:
    """Mean NEES over the runs (M, T) that have one, its expectation, and its bounds, (T,), (T,) and (2, T).

    A sum of independent chi-square variables is one, of as many degrees of freedom as they have together.
    """
    known = rank > 0
    count, total = known.sum(axis=0), rank.sum(axis=0)
    with np.errstate(invalid="ignore"):
        mean = np.where(known, nees, 0.0).sum(axis=0) / count
    bounds, expected = np.full((2, len(count)), np.nan), np.zeros(len(count))
    for runs in np.unique(count[count > 0]).tolist():
        there = count == runs
        expected[there] = total[there] / runs
        bounds[:, there] = epoch_bounds(expected[there], runs, NEES_CONFIDENCE)
    return mean, expected, bounds


def wilson(count: int, of: int) -> tuple[float, float] | None:
    """Interval of `CONFIDENCE` for a rate seen `count` times `of` times (Wilson, J. American Statistical Assoc. 22, 1927)."""
    if not of:
        return None
    rate, spread = count / of, _Z**2 / of
    middle = (rate + spread / 2) / (1 + spread)
    half = _Z * sqrt(rate * (1 - rate) / of + spread / (4 * of)) / (1 + spread)
    return (max(0.0, middle - half) if count else 0.0, min(1.0, middle + half) if count < of else 1.0)


def _rms(groups: list[str], values: Array) -> dict[str, float | None]:
    return {g: _finite(sqrt(float((values[:, i] ** 2).mean()))) if len(values) else None for i, g in enumerate(groups)}


def _quantiles(values: Array) -> tuple[float, ...] | None:
    known = values[np.isfinite(values)]
    return tuple(np.quantile(known, QUANTILES).tolist()) if known.size else None


def _listed(values: tuple[float, ...] | None) -> list[float] | None:
    return None if values is None else list(values)


def _mean(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else None


def _median(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None


def _ratio(value: float | None, bound: float) -> float | None:
    return value / bound if value is not None and isfinite(bound) and bound > 0 else None


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def json_values(values: Array) -> Any:
    """Nested lists for JSON, None where a number is not finite."""
    if values.ndim > 1:
        return [json_values(part) for part in values]
    return [float(f"{v:.7g}") if isfinite(v) else None for v in values.tolist()]
