"""One estimate's account of itself: errors beside the best possible, consistency, cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.bounds import Bounds, residuals_at
from piazzi.evaluate.consistency_tests import LONGEST, ConsistencyTests, check_consistency
from piazzi.evaluate.metrics import (
    convergence_time,
    diverged,
    groups,
    known_truth,
    nis,
    outliers,
    residual_rms_by_unit,
    rmse,
    squared_in_sigmas,
)
from piazzi.evaluate.quantities import finite, unit_of
from piazzi.model import Model
from piazzi.problem.checks import Array

_ALWAYS = ("position", "velocity")  # groups that every row has, None where the model does not name them


@dataclass(frozen=True)
class Row:
    """One estimate's account of itself, SI units; None where there is no truth to compare with, or nothing to report.

    Attributes
    ----------
    rmse, rmse_last_half : one number for each group of states; the last half is rows K//2 onward
    crlb, crlb_last_half : the posterior Cramer-Rao bound of the same, for this view and this truth: no estimator that is
        unbiased does better on average, a single run may
    mean_nees, mean_nees_last_half, mean_nis : consistency; near `nees_ideal`, `nees_ideal_last_half` and the components per row
    nees_ideal, nees_ideal_last_half : mean rank of the covariance, over the states whose truth is known; n where it is regular
    tests : ConsistencyTests, tests of that with bounds
    convergence_time : seconds until the error of the first group stays, in the RMS of all that follows, within twice its last
        half's
    diverged : see `piazzi.evaluate.has_diverged`
    rejected : rows of measurements that a gate left out; None, and no part of the dictionary, where there is no gate
    outliers : rows to which a loss gave hardly any weight; likewise
    modes : the solutions that a bank of starts found, with "probability", "cost" and first "state"; likewise
    residual_rms : what the states of the estimate leave of the measurements used, RMS by unit, such as "m" and "rad": where an
        estimate is of real time, after each measurement was taken in
    apart : largest difference of the last states from those of the comparison's first estimator, in its sigma, or in real time
        in one's own; None for that one itself
    """

    estimator: str
    view: str
    success: bool
    message: str
    iterations: int
    seconds: float | None
    rmse: Mapping[str, float | None] = field(default_factory=dict)
    rmse_last_half: Mapping[str, float | None] = field(default_factory=dict)
    mean_nees: float | None = None
    mean_nees_last_half: float | None = None
    mean_nis: float | None = None
    diverged: bool = False
    crlb: Mapping[str, float | None] = field(default_factory=dict)
    crlb_last_half: Mapping[str, float | None] = field(default_factory=dict)
    convergence_time: float | None = None
    tests: ConsistencyTests = field(default_factory=ConsistencyTests)
    rejected: int | None = None
    outliers: int | None = None
    modes: Sequence[Mapping[str, Any]] | None = None
    nees_ideal: float | None = None
    nees_ideal_last_half: float | None = None
    residual_rms: Mapping[str, float] = field(default_factory=dict)
    apart: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The row in the contract's names, numbers that are not finite as None."""
        names = [*_ALWAYS, *(g for g in self.rmse if g not in _ALWAYS)]
        out: dict[str, Any] = {k: getattr(self, k) for k in ("estimator", "view", "success", "message", "iterations")}
        out["seconds"] = finite(self.seconds)
        out |= {f"{g}_rmse": finite(self.rmse.get(g)) for g in names}
        out |= {f"{g}_rmse_last_half": finite(self.rmse_last_half.get(g)) for g in names}
        squares = ("mean_nees", "mean_nees_last_half", "nees_ideal", "nees_ideal_last_half", "mean_nis")
        out |= {k: finite(getattr(self, k)) for k in squares}
        out["residual_rms"] = {unit: finite(value) for unit, value in self.residual_rms.items()}
        out["apart"] = finite(self.apart)
        out["diverged"] = self.diverged
        out |= {f"{g}_crlb": finite(self.crlb.get(g)) for g in names}
        out |= {f"{g}_crlb_last_half": finite(self.crlb_last_half.get(g)) for g in names}
        out["convergence_time"] = finite(self.convergence_time)
        out |= _tests(self.tests)
        extra = {k: getattr(self, k) for k in ("rejected", "outliers", "modes")}
        return out | {k: v for k, v in extra.items() if v is not None}


def _tests(found: ConsistencyTests) -> dict[str, float | None]:
    """Statistics and bounds of the tests as flat numbers."""
    out: dict[str, float | None] = {}
    two_sided = {"nees": found.nees, "nees_last_half": found.nees_last_half, "nis": found.nis}
    for name, check in two_sided.items():
        low, high = (None, None) if check is None else (finite(check.low), finite(check.high))
        out |= {f"{name}_low": low, f"{name}_high": high}
    out["nees_effective_epochs"] = None if found.nees is None else finite(found.nees.effective)
    for name, check in {"whiteness": found.whiteness, "bias": found.bias}.items():
        out[name] = None if check is None else finite(check.statistic)
        out[f"{name}_high"] = None if check is None else finite(check.high)
    return out


