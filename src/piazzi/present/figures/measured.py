"""What was measured, and what is left of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.quantities import Display, display_of, unit_of
from piazzi.present.figures.style import MEASURED, STATIONS, drawn, plain, shade_of, time_axis
from piazzi.problem import Problem, Tracking, epoch_of
from piazzi.problem import passes as find_passes
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SIGMAS = 3.0
SHORTEST = 0.002  # of the run: the shortest bar


def component_of(problem: Problem, column: int) -> tuple[str, str]:
    """Name and unit of a column of measurements; names of several sensors joined, unit "" where they differ."""
    sensors = [problem.model.sensor(s.sensor) for s in problem.stations]
    found = dict.fromkeys((s.components[column], dict(s.units)[s.components[column]]) for s in sensors if s.width > column)
    return " / ".join(dict.fromkeys(name for name, _ in found)), unit_of(unit for _, unit in found)


def kinds_of(problem: Problem, column: int) -> dict[tuple[str, str], list[int]]:
    """Name and unit of what stations measure in a column, and the indices of those that do."""
    out: dict[tuple[str, str], list[int]] = {}
    for s, station in enumerate(problem.stations):
        sensor = problem.model.sensor(station.sensor)
        if sensor.width > column:
            name = sensor.components[column]
            out.setdefault((name, dict(sensor.units)[name]), []).append(s)
    return out


def measurements(ax: Axes, problem: Problem, tracking: Tracking, column: int = 0) -> Axes:
    """One component of the measurements against time, a colour for each station."""
    from matplotlib.ticker import MultipleLocator

    name, unit = component_of(problem, column)
    values = tracking.values[:, column]
    show = display_of(unit, [float(np.nanmax(np.abs(values), initial=0.0))])
    time = time_axis(ax, tracking.times, epoch_of(problem, tracking))
    index = tracking.stations_of(problem)
    for s, station in enumerate(problem.stations):
        rows = np.flatnonzero((index == s) & ~np.isnan(values))
        rows = rows[drawn(len(rows))]
        colour = MEASURED if len(problem.stations) == 1 else STATIONS[s % len(STATIONS)]
        ax.plot(
            tracking.row_times[rows] * time.factor,
            values[rows] * show.factor,
            ".",
            ms=2.5,
            color=colour,
            label=plain(station.name),
        )
    if show.unit == "deg" and np.nanmax(np.abs(values), initial=0.0) > np.pi / 2:
        ax.yaxis.set_major_locator(MultipleLocator(90))
    ax.set_ylabel(show.label(plain(name)))
    return ax


def passes(ax: Axes, problem: Problem, tracking: Tracking, gap: float | None = None) -> Axes:
    """When each station measured: a bar for every pass, `piazzi.passes`."""
    time, names = time_axis(ax, tracking.times, epoch_of(problem, tracking)), [s.name for s in problem.stations]
    least = SHORTEST * float(tracking.times[-1] - tracking.times[0])
    for found in find_passes(problem, tracking, gap):
        s = names.index(found.station)
        bar = (found.start * time.factor, max(found.stop - found.start, least) * time.factor)
        ax.broken_barh([bar], (s - 0.3, 0.6), color=STATIONS[s % len(STATIONS)])
    ax.set_yticks(range(len(names)), [plain(name) for name in names])
    ax.set_ylim(len(names) - 0.4, -0.6)
    return ax


def innovations(ax: Axes, estimate: Estimate, column: int = 0, *, name: str = "estimate") -> Axes:
    """One component of the innovations against time, within 3 sigma of what the estimator expected, a band for each station."""
    label, unit = component_of(estimate.problem, column)
    nu, S = estimate.innovations[:, column], estimate.innovation_covariances[:, column, column]
    rows = np.flatnonzero(np.isfinite(nu) & np.isfinite(S))
    rows = rows[drawn(len(rows))]
    band = SIGMAS * np.sqrt(np.maximum(S[rows], 0.0))
    show = display_of(unit, [float(np.median(band)) if len(rows) else 0.0])
    time = time_axis(ax, estimate.times, estimate.epoch)
    t = estimate.tracking.row_times[rows] * time.factor
    station = estimate.tracking.stations_of(estimate.problem)[rows]
    for n, s in enumerate(np.unique(station)):  # each has a band of its own
        part = station == s
        half = band[part] * show.factor
        ax.fill_between(t[part], -half, half, color=shade_of(name), alpha=0.15, lw=0, label=None if n else "3 sigma")
    ax.plot(t, nu[rows] * show.factor, ".", ms=2.5, color=shade_of(name), label=plain(name))
    ax.axhline(0, color=MEASURED, lw=0.7)
    limit(ax, t, nu[rows], band, show, shade_of(name))
    ax.set_ylabel(show.label(f"innovation of {plain(label)}"))
    return ax


def limit(ax: Axes, t: Array, nu: Array, band: Array, show: Display, colour: str) -> None:
    """Limits by the band once settled and by nearly all innovations; those few beyond become arrows at the edge."""
    if not len(nu):
        return
    half = max(1.15 * float(np.quantile(np.abs(nu), 0.99, method="lower")), 1.6 * float(np.median(band))) * show.factor
    if half > 0:
        ax.set_ylim(-half, half)
        for sign, marker in ((1, "^"), (-1, "v")):
            beyond = sign * nu * show.factor > half
            ax.plot(t[beyond], np.full(beyond.sum(), 0.95 * sign * half), marker, ms=4, color=colour)


def residuals(ax: Axes, estimate: Estimate, column: int = 0, *, name: str = "estimate") -> Axes:
    """One component of z - h(mean) against time, within 3 sigma of the measurement noise; angles wrap into (-pi, pi].

    Unlike innovations they are taken at the estimate, which has used the measurement: they are a little smaller than the noise.
    """
    left, sigma = residuals_of(estimate)
    label, unit = component_of(estimate.problem, column)
    rows = np.flatnonzero(np.isfinite(left[:, column]))
    rows = rows[drawn(len(rows))]
    band = SIGMAS * sigma[rows, column]
    show = display_of(unit, [float(np.median(band)) if len(rows) else 0.0])
    time = time_axis(ax, estimate.times, estimate.epoch)
    t = estimate.tracking.row_times[rows] * time.factor
    colour = shade_of(name)
    ax.fill_between(t, -band * show.factor, band * show.factor, color=colour, alpha=0.15, lw=0, label="3 sigma of the noise")
    ax.plot(t, left[rows, column] * show.factor, ".", ms=2.5, color=colour, label=plain(name))
    ax.axhline(0, color=MEASURED, lw=0.7)
    limit(ax, t, left[rows, column], band, show, colour)
    ax.set_ylabel(show.label(f"residual of {plain(label)}"))
    return ax


def residuals_of(estimate: Estimate) -> tuple[Array, Array]:
    """z - h(mean), on the sky where the noise is, and the standard deviations of that, (J, m) each, NaN where nothing is."""
    problem, tracking = estimate.problem, estimate.tracking
    z = tracking.padded(problem.model.width)
    left, sigma = np.full(z.shape, np.nan), np.full(z.shape, np.nan)
    stations = tracking.stations_of(problem)
    epoch = np.repeat(np.arange(len(tracking.times)), np.diff(tracking.first_row))
    for s, station in enumerate(problem.stations):
        sensor, rows = problem.model.sensor(station.sensor), np.flatnonzero(stations == s)
        if not len(rows):
            continue
        h = problem.measure(station.name, estimate.mean[epoch[rows]], tracking.row_times[rows])
        difference = z[rows, : sensor.width] - h
        for i, component in enumerate(sensor.components):
            if component in sensor.angles:
                difference[:, i] = np.pi - np.mod(np.pi - difference[:, i], 2 * np.pi)
        for i, partner in enumerate(sensor.circle):
            if partner is not None:
                beside = z[rows, partner]
                difference[:, i] *= np.cos(np.where(np.isnan(beside), h[:, partner], beside))
        left[rows, : sensor.width] = difference
        sigma[rows, : sensor.width] = np.sqrt(np.diagonal(station.noise))
    return left, np.where(np.isnan(left), np.nan, sigma)
