"""What a page shows of a comparison: its views, and of long runs the smallest and the largest value of every few epochs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate import Comparison
from piazzi.evaluate.bounds import Bounds, posterior_bounds
from piazzi.evaluate.consistency_tests import LONGEST
from piazzi.evaluate.metrics import known_truth
from piazzi.evaluate.quantities import Display
from piazzi.present.colours import dash_of, label_of, shades
from piazzi.present.figures.style import time_display
from piazzi.present.report.blocks import Axis, Key
from piazzi.problem.checks import Array

MOST_POINTS = 1500


@dataclass(frozen=True, eq=False)
class Views:
    """What panels share.

    Attributes
    ----------
    found : every estimate by name and view
    keys : a legend entry for each of them
    truth : (K, n), or None where nothing of it is known
    thin : which epochs are shown
    times : (k,), their times, s
    bounds : Cramer-Rao bounds at the truth, where the comparison has looked for them
    show_time : unit of the axis of time
    """

    comparison: Comparison
    found: dict[tuple[str, str], Estimate]
    keys: tuple[Key, ...]
    truth: Array | None
    thin: Thinning
    times: Array
    show_time: Display
    bounds: Bounds | None = None

    @classmethod
    def of(cls, comparison: Comparison) -> Views:
        """The views of a comparison."""
        found, times = comparison.views, comparison.tracking.times
        names = [name for name, _ in found]
        colours = shades(names)
        keys = tuple(Key(label_of(name, view), colours[name], dash_of(name, view, names)) for name, view in found)
        truth = known_truth(next(iter(found.values()))) if found else None
        thin = Thinning(len(times))
        bounded = any(row.crlb for row in comparison.rows) and len(times) <= LONGEST
        bounds = posterior_bounds(comparison.problem, comparison.tracking) if bounded else None
        return cls(comparison, found, keys, truth, thin, thin.at_places(times), time_display(times), bounds)

    @property
    def axis(self) -> Axis:
        """The axis of time."""
        return Axis("time", self.show_time)

    @property
    def estimates(self) -> list[Estimate]:
        """In the order of the legend."""
        return list(self.found.values())

    def note(self, thin: Thinning | None = None) -> str:
        """What was left out of a chart, "" for nothing."""
        thin = thin or self.thin
        if thin.size == 1:
            return ""
        return f"Of every {thin.size:,} of {thin.count:,} values the smallest and the largest are drawn."


@dataclass(frozen=True)
class Thinning:
    """Which of `count` values a page holds: all of them up to `MOST_POINTS`, else two of every bucket of `size`."""

    count: int

    @property
    def size(self) -> int:
        """How many values make two; 1 where all are kept."""
        return 1 if self.count <= MOST_POINTS else -(-self.count // (MOST_POINTS // 2))

    @property
    def places(self) -> Array:
        """Where the values that are kept belong, increasing; in a bucket at its first and third quarter."""
        if self.size == 1:
            return np.arange(self.count)
        starts = np.arange(0, self.count, self.size)
        ends = np.minimum(starts + self.size, self.count)
        quarters = [starts + (ends - starts) // 4, starts + 3 * (ends - starts) // 4]
        return np.unique(np.stack(quarters, axis=1).ravel()) if self.count % self.size == 1 else np.stack(quarters, 1).ravel()

    def at_places(self, values: Array) -> Array:
        """The values where they belong."""
        return values[self.places]

    def sample(self, values: Array, bound: Array) -> Array:
        """The values where they belong, but in a bucket with any beyond the bound the largest in its place."""
        shown = values[self.places]
        if self.size == 1:
            return shown
        with np.errstate(invalid="ignore", divide="ignore"):
            excess = np.nan_to_num(np.abs(values) / bound, nan=0.0, posinf=0.0)
        starts = np.arange(0, self.count, self.size)
        for bucket in np.flatnonzero(np.maximum.reduceat(excess, starts) > 1.0).tolist():
            part = slice(starts[bucket], starts[bucket] + self.size)
            shown[np.searchsorted(self.places, starts[bucket])] = values[part][np.argmax(excess[part])]
        return shown

    def extremes(self, values: Array) -> Array:
        """The smallest and the largest of every bucket, in the order in which they came; NaN where a bucket has none."""
        if self.size == 1:
            return values
        rows = -(-self.count // self.size)
        padded = np.full(rows * self.size, np.nan)
        padded[: self.count] = np.where(np.isfinite(values), values, np.nan)
        buckets = padded.reshape(rows, self.size)
        absent = np.isnan(buckets)
        low, high = np.where(absent, np.inf, buckets).argmin(axis=1), np.where(absent, -np.inf, buckets).argmax(axis=1)
        each = np.arange(rows)
        out: Array = np.stack([buckets[each, np.minimum(low, high)], buckets[each, np.maximum(low, high)]], axis=1).ravel()
        return out[: len(self.places)]
