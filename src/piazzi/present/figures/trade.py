"""What a window's length buys, and what estimators cost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.evaluate.comparison_table import row_display
from piazzi.evaluate.window_trade import WindowTrade
from piazzi.present.figures.style import COLOURS, MEASURED, plain, plain_ticks
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLES = (("realtime", "window, real time", "-"), ("delayed", "window, delayed", (0, (4, 1.5))))


def window_trade(ax: Axes, trade: WindowTrade, group: str) -> Axes:
    """RMSE of a group of states in the last half of the run against window length, both views, beside the full graph.

    Raises
    ------
    ValueError
        For a group that has no errors: one that the model does not name, or where there is no truth.
    """
    if group not in trade.groups:
        raise ValueError(f"no errors of group {group!r}; known: {', '.join(trade.groups) or 'none, without truth'}")
    show = row_display(trade.problem.model, trade.all_rows, group)
    values = {view: trade.rmse(group, view) * show.factor for view, _, _ in _STYLES}
    graph = trade.graph.rmse_last_half.get(group) if trade.graph else None
    _against_length(ax, trade, values, None if graph is None else graph * show.factor)
    ax.set_ylabel(show.label(f"{plain(group)} RMSE, last half"))
    return ax


def window_consistency(ax: Axes, trade: WindowTrade) -> Axes:
    """Mean NEES of the last half against window length, both views, beside the full graph and the ideal."""
    values = {view: trade.mean_nees(view) for view, _, _ in _STYLES}
    _against_length(ax, trade, values, trade.graph.mean_nees_last_half if trade.graph else None)
    for n in trade.ideal_nees(*values):
        ax.axhline(n, color=MEASURED, lw=0.9, ls=(0, (5, 3)), label=f"ideal, {n:g}")
    ax.set_ylabel("mean NEES, last half")
    return ax


def window_cost(ax: Axes, trade: WindowTrade) -> Axes:
    """Microseconds per step against window length."""
    ax.plot(trade.lags, trade.microseconds_per_step, "o-", ms=4, color=COLOURS["window"], label="window")
    _length_axis(ax)
    ax.set_ylabel("time per step [us]")
    return ax


def timing(ax: Axes, epochs: Array, seconds: Array) -> Axes:
    """Seconds of the whole graph against the number of epochs, in the unit that suits the longest."""
    factor, unit = (1.0, "s") if np.nanmax(seconds, initial=0.0) >= 1 else (1e3, "ms")
    ax.plot(epochs, np.asarray(seconds) * factor, ".", ms=4, color=COLOURS["graph"], label="graph")
    ax.set_xlabel("length of the run [epochs]")
    ax.set_ylabel(f"time [{unit}]")
    ax.set_ylim(bottom=0)
    return ax


def _against_length(ax: Axes, trade: WindowTrade, values: dict[str, Array], graph: float | None) -> None:
    for view, label, dashes in _STYLES:
        if np.isfinite(values[view]).any():
            ax.plot(trade.lags, values[view], "o", ls=dashes, ms=4, color=COLOURS["window"], label=label)
    if graph is not None and np.isfinite(graph):
        ax.axhline(graph, color=COLOURS["graph"], lw=1.2, label="full graph")
    _length_axis(ax)


def _length_axis(ax: Axes) -> None:
    ax.set_xscale("log")
    ax.set_yscale("log")
    plain_ticks(ax)
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.set_xlabel("window length [states]")
