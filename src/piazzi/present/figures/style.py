"""What all pictures share: a colour for each estimator, units on axes, the axis of time, how many points are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from piazzi.evaluate.quantities import Display
from piazzi.present import colours
from piazzi.present.colours import COLOURS, MEASURED, PLANET, STATIONS, TRUTH, colour_of, dash_of, shade_of, shades
from piazzi.problem.checks import Array
from piazzi.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from piazzi.earth import Epoch

__all__ = ["COLOURS", "MEASURED", "PLANET", "STATIONS", "TRUTH", "colour_of", "label_of", "line_of", "plain", "shade_of"]
MOST_POINTS = 4000
RC: Any = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.3,
    "svg.hashsalt": "piazzi",  # the same picture has the same bytes
}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of that size in inches."""
    from matplotlib import figure

    return figure.Figure(figsize=(width, height), layout="constrained")


def line_of(name: str, view: str, names: tuple[str, ...] = ()) -> dict[str, Any]:
    """Colour and line style of a view of an estimator, among the estimators of these names."""
    dash = dash_of(name, view, names)
    return {"color": shades((*names, name))[name], "linestyle": (0, dash) if dash else "-"}


def label_of(name: str, view: str) -> str:
    """Name for legends; a window says which of its two views is meant."""
    return plain(colours.label_of(name, view))


def plain(text: str) -> str:
    """User text that matplotlib does not take for a formula, nor for characters that no font has."""
    return printable(text).replace("$", r"\$")


def time_display(times: Array) -> Display:
    """Hours, minutes or seconds, whichever suits the span of the run."""
    span = float(times[-1] - times[0]) if len(times) else 0.0
    return Display("h", 1 / 3600) if span >= 7200 else Display("min", 1 / 60) if span >= 600 else Display("s")


def drawn(count: int) -> slice:
    """Which of so many points are drawn: all, or evenly spaced ones where there are more than a picture can show."""
    return slice(None, None, max(1, -(-count // MOST_POINTS)))


def time_axis(ax: Axes, times: Array, epoch: Epoch | None = None, scale: str = "") -> Display:
    """Label and limit the axis of time, with dates where there is an epoch to count from (see `Calendar`); returns its unit."""
    show = time_display(times)
    ax.set_xlabel(show.label("time"))
    if epoch is not None:
        from piazzi.present.figures.dated import date_axis

        date_axis(ax, epoch, show.factor, scale)
    if len(times) > 1:
        margin = 0.01 * (times[-1] - times[0])
        ax.set_xlim((times[0] - margin) * show.factor, (times[-1] + margin) * show.factor)
    return show


def symmetric_scale(ax: Axes, sizes: Sequence[Array]) -> None:
    """Limits about zero that hold all these sizes; logarithmic away from zero where they shrink by more than a factor of 30."""
    sizes = [np.asarray(s)[np.isfinite(s) & (s > 0)] for s in sizes]
    if not sum(s.size for s in sizes):
        return
    largest = max(float(s.max(initial=0.0)) for s in sizes)
    settled = min(float(np.median(s[len(s) // 2 :])) for s in sizes if s.size)
    if largest > 30 * settled:
        _logarithmic(ax, settled, largest)
    ax.set_ylim(-1.15 * largest, 1.15 * largest)


def _logarithmic(ax: Axes, threshold: float, largest: float) -> None:
    """A scale linear up to the threshold and logarithmic beyond, with at most four powers of ten marked on each side."""
    from matplotlib.ticker import NullLocator

    ax.set_yscale("symlog", linthresh=threshold)
    powers = np.arange(np.ceil(np.log10(threshold / 2.5)), np.ceil(np.log10(largest)) + 1)
    marks = 10.0 ** powers[:: -(-len(powers) // 4)]
    ax.set_yticks([*-marks[::-1], 0.0, *marks])
    ax.yaxis.set_minor_locator(NullLocator())
    plain_ticks(ax)


def plain_ticks(ax: Axes, which: Literal["x", "y"] = "y") -> None:
    """Numbers such as 0.01 and 1000 on a logarithmic axis; 2 and 5 between them where it is less than two decades long."""
    axis = ax.xaxis if which == "x" else ax.yaxis

    def between(value: float, _: float) -> str:
        low, high = sorted(axis.get_view_interval())
        return f"{value:g}" if high < 100 * low and f"{value:.0e}"[0] in "25" else ""

    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(between)
