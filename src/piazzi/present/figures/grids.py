"""Pictures of a study against what was varied: lines with their spread over runs, and heat maps of every two numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from piazzi.present.figures.style import MEASURED, RC, label_of, line_of, new_figure, plain, plain_ticks
from piazzi.present.grid import Measure, Scale, colour, file_name, letters, measures, shares, spreads, where
from piazzi.problem.checks import Array
from piazzi.study import Summary
from piazzi.study.grid import At, Grid, Who

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_COLUMNS = 4


def grid_pages(summary: Summary, title: str) -> Iterator[tuple[str, Figure]]:
    """Names and figures, one at a time: a picture for each axis of the grid, and one for every two of them."""
    from matplotlib import rc_context

    grid = Grid.of(summary)
    for axis in grid.axes:
        with rc_context(RC):
            yield f"study-against-{file_name({axis: ''})[:-1]}", _along_page(summary, grid, axis, title)
    for pair in grid.pairs:
        with rc_context(RC):
            name = "-".join(file_name({axis: ""})[:-1] for axis in pair)
            yield f"study-map-{name}", _map_page(summary, grid, pair, title)


def against(ax: Axes, grid: Grid, axis: str, measure: Measure, at: At) -> Axes:
    """A measure against one axis of a grid, where the others have the values `at`: a line for each estimator with its spread.

    An estimator that does not have the setting is a level line.
    """
    scale = Scale.of(grid.axes[axis])
    names, count, top = tuple(name for name, _ in grid.estimators), len(grid.estimators), 0.0
    for i, (who, lines) in enumerate(grid.along(axis, at).items()):
        found, style = spreads(measure, lines) * measure.show.factor, line_of(*who, names)
        mark, top = "o" if grid.has(who, axis) else "", max(top, float(np.nanmax(found, initial=0.0)))
        ax.plot(scale.places, found[0], marker=mark, ms=3.5, label=label_of(*who), zorder=3, **style)
        if measure.scale == "linear":
            half = np.abs(found[1:] - found[0])
            ax.errorbar(scale.beside(i, count), found[0], half, fmt="none", ecolor=style["color"], elinewidth=1.0, capsize=2)
        elif count <= MOST_COLUMNS:
            ax.fill_between(scale.places, found[1], found[2], color=style["color"], alpha=0.13, lw=0, zorder=1 + 0.01 * i)
    if measure.ideal is not None:
        ax.axhline(measure.ideal, color=MEASURED, lw=0.9, ls=(0, (5, 3)), label="ideal", zorder=2)
    if scale.kind == "log":
        ax.set_xscale("log")
    ax.set_xticks(scale.places, [plain(text) for text in scale.texts])
    ax.minorticks_off()
    ax.set_xlim(*scale.limits)
    if measure.scale == "log":
        ax.set_yscale("log")
        plain_ticks(ax)
    else:
        ax.set_ylim(0.0, max(1.05 * top, 1.0, ax.get_ylim()[1] if not ax.get_autoscaley_on() else 0.0))  # of all columns
    ax.set_xlabel(plain(axis))
    ax.set_ylabel(measure.show.label(plain(measure.label)).replace(", ", ",\n", 1))
    return ax


def heat_map(ax: Axes, grid: Grid, pair: tuple[str, str], measure: Measure, values: Array, share: Array) -> Axes:
    """Values of a measure over two axes of a grid in the colours of their shares; each cell says its number."""
    for (row, column), value in np.ndenumerate(values):
        shade = colour(measure, float(share[row, column]))
        ax.fill_between([column - 0.5, column + 0.5], row - 0.5, row + 0.5, color=shade, lw=0)
        text = measure.text(float(value))
        ax.text(column, row, text, ha="center", va="center", color=letters(shade), fontsize=7)
    across, up = (Scale.of(grid.axes[axis]).texts for axis in pair)
    ax.set_xticks(range(len(across)), [plain(text) for text in across])
    ax.set_yticks(range(len(up)), [plain(text) for text in up])
    ax.set_xlim(-0.5, len(across) - 0.5)
    ax.set_ylim(-0.5, len(up) - 0.5)
    ax.grid(False)
    ax.tick_params(length=0)
    ax.set_xlabel(plain(pair[0]))
    ax.set_ylabel(plain(pair[1]))
    return ax


def map_values(grid: Grid, pair: tuple[str, str], measure: Measure, who: Who, at: At) -> Array:
    """The measure of an estimator at the values of the second axis (rows) and the first (columns), others having `at`."""
    lines = [grid.line(who, {**at, pair[0]: x, pair[1]: y}) for y in grid.axes[pair[1]] for x in grid.axes[pair[0]]]
    return np.asarray(spreads(measure, lines)[0].reshape(len(grid.axes[pair[1]]), len(grid.axes[pair[0]])))


def shown_of(grid: Grid, *axes: str) -> list[At]:
    """Values of the other axes that are shown side by side: all, or some that are evenly spaced."""
    others = grid.others(*axes)
    return [others[i] for i in dict.fromkeys(np.linspace(0, len(others) - 1, MOST_COLUMNS).astype(int).tolist())]


def mapped(grid: Grid, pair: tuple[str, str]) -> list[Who]:
    """Estimators that both axes make a difference to; all where there are none."""
    return [who for who in grid.estimators if all(grid.has(who, axis) for axis in pair)] or grid.estimators


def _along_page(summary: Summary, grid: Grid, axis: str, title: str) -> Figure:
    """Rows of measures, a column for values of the other axes."""
    found, columns = measures(summary), shown_of(grid, axis)
    figure = new_figure(max(5.0, 1.2 + 3.0 * len(columns)), 1.9 * len(found) + 0.9)
    axes = figure.subplots(len(found), len(columns), squeeze=False, sharex=True, sharey="row")
    for row, measure in zip(axes, found, strict=True):
        for ax, at in zip(row, columns, strict=True):
            against(ax, grid, axis, measure, at).label_outer()
    if columns != [{}]:
        for ax, at in zip(axes[0], columns, strict=True):
            ax.set_title(plain(where(at)))
    figure.align_ylabels(list(axes[:, 0]))
    handles = {label: handle for ax in axes[:, 0] for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5, handlelength=3)
    spread = "; shaded, 5 to 95 % of runs; bars, 95 % interval" if len(grid.estimators) <= MOST_COLUMNS else ""
    figure.suptitle(plain(f"{title}{spread}"), fontsize=10, x=0.01, ha="left")
    return figure


def _map_page(summary: Summary, grid: Grid, pair: tuple[str, str], title: str) -> Figure:
    """Rows of measures, a column for each estimator; other axes at their middle."""
    found, who = measures(summary), mapped(grid, pair)
    others = grid.others(*pair)
    at = others[len(others) // 2]
    cells = [len(grid.axes[axis]) for axis in pair]
    figure = new_figure(1.2 + max(2.4, 0.55 * cells[0] + 0.6) * len(who), (max(1.3, 0.34 * cells[1]) + 0.55) * len(found) + 0.7)
    axes = figure.subplots(len(found), len(who), squeeze=False, sharex=True, sharey=True)
    for row, measure in zip(axes, found, strict=True):
        values = np.stack([map_values(grid, pair, measure, one, at) for one in who])
        for ax, one, v, share in zip(row, who, values, shares(measure, values), strict=True):
            heat_map(ax, grid, pair, measure, v, share).label_outer()
            ax.set_title(f"{measure.show.label(plain(measure.name))}, {label_of(*one)}", fontsize=8)
    figure.suptitle(plain(f"{title}{f', {where(at)}' if at else ''}"), fontsize=10, x=0.01, ha="left")
    return figure
