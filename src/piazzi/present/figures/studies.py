"""Pictures of a study: errors and consistency over time, and what accuracy costs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.present.figures.grids import grid_pages
from piazzi.present.figures.pages import save
from piazzi.present.figures.style import RC, label_of, line_of, new_figure, plain, plain_ticks, time_axis
from piazzi.present.grid import file_name
from piazzi.present.study_table import group_display, ideal_nees, point_name, widest_bounds
from piazzi.study import Line, Summary
from piazzi.text import printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = 12  # with pictures of their own: of more, maps and lines show them all
FEW = 4  # lines whose bands can be told apart


def write_figures(folder: str | os.PathLike[str], summary: Summary, title: str = "") -> list[Path]:
    """Write the pictures of a study as PNG; returns their paths, raises OSError."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    return [save(figure, place / f"{name}.png") for name, figure in study_pages(summary, title)]


def study_pages(summary: Summary, title: str = "") -> Iterator[tuple[str, Figure]]:
    """Names and figures of the pictures of a study, drawn one at a time."""
    from matplotlib import rc_context

    yield from grid_pages(summary, _heading(summary, title))
    rows = len(summary.stored.rows)
    for index in range(len(summary.stored.points) if len(summary.stored.points) <= MOST_POINTS else 0):
        lines = list(summary.lines[index * rows : (index + 1) * rows])
        tail = f"-{file_name(point_of(summary, index))}" if len(summary.stored.points) > 1 else ""
        for name, draw in (("errors", error_page), ("nees", nees_page), ("cost", cost_page)):
            with rc_context(RC):
                yield f"study-{name}{tail}", draw(summary, lines, title)


def point_of(summary: Summary, index: int) -> dict[str, Any]:
    """Values of the axes at a point, by name."""
    return dict(zip(summary.stored.about["axes"], summary.stored.points[index], strict=True))


def error_page(summary: Summary, lines: list[Line], title: str = "") -> Figure:
    """For each group of states the root mean square error over runs, and the Cramer-Rao bound; a few lines have bands."""
    stored = summary.stored
    figure = new_figure(8.0, 2.6 * len(stored.groups) + 0.6)
    for i, group in enumerate(stored.groups):
        ax = study_errors(figure.add_subplot(len(stored.groups), 1, i + 1), summary, lines, group)
        if i == 0:
            figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7)
    _title(figure, summary, lines, title, f"root mean square{'; shaded, 5 to 95 % of runs' if len(lines) <= FEW else ''}")
    return figure


def study_errors(ax: Axes, summary: Summary, lines: list[Line], group: str) -> Axes:
    """Root mean square error of a group of states over runs, and the Cramer-Rao bound; a few lines have bands."""
    stored, i, show = summary.stored, summary.stored.groups.index(group), group_display(summary.stored, group)
    unit, names = time_axis(ax, stored.times, stored.epoch), tuple(line.estimator for line in lines)
    for line in lines:
        style = line_of(line.estimator, line.view, names)
        rms, (low, _, high) = line.history.rms[:, i], line.history.quantiles[:, :, i] * show.factor
        ax.plot(stored.times * unit.factor, rms * show.factor, label=label_of(line.estimator, line.view), **style)
        if len(lines) <= FEW:
            ax.fill_between(stored.times * unit.factor, low, high, color=style["color"], alpha=0.12, linewidth=0)
    for view, dash in (("realtime", ":"), ("delayed", "-.")):
        bound = next((line.history.bound[:, i] for line in lines if line.view == view), None)
        if bound is not None:
            label = f"bound, {'real time' if view == 'realtime' else 'delayed'}"
            ax.plot(stored.times * unit.factor, bound * show.factor, color="black", linestyle=dash, label=label)
    ax.set_yscale("log")
    plain_ticks(ax)
    ax.set_ylabel(plain(show.label(f"{printable(group)} error")))
    return ax


def nees_page(summary: Summary, lines: list[Line], title: str = "") -> Figure:
    """Mean NEES over runs with the bounds that it should keep."""
    stored = summary.stored
    figure = new_figure(8.0, 3.6)
    ax, names = figure.add_subplot(), tuple(line.estimator for line in lines)
    unit = time_axis(ax, stored.times, stored.epoch)
    for line in lines:
        style = line_of(line.estimator, line.view, names)
        ax.plot(stored.times * unit.factor, line.history.nees, label=label_of(line.estimator, line.view), **style)
    widest = widest_bounds(lines)
    if widest is not None:
        ax.fill_between(stored.times * unit.factor, *widest, color="#BBBBBB", alpha=0.5, label="99 % bounds")
    ax.set_yscale("log")
    plain_ticks(ax)
    ax.set_ylabel("mean NEES over runs")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=7)
    _title(figure, summary, lines, title, ideal_nees(lines))
    return figure


def cost_page(summary: Summary, lines: list[Line], title: str = "") -> Figure:
    """What a run costs, and how far its errors in the last half are from the least possible."""
    stored = summary.stored
    group = stored.groups[0]
    figure = new_figure(7.0, 4.0)
    ax, names, seen = figure.add_subplot(), tuple(line.estimator for line in lines), []
    for line in lines:
        value = line.over_bound[group] or (line.rmse_last_half[group] if line.over_bound[group] is None else None)
        if value is None or line.seconds is None:
            continue
        style = line_of(line.estimator, line.view, names)
        ax.plot(line.seconds * 1e3, value, marker="o" if line.view == "realtime" else "s", linestyle="", color=style["color"])
        text, place = plain(label_of(line.estimator, line.view)), (5, 3 if line.view == "realtime" else -9)
        ax.annotate(text, (line.seconds * 1e3, value), xytext=place, textcoords="offset points", fontsize=7)
        seen.append((line.seconds * 1e3, value))
    ax.set_xscale("log")
    ax.set_yscale("log")
    if seen:  # with room for names, and for marks where all lie near together
        low, high = np.min(seen, axis=0), np.max(seen, axis=0)
        wider = np.maximum(10.0 / (high / low), 1.0) ** 0.5 * (high / low) ** 0.08
        ax.set_xlim(low[0] / wider[0], high[0] * wider[0] * (high[0] / low[0]) ** 0.1)
        ax.set_ylim(low[1] / wider[1], high[1] * wider[1])
    plain_ticks(ax)
    plain_ticks(ax, "x")
    ax.set_xlabel("time of one run [ms]")
    ax.set_ylabel(plain(f"{printable(group)} RMSE, last half, over its bound"))
    _title(figure, summary, lines, title, "circles, real time; squares, delayed")
    return figure


def _title(figure: Figure, summary: Summary, lines: list[Line], title: str, remark: str) -> None:
    where = point_name(lines[0].point)
    text = f"{_heading(summary, title)}{f', {where}' if where else ''}; {remark}"
    figure.suptitle(plain(text), fontsize=10, x=0.01, ha="left")


def _heading(summary: Summary, title: str = "") -> str:
    about = summary.stored.about["specification"]
    return f"{title or about['name'] or 'study'}: {about['runs']:,} runs"
