"""What of a long run a page can show: of every few epochs the smallest and the largest value, so that no spike is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.problem.checks import Array

MOST_POINTS = 1500


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
