"""Whether estimators know their errors: NEES and NIS against time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.evaluate import Comparison
from piazzi.present.figures.style import MEASURED, drawn, label_of, line_of, plain_ticks, time_axis
from piazzi.present.squares import Squares, nees_of, nis_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RANGE = "95 % of a matched run"


def nees_track(ax: Axes, comparison: Comparison) -> Axes:
    """NEES of every epoch, a line for every view, over the range that holds 95 % of a matched run's values.

    Raises
    ------
    ValueError
        Where there is no truth.
    """
    found = nees_of(comparison)
    if found is None:
        raise ValueError("NEES needs the truth, which is not known here")
    return _track(ax, comparison, found)


def nis_track(ax: Axes, comparison: Comparison) -> Axes:
    """NIS averaged over a thirtieth of the run, a line for every view, over the range of 95 % of a matched run's means."""
    return _track(ax, comparison, nis_of(comparison))


def _track(ax: Axes, comparison: Comparison, found: Squares) -> Axes:
    time = time_axis(ax, comparison.tracking.times)
    ax.axhspan(found.low, found.high, color=MEASURED, alpha=0.13, lw=0, label=RANGE)
    ax.axhline(found.expected, color=MEASURED, lw=0.9, ls=(0, (5, 3)), label="ideal mean")
    part, names = drawn(len(found.times)), tuple(name for name, _ in comparison.views)
    seen = [np.array([found.low, found.high])]
    for (name, view), values in zip(comparison.views, found.values, strict=True):
        ax.plot(found.times[part] * time.factor, values[part], **line_of(name, view, names), lw=1.0, label=label_of(name, view))
        seen.append(values[np.isfinite(values) & (values > 0)])
    ax.set_yscale("log")
    everything = np.concatenate(seen)
    low, high = np.quantile(everything, 0.005), everything.max()
    ax.set_ylim(max(min(low, found.low) / 1.3, found.low / 100), 1.3 * high)
    plain_ticks(ax)
    ax.set_ylabel(f"{found.name} ({found.ideal})")
    return ax
