"""What is left of the measurements at the estimate itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from piazzi.estimate import Estimate
from piazzi.evaluate.quantities import display_of
from piazzi.present.figures.measured import SIGMAS, component_of, limit
from piazzi.present.figures.style import MEASURED, drawn, plain, shade_of, time_axis
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    time = time_axis(ax, estimate.times)
    t = estimate.tracking.row_times[rows] * time.factor
    colour = shade_of(name)
    ax.fill_between(t, -band * show.factor, band * show.factor, color=colour, alpha=0.15, lw=0, label="3 sigma of the noise")
    ax.plot(t, left[rows, column] * show.factor, ".", ms=2.5, color=colour, label=plain(name))
    ax.axhline(0, color=MEASURED, lw=0.7)
    limit(ax, t, left[rows, column], band, show, colour)
    ax.set_ylabel(show.label(f"residual of {plain(label)}"))
    return ax


def residuals_of(estimate: Estimate) -> tuple[Array, Array]:
    """z - h(mean) and the standard deviations of the noise, (J, m) each, NaN where there is no measurement."""
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
        left[rows, : sensor.width] = difference
        sigma[rows, : sensor.width] = np.sqrt(np.diagonal(station.noise))
    return left, np.where(np.isnan(left), np.nan, sigma)
