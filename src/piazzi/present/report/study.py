"""A study -> the tabs of a page: one against what was varied, and one to pick for each point of its grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from piazzi.evaluate.quantities import Display, number
from piazzi.present.colours import dash_of, label_of, shades
from piazzi.present.figures.style import time_display
from piazzi.present.grid import value_text
from piazzi.present.report.blocks import Axis, Chart, Key, Line, Point, Section, Tab, Table, Text
from piazzi.present.report.study_grid import grid_keys, sections_along, sections_of_maps
from piazzi.present.study_table import columns, failures, group_display, heading, ideal_nees, point_name, widest_bounds
from piazzi.problem.checks import Array
from piazzi.study import Line as Result
from piazzi.study import Summary
from piazzi.study.grid import Grid
from piazzi.text import printable

MOST_TABS = 60
MOST_ROWS = 24  # of a table that is open
_READING = (
    "The error of a run is the length of its error vector; the last half is what is left once an estimator has settled. The"
    " bound is the Cramer-Rao bound, linearised at the truths: no estimator without bias has a smaller root mean square.",
    "NEES is the squared error in units of the covariance that the estimator claims. At each epoch its mean over runs should"
    " lie in the grey range; above it, errors are larger than claimed. A run has diverged when it has left the truth without"
    " knowing.",
)


def study_tabs(summary: Summary, title: str = "") -> list[Tab]:
    """The whole grid, and its points, the first sixty; a study of one point is one tab."""
    name = title or summary.stored.about["specification"]["name"] or "Study"
    grid = Grid.of(summary)
    if len(summary.stored.points) == 1:
        tab = _tab(summary, 0, name)
        if not grid.axes:
            return [tab]
        whole = _whole(summary, grid, name)
        return [whole, replace(tab, title="Over time")]
    points = [_tab(summary, index, name, grid) for index in range(min(len(summary.stored.points), MOST_TABS))]
    return [_whole(summary, grid, name), *points]


def _whole(summary: Summary, grid: Grid, name: str) -> Tab:
    """Everything against what was varied."""
    keys = grid_keys(grid)
    count, stored = len(summary.lines), summary.stored
    along = sections_along(summary, grid, keys)
    table = _table(summary, 0, count, keyed=False)
    sections = [*sections_of_maps(summary, grid), *along, replace(table, folded=count > MOST_ROWS), _reading(summary)]
    return Tab(name, heading(stored), _points(summary, summary.lines), sections, keys=keys)


def _reading(summary: Summary) -> Section:
    points = len(summary.stored.points)
    cut = [f"The first {MOST_TABS} of {points:,} points have a page of their own here."] if points > MOST_TABS else []
    return Section("How to read this", [Text([*_READING, *failures(summary), *cut])])


def _tab(summary: Summary, index: int, name: str, grid: Grid | None = None) -> Tab:
    stored = summary.stored
    rows = len(stored.rows)
    lines = summary.lines[index * rows : (index + 1) * rows]
    at = lines[0].point
    own, dashes = shades(line.estimator for line in lines), [line.estimator for line in lines]
    keys = [
        Key(label_of(line.estimator, line.view), own[line.estimator], dash_of(line.estimator, line.view, dashes))
        for line in lines
    ]
    show = time_display(stored.times)
    axis = Axis("time", show, low=float(stored.times[0]), high=float(stored.times[-1]))
    charts = [chart for i, group in enumerate(stored.groups) for chart in _errors(summary, lines, keys, axis, i, group)]
    return Tab(
        point_name(at) or name,
        heading(stored),
        _points(summary, lines),
        [
            Section("Errors", charts, "Over all runs that did not fail, at each epoch."),
            Section("Consistency", [_nees(lines, keys, axis, stored.times)]),
            _table(summary, index, rows),
            _reading(summary),
        ],
        keys=keys,
        times=stored.times,
        show_time=show,
        epoch=stored.epoch,
        at=[(axis, value_text(at[axis])) for axis in at] if grid is not None else (),
    )


def _errors(summary: Summary, lines: Sequence[Result], keys: Sequence[Key], axis: Axis, i: int, group: str) -> list[Chart]:
    """Median, root mean square and 95 % of the error of one group of states."""
    stored = summary.stored
    show = group_display(stored, group)
    out = []
    kinds = [
        ("Median", [line.history.quantiles[1, :, i] for line in lines]),
        ("Root mean square", [line.history.rms[:, i] for line in lines]),
        ("95 % of runs are below", [line.history.quantiles[2, :, i] for line in lines]),
    ]
    for kind, found in kinds:
        drawn = [Line(stored.times, y, keys[k].label, k) for k, y in enumerate(found)]
        if kind == "Root mean square":
            for view, dash in (("realtime", (2, 2)), ("delayed", (6, 2))):
                bound = next((line.history.bound[:, i] for line in lines if line.view == view), None)
                if bound is not None and np.isfinite(bound).any():
                    drawn.append(
                        Line(
                            stored.times,
                            bound,
                            f"bound, {'real time' if view == 'realtime' else 'delayed'}",
                            colour="#777777",
                            dash=dash,
                        )
                    )
        low, high = _limits([line.y for line in drawn if not isinstance(line.y, tuple)])
        name = printable(group)
        y = Axis(f"{name} error", show, "log", low, high)
        note = "Grey: the Cramer-Rao bound." if len(drawn) > len(lines) else ""
        out.append(Chart(f"{kind}: error of {name}", axis, y, drawn, note=note, column=f"{name}, {kind.lower()}"))
    return out


def _nees(lines: Sequence[Result], keys: Sequence[Key], axis: Axis, times: Array) -> Chart:
    drawn = [Line(times, line.history.nees, keys[k].label, k) for k, line in enumerate(lines)]
    widest = widest_bounds(lines)
    bounds = np.full((2, 1), np.nan) if widest is None else widest
    bottom, top = _limits([*(line.history.nees for line in lines), bounds.ravel()])
    ranges: list[tuple[float, float, str]] = []
    if np.isfinite(bounds).all() and (bounds == bounds[:, :1]).all():
        ranges = [(float(bounds[0, 0]), float(bounds[1, 0]), "")]
    elif widest is not None:
        drawn += [Line(times, edge, "99 % bound", dash=(2, 2)) for edge in widest]
    y = Axis("mean NEES", Display(""), "log", bottom, top)
    return Chart(f"Mean NEES over runs, {ideal_nees(lines)}", axis, y, drawn, ranges=ranges, column="mean NEES")


def _limits(series: Sequence[Array]) -> tuple[float, float]:
    good = np.concatenate([s[np.isfinite(s) & (s > 0)] for s in series])
    return (0.8 * float(good.min()), 1.25 * float(good.max())) if good.size else (0.1, 10.0)


def _table(summary: Summary, index: int, rows: int, keyed: bool = True) -> Section:
    shown = columns(summary)
    part = slice(index * rows, (index + 1) * rows)
    texts = list(zip(*(c.texts[part] for c in shown), strict=True))
    return Section("All numbers", [Table([(c.title, c.unit) for c in shown], texts, keys=list(range(rows)) if keyed else ())])


def _points(summary: Summary, lines: Sequence[Result]) -> list[Point]:
    """The smallest errors, who diverges, whose covariance is consistent, and who is cheap."""
    group = summary.stored.groups[0]
    show = group_display(summary.stored, group)
    out = []
    for view, words in (("realtime", "in real time"), ("delayed", "with later measurements")):
        found = [(m, line) for line in lines if line.view == view and (m := _median(line, group)) is not None]
        if found:
            error, best = min(found, key=lambda pair: pair[0])
            where = point_name(best.point) if len({id(line.point) for line in lines}) > 1 else ""
            text = f"{best.estimator}: median {printable(group)} error {number(error * show.factor, 3)}{show.suffix}"
            out.append(Point(f"Smallest errors {words}", f"{text}{f', where {where}' if where else ''}."))
    diverged = _counted(lines, lambda line: line.diverged)
    text = "; ".join(f"{name}: {found:,} of {runs:,}" for name, (found, runs, _) in diverged.items())
    out.append(Point("Diverged", f"{text}." if text else "No run.", "bad" if diverged else "good"))
    consistent = _counted(lines, lambda line: int((line.history.inside or 0.0) >= 0.9))
    names = ", ".join(f"{name}{f' at {n} of {of} points' if of > 1 else ''}" for name, (n, _, of) in consistent.items())
    text = f"{names}." if names else "None: the mean NEES leaves its bounds."
    out.append(Point("Consistent at nine epochs of ten", text, "good" if consistent else "bad"))
    failed = _counted(lines, lambda line: line.failed)
    if failed:
        text = "; ".join(f"{name}: {found:,} of {runs:,}" for name, (found, runs, _) in failed.items())
        out.append(Point("Failed runs", f"{text}.", "bad"))
    return out


def _counted(lines: Sequence[Result], count: Callable[[Result], int]) -> dict[str, tuple[int, int, int]]:
    """For every estimator with any of them, how many there are over all points, of how many runs and points."""
    out: dict[str, tuple[int, int, int]] = {}
    for line in lines:
        found, runs, points = out.get(label_of(line.estimator, line.view), (0, 0, 0))
        out[label_of(line.estimator, line.view)] = found + count(line), runs + line.runs, points + 1
    return {name: counts for name, counts in out.items() if counts[0]}


def _median(line: Result, group: str) -> float | None:
    found = line.rmse_last_half_quantiles[group]
    return None if found is None else found[1]
