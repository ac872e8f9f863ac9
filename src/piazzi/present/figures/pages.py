"""Whole pictures: axes put together, titled, and saved."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.comparison import Comparison
from piazzi.evaluate.metrics import errors, groups, rmse
from piazzi.io.atomic import atomic_path
from piazzi.present.figures.errors import (
    claim_overlay,
    error_overlay,
    nees_track,
    nis_track,
    size_of,
    state_display,
    state_error,
)
from piazzi.present.figures.measured import innovations, measurements, passes
from piazzi.present.figures.space import orbit, path_shape, planes, position_at, position_columns
from piazzi.present.figures.style import MEASURED, RC, label_of, new_figure, plain, symmetric_scale
from piazzi.problem.gaps import in_passes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "pdf", "svg")
# no dates in files: the same picture has the same bytes
_METADATA: dict[str, dict[str, Any]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}


def pages(comparison: Comparison, *, title: str = "", planet_radius: float | None = None) -> Iterator[tuple[str, Figure]]:
    """Names and figures of the standard pictures of a comparison, drawn one at a time as they are asked for."""
    from matplotlib import rc_context

    makers: list[tuple[str, Callable[[], Figure]]] = []
    views = comparison.views
    if views:
        if position_columns(comparison.problem):
            makers.append(("orbit", lambda: orbit_page(comparison, planet_radius)))
        makers += [
            ("measurements", lambda: measurement_page(comparison)),
            *([("passes", lambda: pass_page(comparison))] if in_passes(comparison.problem, comparison.tracking) else []),
            ("errors", lambda: error_page(comparison)),
            ("comparison", lambda: overlay_page(comparison)),
            ("consistency", lambda: consistency_page(comparison)),
        ]
    for name, make in makers:
        with rc_context(RC):
            figure = make()
            if title:
                figure.suptitle(plain(title), fontsize=11, x=0.01, ha="left")
        yield name, figure


def save(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure as PNG, PDF or SVG by the ending, to a temporary name first; returns the path.

    Raises
    ------
    ValueError
        For another ending.
    OSError
        Where it cannot be written.
    """
    from matplotlib import rc_context

    target = Path(path)
    kind = target.suffix[1:].lower()
    if kind not in FORMATS:
        raise ValueError(f"{target}: a picture ends in {', '.join('.' + f for f in FORMATS)}, not {target.suffix!r}")
    with rc_context(RC), atomic_path(target) as work:
        figure.savefig(work, format=kind, dpi=150, metadata=_METADATA[kind])
    return target


def _first(comparison: Comparison) -> tuple[str, Estimate]:
    """The estimate that single pictures show: the first that succeeded, else the first."""
    found = list(comparison.estimates.items())
    return next(((name, e) for name, e in found if e.success), found[0])


