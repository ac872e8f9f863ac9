"""NEES and NIS of a comparison as they are drawn, with the range that a matched run keeps to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.chi_square import quantile
from piazzi.evaluate import Comparison
from piazzi.evaluate.metrics import Consistency, nees, nis
from piazzi.evaluate.quantities import ideal
from piazzi.problem.checks import Array

_STRETCHES = 30  # parts of a run over which NIS is averaged


@dataclass(frozen=True, eq=False)
class Squares:
    """Squared errors or innovations in units of their covariance.

    Attributes
    ----------
    name : what they are, for an axis
    times : (K,), s
    values : one (K,) for each view of the comparison, NaN where there is nothing to compare
    expected, low, high : mean of a matched run, and the range that holds 95 % of its values
    """

    name: str
    times: Array
    values: tuple[Array, ...]
    expected: float
    low: float
    high: float

    @property
    def ideal(self) -> str:
        """The expected mean in words."""
        return ideal([self.expected])


def nees_of(comparison: Comparison) -> Squares | None:
    """NEES of every epoch; None without truth.

    The range is chi-square's of as many degrees as the covariances have directions, in the mean over epochs and estimators.
    """
    found = [f for e in comparison.views.values() if (f := nees(e)) is not None]
    ranks = [n for f in found if (n := f.ideal()) is not None]
    if not ranks:
        return None
    values = tuple(np.where(f.rank > 0, f.value, np.nan) for f in found)
    n = float(np.mean(ranks))
    return Squares("NEES", comparison.tracking.times, values, n, quantile(0.025, n), quantile(0.975, n))


def nis_of(comparison: Comparison) -> Squares:
    """NIS averaged over a thirtieth of the run: innovations of a matched run are independent, so their sum is chi-square's."""
    tracking = comparison.tracking
    stretch = max(1, len(tracking.row_times) // _STRETCHES)
    present = (~np.isnan(tracking.values)).sum(axis=1)
    expected = float(present[present > 0].mean())
    low, high = (quantile(p, expected * stretch) / stretch for p in (0.025, 0.975))
    values = tuple(running_mean(nis(e), stretch) for e in comparison.views.values())
    name = "NIS" if stretch == 1 else f"mean NIS of {stretch:,} rows"
    return Squares(name, tracking.row_times, values, expected, low, high)


def running_mean(found: Consistency, stretch: int) -> Array:
    """Mean of the known values among the `stretch` rows about each row, (J,); NaN where fewer than half are known."""
    known = (found.rank > 0) & np.isfinite(found.value)
    sums = np.concatenate([[0.0], np.cumsum(np.where(known, found.value, 0.0))])
    counts = np.concatenate([[0], np.cumsum(known)])
    row = np.arange(len(known))
    start = np.clip(row - stretch // 2, 0, max(len(known) - stretch, 0))
    end = np.minimum(start + stretch, len(known))
    many = counts[end] - counts[start]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(2 * many > stretch, (sums[end] - sums[start]) / many, np.nan)