def evaluate(name: str, estimate: Estimate, bounds: Bounds | None = None, *, thorough: bool = True) -> Row:
    """How good the estimate is, and whether its covariance says so.

    Parameters
    ----------
    name : of the estimator
    estimate : Estimate
    bounds : of the problem at the truth, from `posterior_bounds`; without them the row has no Cramer-Rao bound
    thorough : whether to make the tests of `ConsistencyTests`, for which the problem is linearised about the estimate
    """
    last = slice(len(estimate.mean) // 2, None)
    columns, truth = groups(estimate), known_truth(estimate)
    known = None if truth is None else ~np.isnan(truth)
    error = None if truth is None else estimate.mean - truth
    consistency = None if error is None or known is None else squared_in_sigmas(error, estimate.covariance, known)
    lost = diverged(estimate, error, consistency)
    variances = None if bounds is None else np.diagonal(bounds.of(estimate.view), axis1=1, axis2=2)
    return Row(
        estimator=name,
        view=estimate.view,
        success=estimate.success,
        message=estimate.message,
        iterations=int(estimate.iterations),
        seconds=estimate.seconds,
        rmse={g: rmse(error, c, known=known) for g, c in columns.items()},
        rmse_last_half={g: rmse(error, c, last, known) for g, c in columns.items()},
        mean_nees=consistency.mean() if consistency else None,
        mean_nees_last_half=consistency.mean(last) if consistency else None,
        mean_nis=nis(estimate).mean(),
        diverged=lost,
        crlb={} if variances is None else {g: _spread(variances[:, list(c)]) for g, c in columns.items()},
        crlb_last_half={} if variances is None else {g: _spread(variances[last, list(c)]) for g, c in columns.items()},
        convergence_time=None
        if lost or error is None
        else convergence_time(error, next(iter(columns.values())), estimate.times),
        tests=check_consistency(estimate, consistency) if thorough else ConsistencyTests(),
        rejected=estimate.details.get("rejected_count"),
        outliers=outliers(estimate),
        modes=estimate.details.get("modes"),
        nees_ideal=consistency.ideal() if consistency else None,
        nees_ideal_last_half=consistency.ideal(last) if consistency else None,
        residual_rms=_left_over(estimate) if thorough else {},
    )


def _left_over(estimate: Estimate) -> Mapping[str, float]:
    """Residuals by unit, of the estimator's own or at its states; nothing for runs too long, or states that are not finite."""
    residuals = estimate.details.get("residuals")
    if residuals is None:
        if len(estimate.mean) > LONGEST or not np.isfinite(estimate.mean).all():
            return {}
        residuals = residuals_at(estimate.problem, estimate.tracking, estimate.mean)
    return residual_rms_by_unit(estimate, residuals)


def _spread(variances: np.ndarray[Any, Any]) -> float:
    """What an RMSE would be with these variances (K, d)."""
    return float(np.sqrt(variances.sum(axis=1).mean()))


def numbers(model: Model, rows: Sequence[Row]) -> list[tuple[str, Array, dict[str, str]]]:
    """Every number of the rows by the name that it has in JSON, NaN where it is not known, with its unit."""
    records = [row.to_dict() for row in rows]
    out: list[tuple[str, Array, dict[str, str]]] = []
    for key in dict.fromkeys(key for record in records for key in record):
        values = [record.get(key) for record in records]
        if all(v is None or isinstance(v, bool | int | float) for v in values):
            if not any(v is None for v in values) and isinstance(values[0], bool):
                out.append((key, np.array(values, dtype=bool), {}))
            else:
                out.append((key, np.array([np.nan if v is None else v for v in values], dtype=float), _unit(model, key)))
    for unit in dict.fromkeys(unit for row in rows for unit in row.residual_rms):
        left = np.array([row.residual_rms.get(unit, np.nan) for row in rows])
        out.append((residual_name(unit), left, {"units": unit}))
    return out


def residual_name(unit: str) -> str:
    """Name of a column of residuals in this unit."""
    return f"residual_rms_{unit}".rstrip("_").replace("/", "_per_").replace("^", "")


def _unit(model: Model, key: str) -> dict[str, str]:
    """The unit of a number of this name."""
    for what in ("_rmse", "_crlb"):
        group, found, _ = key.partition(what)
        if found:
            return {"units": unit_of(model.unit(s) for s in dict(model.groups).get(group, (group,)) if s in model.names)}
    return {"units": "s"} if key in ("seconds", "convergence_time") else {}