def nearest(comparison: Comparison) -> tuple[tuple[str, str], Estimate]:
    """Name, view and estimate: the nearest to the truth in the last half, else the first that used later measurements."""
    found = {key: e for key, e in comparison.views.items() if e.success} or comparison.views
    columns = comparison.problem.model.group_indices["position"]

    def error(e: Estimate) -> float:
        off = rmse(errors(e), columns, slice(len(e.times) // 2, None))
        return inf if off is None else off

    sizes = {key: error(e) for key, e in found.items()}
    late = [key for key, e in found.items() if e.view == "delayed"] or [*found]
    key = min(sizes, key=lambda key: sizes[key]) if min(sizes.values()) < inf else late[0]
    return key, found[key]


def orbit_page(comparison: Comparison, planet_radius: float | None = None) -> Figure:
    """The orbit with the planet, and where every estimator puts the object at the end."""
    (name, _), estimate = nearest(comparison)
    found_planes = planes(comparison.problem)
    if len(found_planes) == 1:
        figure = new_figure(10.5, 5.4)
        axes = figure.subplots(1, 2, gridspec_kw={"width_ratios": [path_shape(estimate, planet_radius), 1.0]})
    else:
        figure = new_figure(10.5, 9.6)
        axes = figure.subplots(2, 2).ravel()
    for ax, plane in zip(axes, found_planes, strict=False):
        orbit(ax, estimate, name=name, planet_radius=planet_radius, plane=plane)
        ax.set_anchor("C")
    axes[0].set_title(f"{'Orbit' if planet_radius else 'Path'} by {label_of(name, estimate.view)}")
    position_at(axes[-1], comparison.views)
    found = {label: handle for ax in axes for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    rows = -(-len(found) // 6)
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=-(-len(found) // rows))
    return figure


def measurement_page(comparison: Comparison) -> Figure:
    """For each component the measurements above, and the innovations of one estimator below."""
    name, estimate = _first(comparison)
    width = comparison.problem.model.width
    figure = new_figure(10.5, 2.5 * 2 * width + 0.4)
    axes = figure.subplots(2 * width, 1, squeeze=False, sharex=True)[:, 0]
    for column in range(width):
        top, bottom = axes[2 * column : 2 * column + 2]
        measurements(top, comparison.problem, comparison.tracking, column).label_outer()
        top.set_title("Measurements")
        innovations(bottom, estimate, column, name=name).label_outer()
        bottom.set_title(f"Innovations of {plain(name)} within 3 sigma")
    if len(comparison.problem.stations) > 1:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=6, markerscale=4)
    return figure


def pass_page(comparison: Comparison) -> Figure:
    """When each station measured."""
    figure = new_figure(10.5, 0.35 * len(comparison.problem.stations) + 1.2)
    passes(figure.add_subplot(), comparison.problem, comparison.tracking).set_title("Passes")
    return figure


def error_page(comparison: Comparison) -> Figure:
    """A column for each estimator (a window's real-time view), a row for each state: errors within +-3 sigma."""
    estimates = list(comparison.estimates.items())
    states = comparison.problem.model.names
    figure = new_figure(max(5.5, 3.6 * len(estimates)), 1.75 * len(states) + 0.6)
    axes = figure.subplots(len(states), len(estimates), squeeze=False, sharex=True, sharey="row")
    for r, state in enumerate(states):
        show = state_display([e for _, e in estimates], state)
        for c, (name, estimate) in enumerate(estimates):
            state_error(axes[r, c], estimate, state, name=name, show=show).label_outer()
        symmetric_scale(axes[r, 0], [size_of(e, state) * show.factor for _, e in estimates])
    for ax, (name, estimate) in zip(axes[0], estimates, strict=True):
        ax.set_title(label_of(name, estimate.view))
    figure.align_ylabels(list(axes[:, 0]))
    bent = any(ax.get_yscale() == "symlog" for ax in axes[:, 0])
    lines = {"error": {"lw": 1.3, "color": MEASURED}, "+-3 sigma": {"lw": 8, "color": MEASURED, "alpha": 0.25}}
    _legend(figure, lines, "Scales are linear about zero and logarithmic further out" if bent else "")
    return figure


def overlay_page(comparison: Comparison) -> Figure:
    """Errors of all estimators on the left, what their covariances expect on the right, a row for each group."""
    first = next(iter(comparison.estimates.values()))
    names, known = list(groups(first)), errors(first) is not None
    figure = new_figure(10.5, 2.7 * len(names) + 0.7)
    axes = figure.subplots(len(names), 1 + known, squeeze=False, sharex=True, sharey="row")
    for row, group in zip(axes, names, strict=True):
        if known:
            error_overlay(row[0], comparison, group).label_outer()
        claim_overlay(row[-1], comparison, group).label_outer()
        row[-1].set_ylabel("" if known else row[-1].get_ylabel())
    if known:
        axes[0, 0].set_title("Error")
    axes[0, -1].set_title("Error that the covariance expects (1 sigma)")
    figure.align_ylabels(list(axes[:, 0]))
    figure.legend(*axes[0, -1].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def consistency_page(comparison: Comparison) -> Figure:
    """NEES, where the truth is known, above NIS."""
    known = errors(next(iter(comparison.estimates.values()))) is not None
    figure = new_figure(10.5, 2.7 * (1 + known) + 0.7)
    axes = figure.subplots(1 + known, 1, squeeze=False, sharex=True)[:, 0]
    if known:
        nees_track(axes[0], comparison).label_outer()
        axes[0].set_title("Squared errors in units of their covariance")
    nis_track(axes[-1], comparison)
    axes[-1].set_title("Squared innovations in units of their covariance")
    figure.align_ylabels(list(axes))
    figure.legend(*axes[-1].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    return figure


def _legend(figure: Figure, lines: Mapping[str, Mapping[str, Any]], title: str) -> None:
    """A legend of line styles alone, below everything."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], **style) for style in lines.values()]
    figure.legend(handles, list(lines), loc="outside lower center", ncols=len(lines), title=title or None, title_fontsize=8)
