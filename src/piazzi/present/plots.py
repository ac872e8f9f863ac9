"""The picture of each kind of result, on axes of the caller's or on new ones: what `plot` of results draws."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.comparison import Comparison
from piazzi.evaluate.metrics import errors
from piazzi.evaluate.observable import Observability
from piazzi.evaluate.window_trade import WindowTrade
from piazzi.present.figures.errors import SIGMAS, claim_overlay, error_overlay, state_error
from piazzi.present.figures.grids import against as drawn_against
from piazzi.present.figures.measured import measurements
from piazzi.present.figures.sight import bound_sigmas
from piazzi.present.figures.studies import point_of, study_errors
from piazzi.present.figures.style import MEASURED, RC, STATIONS, drawn, plain, shade_of, time_axis
from piazzi.present.figures.trade import window_trade
from piazzi.present.grid import measures
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.study import Stored, Summary
from piazzi.study.grid import Grid
from piazzi.text import nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes


def plot(result: Any, ax: Axes | None = None, **options: Any) -> Axes:
    """Draw a result on these axes, or on new ones; returns them."""
    from matplotlib import pyplot, rc_context

    with rc_context(RC):
        ax = pyplot.subplots(layout="constrained")[1] if ax is None else ax
        return _on(result, ax, **options)


@singledispatch
def _on(result: Any, ax: Axes, **options: Any) -> Axes:
    raise TypeError(f"there is no picture of a {type(result).__name__}")


@_on.register(Tracking)
def _tracking(result: Tracking, ax: Axes, problem: Problem | None = None, component: int = 0) -> Axes:
    """One component against time, by station; with the problem its name and unit, in SI without."""
    width = result.values.shape[1]
    if not 0 <= component < width:
        raise ValueError(f"component is {component}; there are {width}, counted from 0")
    if problem is not None:
        return _legend(measurements(ax, problem, result, component))
    names = np.full(len(result.row_times), "") if result.row_stations is None else np.asarray(result.row_stations)
    time = time_axis(ax, result.times, result.epoch)
    for i, name in enumerate(dict.fromkeys(names.tolist())):
        rows = np.flatnonzero(names == name)
        t, values = result.row_times[rows] * time.factor, result.values[rows, component]
        ax.plot(t, values, ".", ms=2.5, color=STATIONS[i % len(STATIONS)] if name else MEASURED, label=plain(str(name)))
    ax.set_ylabel(f"component {component}")
    return _legend(ax)


@_on.register(Estimate)
def _estimate(result: Estimate, ax: Axes, state: str | None = None) -> Axes:
    """Error of a state in its 3 sigma where the truth is known, else the state itself with them."""
    state = _one_of(state, result.names, "state")
    true = errors(result)
    if true is not None and np.isfinite(true[:, result.names.index(state)]).any():
        return _legend(state_error(ax, result, state))
    i, unit = result.names.index(state), result.problem.model.unit(state)
    time, part = time_axis(ax, result.times, result.epoch), drawn(len(result.times))
    x, t = result.mean[part, i], result.times[part] * time.factor
    half: Array = SIGMAS * np.sqrt(np.maximum(result.covariance[part, i, i], 0.0))
    colour = shade_of("estimate")
    ax.fill_between(t, x - half, x + half, color=colour, alpha=0.18, lw=0, label="+-3 sigma")
    ax.plot(t, x, color=colour, lw=1.1, label="estimate")
    ax.set_ylabel(plain(f"{state} [{unit}]" if unit else state))
    return _legend(ax)


@_on.register(Comparison)
def _comparison(result: Comparison, ax: Axes, group: str | None = None) -> Axes:
    """Errors of a group of states by estimator where the truth is known, else what each says of its error."""
    group = _one_of(group, list(result.problem.model.group_indices), "group")
    known = any(errors(e) is not None for e in result.views.values())
    return _legend((error_overlay if known else claim_overlay)(ax, result, group))


@_on.register(WindowTrade)
def _trade(result: WindowTrade, ax: Axes, group: str | None = None) -> Axes:
    """Errors of a group of states against the length of the window."""
    return _legend(window_trade(ax, result, _one_of(group, list(result.problem.model.group_indices), "group")))


@_on.register(Observability)
def _observability(result: Observability, ax: Axes) -> Axes:
    """How sure each component of the first state can be, against time."""
    return _legend(bound_sigmas(ax, result))


@_on.register(Summary)
def _study(
    result: Summary, ax: Axes, group: str | None = None, point: int = 0, against: str | None = None, measure: str = ""
) -> Axes:
    """Root mean square errors of a group of states at a point of the grid; or a measure `against` what was varied.

    A measure is an error by its group, "NEES" or "divergence"; other axes of the grid have the values of the point, settings
    of estimators at their first.
    """
    points = len(result.stored.points)
    if not 0 <= point < points:
        raise ValueError(f"point is {point}; there are {points}, counted from 0")
    at = point_of(result, point)
    if against is not None:
        grid, known = Grid.of(result), {m.name: m for m in measures(result)}
        axis = _one_of(against, list(grid.axes), "axis")
        name = _one_of(f"{group} error" if group else measure or None, list(known), "measure")
        rest = {n: at.get(n, values[0]) for n, values in grid.axes.items() if n != axis}
        return _legend(drawn_against(ax, grid, axis, known[name], rest))
    lines = [line for line in result.lines if line.point == at]
    return _legend(study_errors(ax, result, lines, _one_of(group, result.stored.groups, "group")))


@_on.register(Stored)
def _stored(result: Stored, ax: Axes, **options: Any) -> Axes:
    """As of its summary."""
    return _study(result.summary, ax, **options)


def _one_of(given: str | None, known: Sequence[str], what: str) -> str:
    """The one that is asked for, or the first."""
    if given is None and known:
        return known[0]
    if given not in known:
        there = f"known: {', '.join(known)}" if known else "there are none"
        raise ValueError(f"unknown {what} {given!r}; {there}{nearest(str(given), known)}")
    return str(given)


def _legend(ax: Axes) -> Axes:
    if any(label for label in ax.get_legend_handles_labels()[1]):
        ax.legend(fontsize=7)
    return ax
