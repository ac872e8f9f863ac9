"""The estimate itself: its last values, its states over time, and what was measured."""

from __future__ import annotations

import numpy as np

from piazzi.evaluate.quantities import Display, display_of, displays, duration, with_sigma
from piazzi.present.colours import station_colour
from piazzi.present.figures.measured import kinds_of, residuals_of
from piazzi.present.report.blocks import Axis, Chart, Line, Section, Table
from piazzi.present.report.panels import SIGMAS, rows_of, sigmas_of
from piazzi.present.report.views import Thinning, Views
from piazzi.problem.checks import Array

MOST_ROWS = 200_000  # times estimators, of which residuals are computed
_STATES = "States and constants of the estimator looked at closely, with three sigma on both sides."
_MEASURED = "Measurements as they came, in the colour of the station; residuals are what the estimate looked at closely leaves."


def answer(views: Views) -> Section:
    """Last values with their sigmas."""
    return Section("The estimate", [_last(views)])


def over_time(views: Views) -> Section:
    """States and constants over time."""
    charts = [_over_time(views, i) for i in range(len(views.comparison.problem.model.names))]
    return Section("States over time", charts, _STATES, folded=True)


def measured(views: Views) -> Section:
    """Measurements and, where they are cheap to compute, residuals."""
    problem, tracking = views.comparison.problem, views.comparison.tracking
    values = tracking.padded(problem.model.width)
    left = None
    if len(values) * len(views.estimates) <= MOST_ROWS and not problem.functions:  # which Python calls row by row
        left = [residuals_of(e)[0] for e in views.estimates]
    charts = []
    for column in range(problem.model.width):
        for (name, unit), stations in kinds_of(problem, column).items():
            charts.append(_values(views, values[:, column], name, unit, stations))
            if left is not None:
                charts.append(_residuals(views, [one[:, column] for one in left], name, unit, stations))
    return Section("Measurements and residuals", charts, _MEASURED, folded=True)


def _last(views: Views) -> Table:
    model, rows = views.comparison.problem.model, []
    ends = np.array([e.mean[-1] for e in views.estimates]).T.tolist()
    shows = displays([model.unit(name) for name in model.names], ends, model.group_indices.values())
    for i, (name, show) in enumerate(zip(model.names, shows, strict=True)):
        last = [(float(e.mean[-1, i]), float(sigmas_of(e)[-1, i])) for e in views.estimates]
        cells = [" ± ".join(with_sigma(value * show.factor, sigma * show.factor)) for value, sigma in last]
        rows.append((name, *cells, show.unit))
    when = duration(float(views.comparison.tracking.times[-1] - views.comparison.tracking.times[0]))
    heads = [("", ""), *((key.label, "") for key in views.keys), ("unit", "")]
    return Table(heads, rows, caption=f"At the last measurement, {when} after the first: value ± sigma")


def _over_time(views: Views, i: int) -> Chart:
    model = views.comparison.problem.model
    name, thin = model.names[i], views.thin
    lines, sizes, low, high = [], [], [], []
    for key, e in enumerate(views.estimates):
        mean, sigma = e.mean[:, i], sigmas_of(e)[:, i]
        middle = thin.at_places(mean)
        lines.append(Line(views.times, thin.at_places(sigma), "3 sigma", key, "band", SIGMAS, about=middle))
        lines.append(Line(views.times, middle, "estimate", key))
        sizes.append(float(np.nanmax(np.abs(mean), initial=0.0)))
        late = slice(len(mean) // 20, None)  # a prior may be wider than all that follows
        low.append(float(np.nanmin((mean - SIGMAS * sigma)[late], initial=np.inf)))
        high.append(float(np.nanmax((mean + SIGMAS * sigma)[late], initial=-np.inf)))
    show = display_of(model.unit(name), sizes)
    bottom, top = min(low), max(high)
    ends = (None, None) if not np.isfinite([bottom, top]).all() or bottom >= top else (bottom, top)
    return Chart(f"{name} over time", views.axis, Axis(name, show, low=ends[0], high=ends[1]), lines, single=True)


def _values(views: Views, values: Array, name: str, unit: str, stations: list[int]) -> Chart:
    problem, tracking = views.comparison.problem, views.comparison.tracking
    index, lines, size = tracking.stations_of(problem), [], 1
    for s in stations:
        rows = np.flatnonzero((index == s) & np.isfinite(values))
        if len(rows):
            thin = Thinning(len(rows))
            size = max(size, thin.size)
            times = thin.at_places(tracking.row_times[rows])
            line = Line(times, thin.extremes(values[rows]), problem.stations[s].name, kind="points", colour=station_colour(s))
            lines.append(line)
    show = display_of(unit, [float(np.nanmax(np.abs(values), initial=0.0))])
    note = f"Of every {size:,} the smallest and the largest are drawn." if size > 1 else ""
    return Chart(f"Measurements of {name}", views.axis, Axis(name, show), lines, note=note)


def _residuals(views: Views, left: list[Array], name: str, unit: str, stations: list[int]) -> Chart:
    lines, typical = [], []
    for key, values in enumerate(left):
        for station, rows in rows_of(views, stations):
            own = rows[np.isfinite(values[rows])]
            if len(own):
                thin = Thinning(len(own))
                times = thin.at_places(views.comparison.tracking.row_times[own])
                lines.append(Line(times, thin.extremes(values[own]), f"residual{station}", key, "points"))
                typical.append(float(np.sqrt(np.mean(values[own] ** 2))))
    show = display_of(unit, typical) if typical else Display(unit)
    half = 4.0 * max(typical, default=0.0) or 1.0
    return Chart(
        f"Residuals of {name}", views.axis, Axis(f"residual of {name}", show, low=-half, high=half), lines, single=True
    )
