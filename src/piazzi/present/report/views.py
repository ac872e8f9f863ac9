"""Every estimate of a comparison with its place in the legend, and what of its length is shown."""

from __future__ import annotations

from dataclasses import dataclass

from piazzi.estimate import Estimate
from piazzi.evaluate import Comparison
from piazzi.evaluate.bounds import Bounds, posterior_bounds
from piazzi.evaluate.honesty import LONGEST
from piazzi.evaluate.metrics import known_truth
from piazzi.evaluate.quantities import Display
from piazzi.present.colours import dash_of, label_of, shades
from piazzi.present.figures.style import time_display
from piazzi.present.report.blocks import Axis, Key
from piazzi.present.report.thinning import Thinning
from piazzi.problem.checks import Array


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
