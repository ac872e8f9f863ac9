"""How long a window has to be, as a tab of its own or a section of another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.evaluate.comparison_table import row_display
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.quantities import Display, ideal
from piazzi.evaluate.window_trade import WindowTrade
from piazzi.present.colours import COLOURS, DASHES
from piazzi.present.report.blocks import Axis, Chart, Line, Point, Section, Tab, Table, Text
from piazzi.present.tables import summary
from piazzi.problem.checks import Array

_VIEWS = (("realtime", "window, real time", DASHES[0]), ("delayed", "window, delayed", DASHES[1]))
_NAMES = tuple(view for view, _, _ in _VIEWS)
_INTRO = "Errors and NEES of the last half of the run, and cost, against the number of states that a window keeps."


def windows_tab(trade: WindowTrade, *, title: str = "") -> Tab:
    """A window trade by itself."""
    says = [Point("Window length", " ".join(trade.sentences()), "good" if trade.success else "bad")]
    subtitle = summary(trade.problem, trade.tracking, trade.source or "measurements")
    return Tab(title or trade.source or "Windows", subtitle, says, [windows_section(trade, words=False)])


def windows_section(trade: WindowTrade, *, words: bool = True) -> Section:
    """Errors, NEES and cost against window length, seconds of the graph against epochs, and their tables."""
    nees = [_nees(trade)] if trade.ideal_nees(*_NAMES) else []  # none without a truth, nor where nothing is uncertain
    charts = [*(_errors(trade, group) for group in trade.groups), *nees, _cost(trade)]
    timing = [] if trade.timing is None else [_timing(trade.timing.epochs, trade.timing.seconds)]
    tables = [table_of(grid) for grid in trade.grids()]
    says = [Text(trade.sentences())] if words else []
    return Section("Window length", [*says, *charts, *timing, *tables], _INTRO)


def table_of(grid: Grid) -> Table:
    """A grid of the terminal as a table of the page."""
    heads = [(first, rest.replace("\n", " ")) for first, _, rest in (head.partition("\n") for head in grid.heads)]
    return Table(heads, grid.rows, grid.title)


def _lags(trade: WindowTrade) -> Axis:
    """The axis of window length, with room for a single one."""
    low, high = float(trade.lags[0]), float(trade.lags[-1])
    return Axis("window length", Display("states"), "log", low / 1.2, high * 1.2)


def _lines(trade: WindowTrade, values: dict[str, Array], graph: float | None) -> list[Line]:
    x = trade.lags.astype(float)
    lines = [
        Line(x, values[view], label, colour=COLOURS["window"], dash=dash)
        for view, label, dash in _VIEWS
        if np.isfinite(values[view]).any()
    ]
    if graph is not None and np.isfinite(graph):
        ends = np.array([x[0], x[-1] if len(x) > 1 else 1.2 * x[0]])
        lines.append(Line(ends, np.array([graph, graph]), "full graph", colour=COLOURS["graph"]))
    return lines


def _errors(trade: WindowTrade, group: str) -> Chart:
    show = row_display(trade.problem.model, trade.all_rows, group)
    values = {view: trade.rmse(group, view) for view in _NAMES}
    graph = trade.graph.rmse_last_half.get(group) if trade.graph else None
    return _chart(trade, f"RMSE of {group}, last half", Axis(f"{group} RMSE", show, "log"), _lines(trade, values, graph))


def _nees(trade: WindowTrade) -> Chart:
    values = {view: trade.mean_nees(view) for view in _NAMES}
    best = trade.ideal_nees(*_NAMES)
    lines = _lines(trade, values, trade.graph.mean_nees_last_half if trade.graph else None)
    everything = np.concatenate([line.y for line in lines if isinstance(line.y, np.ndarray)] + [np.array(best)])
    good = everything[np.isfinite(everything) & (everything > 0)]
    y = Axis("mean NEES", Display(""), "log", float(good.min()) / 1.5, 1.5 * float(good.max()))
    return _chart(trade, f"Mean NEES, last half, {ideal(best)}", y, lines, levels=[(n, "ideal") for n in best])


def _cost(trade: WindowTrade) -> Chart:
    y = Axis("time per step", Display("us", 1e6), "log")
    lines = [Line(trade.lags.astype(float), trade.microseconds_per_step * 1e-6, "window", colour=COLOURS["window"])]
    return _chart(trade, "Cost of a window", y, lines)


def _chart(trade: WindowTrade, title: str, y: Axis, lines: Sequence[Line], levels: Sequence[tuple[float, str]] = ()) -> Chart:
    return Chart(title, _lags(trade), y, lines, time=False, levels=levels)


def _timing(epochs: Array, seconds: Array) -> Chart:
    line = Line(epochs.astype(float), seconds, "full graph", colour=COLOURS["graph"])
    x = Axis("length of the run", Display("epochs"), "log")
    return Chart("Cost of the full graph", x, Axis("time", Display("ms", 1e3), "log"), [line], time=False)
