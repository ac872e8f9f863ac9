"""A study -> the tab of a page, one for each point of its grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.evaluate.quantities import Display, number
from piazzi.present.colours import dash_of, label_of, shades
from piazzi.present.figures.style import time_display, time_label
from piazzi.present.report.blocks import Axis, Chart, Key, Line, Point, Section, Tab, Table, Text
from piazzi.present.study_table import columns, failures, group_display, heading, ideal_nees, point_name, widest_bounds
from piazzi.problem.checks import Array
from piazzi.study import Line as Result
from piazzi.study import Summary
from piazzi.text import printable

MOST_TABS = 12
_READING = (
    "The error of a run is the length of its error vector; the last half is what is left once an estimator has settled. The"
    " bound is the Cramer-Rao bound, linearised at the truths: no estimator without bias has a smaller root mean square.",
    "NEES is the squared error in units of the covariance that the estimator claims. At each epoch its mean over runs should"
    " lie in the grey range; above it, errors are larger than claimed. A run has diverged when it has left the truth without"
    " knowing.",
)


def study_tabs(summary: Summary, title: str = "") -> list[Tab]:
    """A tab for each point, the first twelve."""
    points = summary.stored.points[:MOST_TABS]
    return [_tab(summary, index, title) for index in range(len(points))]


def _tab(summary: Summary, index: int, title: str) -> Tab:
    stored = summary.stored
    rows = len(stored.rows)
    lines = summary.lines[index * rows : (index + 1) * rows]
    where = point_name(lines[0].point)
    name = title or stored.about["specification"]["name"] or "Study"
    own, dashes = shades(line.estimator for line in lines), [line.estimator for line in lines]
    keys = [
        Key(label_of(line.estimator, line.view), own[line.estimator], dash_of(line.estimator, line.view, dashes))
        for line in lines
    ]
    show = time_display(stored.times)
    axis = Axis(time_label(stored.epoch), show, low=float(stored.times[0]), high=float(stored.times[-1]))
    charts = [chart for i, group in enumerate(stored.groups) for chart in _errors(summary, lines, keys, axis, i, group)]
    return Tab(
        f"{name}: {where}" if where else name,
        heading(stored),
        _points(summary, lines),
        [
            Section("Errors", charts, "Over all runs that did not fail, at each epoch."),
            Section("Consistency", [_nees(lines, keys, axis, stored.times)]),
            _table(summary, index, rows),
            Section("How to read this", [Text([*_READING, *failures(summary)])]),
        ],
        keys=keys,
        times=stored.times,
        show_time=show,
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
                    drawn.append(Line(stored.times, bound, f"bound, {view}", colour="#777777", dash=dash))
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


def _table(summary: Summary, index: int, rows: int) -> Section:
    shown = columns(summary)
    part = slice(index * rows, (index + 1) * rows)
    texts = list(zip(*(c.texts[part] for c in shown), strict=True))
    return Section("All numbers", [Table([(c.title, c.unit) for c in shown], texts, keys=list(range(rows)))])


def _points(summary: Summary, lines: Sequence[Result]) -> list[Point]:
    """The smallest errors, who diverges, whose covariance is consistent, and who is cheap."""
    group = summary.stored.groups[0]
    show = group_display(summary.stored, group)
    out = []
    for view, words in (("realtime", "in real time"), ("delayed", "with later measurements")):
        found = [(m, line) for line in lines if line.view == view and (m := _median(line, group)) is not None]
        if found:
            error, best = min(found, key=lambda pair: pair[0])
            text = f"{best.estimator}: median {printable(group)} error {number(error * show.factor, 3)}{show.suffix}."
            out.append(Point(f"Smallest errors {words}", text))
    diverged = [line for line in lines if line.diverged]
    text = "; ".join(f"{label_of(line.estimator, line.view)}: {line.diverged:,} of {line.runs:,}" for line in diverged)
    out.append(Point("Diverged", f"{text}." if text else "No run.", "bad" if diverged else "good"))
    consistent = [line for line in lines if (line.history.inside or 0.0) >= 0.9]
    names = ", ".join(label_of(line.estimator, line.view) for line in consistent)
    text = f"{names}." if names else "None: the mean NEES leaves its bounds."
    out.append(Point("Consistent at nine epochs of ten", text, "good" if consistent else "bad"))
    failed = [line for line in lines if line.failed]
    if failed:
        text = "; ".join(f"{label_of(line.estimator, line.view)}: {line.failed:,}" for line in failed)
        out.append(Point("Failed runs", f"{text}.", "bad"))
    return out


def _median(line: Result, group: str) -> float | None:
    found = line.rmse_last_half_quantiles[group]
    return None if found is None else found[1]
