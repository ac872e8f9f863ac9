"""Several estimators on the same measurements, side by side."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.drawn import Drawn
from piazzi.estimate.ahead import compile_for
from piazzi.estimate.estimator import Estimate, Estimator, views_of
from piazzi.estimate.registry import by_name
from piazzi.evaluate.bounds import Bounds, posterior_bounds
from piazzi.evaluate.comparison_table import grid, html, render, sentences
from piazzi.evaluate.consistency_tests import LONGEST
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.metrics import apart
from piazzi.evaluate.rows import Row, evaluate, numbers
from piazzi.evaluate.tabled import Tabled
from piazzi.problem import Problem, Tracking
from piazzi.problem.epochs import dated
from piazzi.problem.inputs import prepare
from piazzi.text import listed

if TYPE_CHECKING:
    import xarray
    from rich.console import Console, ConsoleOptions, RenderResult

LOGGER = logging.getLogger("piazzi.evaluate")
SCHEMA = "piazzi.compare/1"


@dataclass(frozen=True, eq=False)
class Comparison(Tabled, Drawn):
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "estimates", MappingProxyType(dict(self.estimates)))

    def __reduce__(self) -> tuple[Any, ...]:
        return Comparison, (self.problem, self.tracking, self.rows, dict(self.estimates), self.source)  # views have no pickle

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
            "prior_time": self.problem.prior_start(self.tracking.times),
            **dated(self.problem, self.tracking),
            "states": list(self.problem.model.names),
            "rows": [row.to_dict() for row in self.rows],
        }

    def to_dataset(self) -> xarray.Dataset:
        """Every number of the rows, labelled by estimator and view, with units."""
        import xarray as xr

        labels = ("estimator", "view", "message")
        texts = {k: (("row",), np.array([getattr(r, k) for r in self.rows], dtype=object)) for k in labels}
        variables: dict[str, Any] = {k: (("row",), v, units) for k, v, units in numbers(self.problem.model, self.rows)}
        variables["message"] = texts.pop("message")
        return xr.Dataset(variables, texts, {"source": self.source, "epochs": len(self.tracking.times)})

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        return render(self.problem.model, self.rows, self.tracking.values, console, options)

    def _repr_html_(self) -> str:
        return html(self.problem.model, self.rows, self.tracking.values)

    def __repr__(self) -> str:
        """In short: which estimators, on what."""
        failed = [name for name, e in self.estimates.items() if not e.success]
        return f"<Comparison of {listed(self.estimates)} on {self.problem!r}{f'; failed: {listed(failed)}' if failed else ''}>"

    def grids(self) -> list[Grid]:
        """One table, every column of it."""
        return [grid(self.problem.model, self.rows, self.tracking.values)]

    def sentences(self) -> list[str]:
        """What the table says, in plain words."""
        return sentences(self.problem.model, self.rows, self.tracking.values)


def compare(
    problem: Problem,
    tracking: Tracking,
    estimators: Mapping[str, Estimator] | Sequence[str],
    *,
    source: str = "",
    announce: Callable[[str], None] | None = None,
    thorough: bool = True,
) -> Comparison:
    """Run each estimator on the same tracking; one that fails keeps a row that says why, and the others theirs.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    estimators : mapping of the name to show to the estimator, or names as on the command line, such as ["ekf", "window:100"]
    source : where the measurements came from, for the record
    announce : called with each name before its estimator starts
    thorough : whether to find the Cramer-Rao bound and test consistency too, for which the problem is linearised

    Raises
    ------
    ValueError
        For names that mean no estimator, and where the tracking does not fit the problem, so that no estimator could run.
    """
    chosen = by_name(estimators)
    prepare(problem, tracking)
    compile_for(problem, chosen.values())
    bounds = bounds_of(problem, tracking) if thorough else None
    rows: list[Row] = []
    estimates: dict[str, Estimate] = {}
    for name, estimator in chosen.items():
        if announce is not None:
            announce(name)
        try:
            estimate = estimator.estimate(problem, tracking)
            found = [evaluate(name, e, bounds, thorough=thorough) for e in (estimate, estimate.delayed) if e is not None]
        except Exception as error:
            LOGGER.debug("%s failed", name, exc_info=True)
            found = failed(name, estimator, error)
        else:
            estimates[name] = estimate
        rows += found
    return Comparison(problem, tracking, _beside_first(rows, estimates), estimates, source)


def _beside_first(rows: Sequence[Row], estimates: Mapping[str, Estimate]) -> tuple[Row, ...]:
    """The rows with how far their last states are from those of the first estimator that succeeded."""
    first = next((e for e in estimates.values() if e.success), None)
    if first is None:
        return tuple(rows)
    found: dict[tuple[str, str], float] = {}
    for name, own in estimates.items():
        found |= {(name, e.view): apart(first, e) for e in (own, own.delayed) if e is not None and e is not first}
    return tuple(replace(row, apart=found.get((row.estimator, row.view))) for row in rows)


def bounds_of(problem: Problem, tracking: Tracking) -> Bounds | None:
    """Cramer-Rao bounds at the truth; None without truth, where they are not finite, and for more than 300,000 epochs."""
    return posterior_bounds(problem, tracking) if len(tracking.times) <= LONGEST else None


def failed(name: str, estimator: Estimator, error: Exception) -> list[Row]:
    """A row for each view that the estimator would have had."""
    text = " ".join(str(error).split())
    message = text if isinstance(error, ValueError) and text else f"{type(error).__name__}: {text}".rstrip(": ")
    return [Row(name, view, False, message, 0, None) for view in views_of(estimator)]
