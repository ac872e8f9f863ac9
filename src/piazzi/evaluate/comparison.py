"""Several estimators on the same measurements, side by side."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate import Estimate, Estimator
from piazzi.estimate.inputs import prepare
from piazzi.estimate.registry import views_of
from piazzi.evaluate.display import html, render
from piazzi.evaluate.grids import as_text
from piazzi.evaluate.metrics import diverged, groups, known_truth, nis, rmse, squared_in_sigmas
from piazzi.evaluate.quantities import finite
from piazzi.problem import Problem, Tracking

if TYPE_CHECKING:
    import xarray
    from rich.console import Console, ConsoleOptions, RenderResult

LOGGER = logging.getLogger("piazzi.evaluate")
SCHEMA = "piazzi.compare/1"
_ALWAYS = ("position", "velocity")  # groups that every row has, None where the model does not name them


@dataclass(frozen=True)
class Row:
    """One estimate's account of itself, SI units; None where there is no truth to compare with, or nothing to report.

    `rmse` and `rmse_last_half` hold one number for each group of states; the last half is rows K//2 onward.
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

    def to_dict(self) -> dict[str, Any]:
        """The row in the contract's names, numbers that are not finite as None."""
        names = [*_ALWAYS, *(g for g in self.rmse if g not in _ALWAYS)]
        out: dict[str, Any] = {k: getattr(self, k) for k in ("estimator", "view", "success", "message", "iterations")}
        out["seconds"] = finite(self.seconds)
        out |= {f"{g}_rmse": finite(self.rmse.get(g)) for g in names}
        out |= {f"{g}_rmse_last_half": finite(self.rmse_last_half.get(g)) for g in names}
        out |= {k: finite(getattr(self, k)) for k in ("mean_nees", "mean_nees_last_half", "mean_nis")}
        return out | {"diverged": self.diverged}


def evaluate(name: str, estimate: Estimate) -> Row:
    """How good the estimate is, and whether its covariance says so."""
    last = slice(len(estimate.mean) // 2, None)
    columns, truth = groups(estimate), known_truth(estimate)
    known = None if truth is None else ~np.isnan(truth)
    error = None if truth is None else estimate.mean - truth
    consistency = None if error is None or known is None else squared_in_sigmas(error, estimate.covariance, known)
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
        diverged=diverged(estimate, error, consistency),
    )


@dataclass(frozen=True, eq=False)
class Comparison:
    """Rows side by side, and the estimates that they are about.

    Attributes
    ----------
    problem, tracking : what was estimated
    rows : tuple of Row, in the order of the estimators; a window has two, realtime and delayed
    estimates : mapping of name to Estimate; an estimator that raised has none
    source : where the measurements came from
    """

    problem: Problem
    tracking: Tracking
    rows: tuple[Row, ...]
    estimates: Mapping[str, Estimate]
    source: str = ""

    @property
    def success(self) -> bool:
        """Whether every estimator succeeded."""
        return all(row.success for row in self.rows)

    @property
    def views(self) -> dict[tuple[str, str], Estimate]:
        """Every estimate by name and view, the delayed ones of windows included."""
        found = [(name, e) for name, estimate in self.estimates.items() for e in (estimate, estimate.delayed) if e is not None]
        return {(name, e.view): e for name, e in found}

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.compare/1."""
        return {
            "schema": SCHEMA,
            "source": self.source,
            "epochs": len(self.tracking.times),
            "states": list(self.problem.model.names),
            "rows": [row.to_dict() for row in self.rows],
        }

    def to_json(self, indent: int | None = None) -> str:
        """The object of schema piazzi.compare/1 as strict JSON."""
        return json.dumps(self.to_dict(), allow_nan=False, indent=indent)

    def to_dataset(self) -> xarray.Dataset:
        """Every number of the rows, labelled by estimator and view, with units."""
        from piazzi.evaluate.dataset import comparison_to_dataset

        return comparison_to_dataset(self)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        return render(self, console, options)

    def _repr_html_(self) -> str:
        return html(self)

    def __str__(self) -> str:
        return as_text(self)


def compare(
    problem: Problem,
    tracking: Tracking,
    estimators: Mapping[str, Estimator],
    *,
    source: str = "",
    announce: Callable[[str], None] | None = None,
) -> Comparison:
    """Run each estimator on the same tracking; one that fails keeps a row that says why, and the others theirs.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    estimators : mapping of the name to show to the estimator
    source : where the measurements came from, for the record
    announce : called with each name before its estimator starts

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem, so that no estimator could run.
    """
    prepare(problem, tracking)
    rows: list[Row] = []
    estimates: dict[str, Estimate] = {}
    for name, estimator in estimators.items():
        if announce is not None:
            announce(name)
        try:
            estimate = estimator.estimate(problem, tracking)
            found = [evaluate(name, e) for e in (estimate, estimate.delayed) if e is not None]
        except Exception as error:
            LOGGER.debug("%s failed", name, exc_info=True)
            found = failed(name, estimator, error)
        else:
            estimates[name] = estimate
        rows += found
    return Comparison(problem, tracking, tuple(rows), MappingProxyType(estimates), source)


def failed(name: str, estimator: Estimator, error: Exception) -> list[Row]:
    """A row for each view that the estimator would have had."""
    text = " ".join(str(error).split())
    message = text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}".rstrip(": ")
    return [Row(name, view, False, message, 0, None) for view in views_of(estimator)]
