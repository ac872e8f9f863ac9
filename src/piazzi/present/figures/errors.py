"""How wrong the estimates are, how wrong they say they are, and whether they are right about that."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.comparison import Comparison
from piazzi.evaluate.metrics import errors, groups
from piazzi.evaluate.quantities import Display, display_of, unit_of
from piazzi.present.figures.style import (
    MEASURED,
    drawn,
    label_of,
    line_of,
    plain,
    plain_ticks,
    shade_of,
    symmetric_scale,
    time_axis,
)
from piazzi.present.squares import Squares, nees_of, nis_of
from piazzi.problem import epoch_of
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from piazzi.earth import Epoch


SIGMAS = 3.0
RANGE = "95 % of a matched run"


def state_error(ax: Axes, estimate: Estimate, state: str, *, name: str = "estimate", show: Display | None = None) -> Axes:
    """Error of one state within the +-3 sigma of its covariance, against time; the band alone where there is no truth.

    `show` is the unit to draw in, by default what suits the size of the errors.

    Raises
    ------
    ValueError
        For a state that the model does not have.
    """
    band, error = error_and_band(estimate, state)
    show = show or state_display([estimate], state)
    time = time_axis(ax, estimate.times, estimate.epoch)
    part = drawn(len(band))
    t, half = estimate.times[part] * time.factor, band[part] * show.factor
    colour = shade_of(name)
    ax.fill_between(t, -half, half, color=colour, alpha=0.18, lw=0, label="+-3 sigma")
    for sign in (-1, 1):
        ax.plot(t, sign * half, color=colour, lw=0.6, alpha=0.6)
    if error is not None:
        ax.plot(t, error[part] * show.factor, color=colour, lw=1.1, label="error")
    ax.axhline(0, color=MEASURED, lw=0.6)
    symmetric_scale(ax, [size_of(estimate, state) * show.factor])
    ax.set_ylabel(show.label(f"error of {plain(state)}"))
    return ax


def error_and_band(estimate: Estimate, state: str) -> tuple[Array, Array | None]:
    """Three standard deviations of a state and its error, (K,) each; the error is None where it is not known."""
    if state not in estimate.names:
        raise ValueError(f"unknown state {state!r}; known: {', '.join(estimate.names)}")
    i = estimate.names.index(state)
    error = errors(estimate)
    band = SIGMAS * np.sqrt(np.maximum(estimate.covariance[:, i, i], 0.0))
    return band, None if error is None or np.isnan(error[:, i]).all() else error[:, i]


def size_of(estimate: Estimate, state: str) -> Array:
    """The larger of band and error at each epoch, (K,)."""
    band, error = error_and_band(estimate, state)
    return band if error is None else np.fmax(band, np.abs(error))


def state_display(estimates: Sequence[Estimate], state: str) -> Display:
    """The unit that suits the errors of a state in all these estimates."""
    sizes = [size_of(e, state) for e in estimates]
    typical = [float(np.median(s[np.isfinite(s)])) for s in sizes if np.isfinite(s).any()]
    return display_of(estimates[0].problem.model.unit(state), typical)


def error_overlay(ax: Axes, comparison: Comparison, group: str) -> Axes:
    """Length of the error of a group of states against time, a line for every estimator; empty where there is no truth.

    Raises
    ------
    ValueError
        For a group that the model does not have.
    """
    return _overlay(ax, comparison, group, [error for error, _ in _lengths(comparison, group)], "error")


def claim_overlay(ax: Axes, comparison: Comparison, group: str) -> Axes:
    """Length that the covariance expects of the error, the root of the summed variances, against time for every estimator.

    Raises
    ------
    ValueError
        For a group that the model does not have.
    """
    return _overlay(ax, comparison, group, [claimed for _, claimed in _lengths(comparison, group)], "error expected")


def _epoch(comparison: Comparison) -> Epoch | None:
    return epoch_of(comparison.problem, comparison.tracking)


def _overlay(ax: Axes, comparison: Comparison, group: str, lengths: Sequence[Array | None], what: str) -> Axes:
    views, times, model = comparison.views, comparison.tracking.times, comparison.problem.model
    both = [v for pair in _lengths(comparison, group) for v in pair if v is not None and np.isfinite(v).any()]
    unit = unit_of(model.unit(s) for s in dict(model.groups).get(group, (group,)))
    show = display_of(unit, [float(np.nanmedian(v)) for v in both])
    time, part, names = time_axis(ax, times, _epoch(comparison)), drawn(len(times)), tuple(name for name, _ in views)
    for n, ((name, view), length) in enumerate(zip(views, lengths, strict=True)):
        if length is not None:
            style = line_of(name, view, names) | {"lw": _width(n, len(views))}
            ax.plot(times[part] * time.factor, length[part] * show.factor, **style, label=label_of(name, view))
    if any(v is not None and (v > 0).any() for v in lengths):
        ax.set_yscale("log")
        plain_ticks(ax)
    ax.set_ylabel(show.label(f"{plain(group)} {what}"))
    return ax


def _width(n: int, count: int) -> float:
    """Of the n-th of so many lines: where two coincide, both are seen."""
    return 2.2 - 1.2 * n / count


def _lengths(comparison: Comparison, group: str) -> list[tuple[Array | None, Array]]:
    """For every view the length of the error vector, and the root of the summed variances, (K,) each."""
    out = []
    for estimate in comparison.views.values():
        found = groups(estimate)
        if group not in found:
            raise ValueError(f"unknown group {group!r}; known: {', '.join(found)}")
        columns, error = list(found[group]), errors(estimate)
        claimed = np.sqrt(np.maximum(np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, columns].sum(axis=1), 0.0))
        out.append((None if error is None else np.sqrt((error[:, columns] ** 2).sum(axis=1)), claimed))
    return out


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
    time = time_axis(ax, comparison.tracking.times, _epoch(comparison))
    ax.axhspan(found.low, found.high, color=MEASURED, alpha=0.13, lw=0, label=RANGE)
    ax.axhline(found.expected, color=MEASURED, lw=0.9, ls=(0, (5, 3)), label="ideal mean")
    part, names = drawn(len(found.times)), tuple(name for name, _ in comparison.views)
    seen = [np.array([found.low, found.high])]
    for n, ((name, view), values) in enumerate(zip(comparison.views, found.values, strict=True)):
        style = line_of(name, view, names) | {"lw": _width(n, len(names))}
        ax.plot(found.times[part] * time.factor, values[part], **style, label=label_of(name, view))
        seen.append(values[np.isfinite(values) & (values > 0)])
    ax.set_yscale("log")
    everything = np.concatenate(seen)
    low, high = np.quantile(everything, 0.005), everything.max()
    ax.set_ylim(max(min(low, found.low) / 1.3, found.low / 100), 1.3 * high)
    plain_ticks(ax)
    ax.set_ylabel(f"{found.name} ({found.ideal})")
    return ax
