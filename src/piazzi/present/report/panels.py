"""Charts of a comparison: errors, innovations, consistency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.metrics import groups
from piazzi.evaluate.quantities import Display, display_of, unit_of
from piazzi.present.colours import DASHES, STATIONS
from piazzi.present.figures.measured import SHORTEST, kinds_of
from piazzi.present.report.blocks import Axis, Chart, Line
from piazzi.present.report.views import Thinning, Views
from piazzi.present.squares import Squares, nees_of, nis_of
from piazzi.problem.checks import Array
from piazzi.problem.gaps import in_passes

Shown = Array | tuple[Array, ...]  # what a page is given for a line
INK = "var(--ink)"  # the colour of letters, in light and in dark
_WORDS = {"realtime": "real time", "delayed": "delayed"}
SIGMAS = 3.0
_MOST_STATIONS = 6
_WILD = 4.5  # sigmas from which an innovation is always drawn: one in 150,000 where the model holds
_BENT = 30.0  # a scale is logarithmic where values span more than this factor


def sigmas_of(estimate: Estimate) -> Array:
    """Standard deviations, (K, n)."""
    with np.errstate(invalid="ignore"):
        out: Array = np.sqrt(np.maximum(np.diagonal(estimate.covariance, axis1=1, axis2=2), 0.0))
    return out


def group_charts(views: Views) -> list[Chart]:
    """For each group of states the length of the error, and what the covariance expects of it, of every estimator."""
    first, model = views.estimates[0], views.comparison.problem.model
    out = []
    for group, columns in groups(first).items():
        unit = unit_of(model.unit(model.names[c]) for c in columns)
        expected = [_expected(views, e, columns) for e in views.estimates]
        error = [] if views.truth is None else [_length(views, e, columns, views.truth) for e in views.estimates]
        show = display_of(unit, [_typical(y) for _, y in (*expected, *error)])
        low, high = _log_limits([y for _, y in (*expected, *error)])
        y_axis = Axis(f"{group} error", show, "log", low, high)
        if error:
            out.append(_overlay(views, f"Error of {group}", y_axis, error, f"{group} error"))
        y_axis = Axis(f"expected {group} error", show, "log", low, high)
        title = f"Expected error of {group} (1 sigma)"
        out.append(_overlay(views, title, y_axis, expected, f"{group} 1 sigma", _best_possible(views, columns)))
    return out


def _best_possible(views: Views, columns: Sequence[int]) -> list[Line]:
    """Cramer-Rao bounds of the length of the error, for each view that there is."""
    out = []
    kinds = dict.fromkeys(view for _, view in views.found)
    for view in kinds if views.bounds is not None else ():
        assert views.bounds is not None
        variances = np.diagonal(views.bounds.of(view), axis1=1, axis2=2)[:, list(columns)]
        label = f"best possible{', ' + _WORDS[view] if len(kinds) > 1 else ''} (Cramer-Rao)"
        values = views.thin.extremes(np.sqrt(np.maximum(variances.sum(axis=1), 0.0)))
        out.append(Line(views.times, values, label, colour=INK, dash=DASHES[2 if view == "realtime" else 3]))
    return out


def _overlay(
    views: Views, title: str, y: Axis, found: Sequence[tuple[Shown, Array]], column: str, more: Sequence[Line] = ()
) -> Chart:
    lines = [Line(views.times, shown, key.label, i) for i, (key, (shown, _)) in enumerate(zip(views.keys, found, strict=True))]
    return Chart(title, views.axis, y, [*lines, *more], note=views.note(), column=column)


def _expected(views: Views, estimate: Estimate, columns: Sequence[int]) -> tuple[Shown, Array]:
    return _norm(views, sigmas_of(estimate)[:, list(columns)])


def _length(views: Views, estimate: Estimate, columns: Sequence[int], truth: Array) -> tuple[Shown, Array]:
    return _norm(views, (estimate.mean - truth)[:, list(columns)])


def _norm(views: Views, parts: Array) -> tuple[Shown, Array]:
    """What the page gets for the length of vectors (K, g), and the length itself: their parts, where it has them anyway."""
    with np.errstate(over="ignore", invalid="ignore"):
        length: Array = np.sqrt((parts**2).sum(axis=1))
    return (tuple(parts.T) if views.thin.size == 1 else views.thin.extremes(length)), length


def _typical(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.median(good)) if good.size else 0.0


def _log_limits(series: Sequence[Array]) -> tuple[float, float]:
    """Limits that hold all but the smallest half per cent."""
    good = np.concatenate([s[np.isfinite(s) & (s > 0)] for s in series]) if series else np.empty(0)
    if not good.size:
        return 0.1, 10.0
    low, high = float(np.quantile(good, 0.005)), float(good.max())
    return low / 1.3, max(high * 1.3, low * 2)


def state_charts(views: Views) -> list[Chart]:
    """For each state the error within three sigma of the estimator looked at closely."""
    model, out = views.comparison.problem.model, []
    for i, state in enumerate(model.names):
        sizes, lines = [], []
        for key, estimate in enumerate(views.estimates):
            sigma = sigmas_of(estimate)[:, i]
            lines.append(Line(views.times, views.thin.extremes(sigma), "3 sigma", key, "band", SIGMAS))
            sizes.append(SIGMAS * sigma)
            if views.truth is not None and not np.isnan(views.truth[:, i]).all():
                error = estimate.mean[:, i] - views.truth[:, i]
                lines.append(Line(views.times, views.thin.extremes(error), "error", key))
                sizes[-1] = np.fmax(sizes[-1], np.abs(error))
        show = display_of(model.unit(state), [_typical(s) for s in sizes])
        out.append(Chart(f"Error of {state}", views.axis, _about_zero(f"error of {state}", show, sizes), lines, single=True))
    return out


def _about_zero(label: str, show: Display, sizes: Sequence[Array]) -> Axis:
    """An axis that holds these sizes on both sides of zero, logarithmic further out where they shrink a lot."""
    good = [g for g in (s[np.isfinite(s) & (s > 0)] for s in sizes) if g.size]
    if not good:
        return Axis(label, show, low=-1.0 / show.factor, high=1.0 / show.factor)
    largest = max(float(g.max()) for g in good)
    settled = min(float(np.median(g[len(g) // 2 :])) for g in good)
    bent = largest > _BENT * settled
    return Axis(label, show, "symmetric" if bent else "linear", -1.15 * largest, 1.15 * largest, settled if bent else 0.0)


def passes(views: Views) -> Chart | None:
    """When each station measured, where there are passes to tell apart."""
    problem, tracking = views.comparison.problem, views.comparison.tracking
    found, names = in_passes(problem, tracking), [s.name for s in problem.stations]
    if not found:
        return None
    least = SHORTEST * float(tracking.times[-1] - tracking.times[0])
    lines = []
    for s, name in enumerate(names):
        ends = [(one.start, max(one.stop, one.start + least)) for one in found if one.station == name]
        x = np.array([t for start, stop in ends for t in (start, stop, stop)])
        y = np.tile([float(s), float(s), np.nan], len(ends))
        lines.append(Line(x, y, name, kind="spans", colour=STATIONS[s % len(STATIONS)]))
    y_axis = Axis("station", Display(""), low=-0.6, high=len(names) - 0.4)
    levels = [(float(s), name) for s, name in enumerate(names)]
    return Chart("Passes", views.axis, y_axis, [line for line in lines if len(line.x)], levels=levels)


def innovations(views: Views) -> list[Chart]:
    """For each kind of measurement the innovations of the estimator looked at closely, within three sigma, by station."""
    problem = views.comparison.problem
    kinds = [(column, *kind) for column in range(problem.model.width) for kind in kinds_of(problem, column).items()]
    return [_innovation(views, column, name, unit, stations) for column, (name, unit), stations in kinds]


def _innovation(views: Views, column: int, name: str, unit: str, stations: Sequence[int]) -> Chart:
    bands, points, ends = [], [], []
    parts = rows_of(views, stations)
    every = np.concatenate([rows for _, rows in parts]) if parts else np.empty(0, dtype=int)
    for key, e in enumerate(views.estimates):
        nu, S = e.innovations[:, column], e.innovation_covariances[:, column, column]
        sigma = np.sqrt(np.where(np.isnan(nu), np.nan, np.maximum(S, 0.0)))
        good = np.abs(nu[every][np.isfinite(nu[every])])
        most = 1.15 * float(np.quantile(good, 0.99)) if good.size else 0.0
        ends.append(max(1.6 * SIGMAS * _typical(sigma[every]), most))
        for station, rows in parts:
            if np.isnan(nu[rows]).all():
                continue
            thin = Thinning(len(rows))
            times = thin.at_places(views.comparison.tracking.row_times[rows])
            bands.append(Line(times, thin.extremes(sigma[rows]), f"3 sigma{station}", key, "band", SIGMAS))
            points.append(Line(times, thin.sample(nu[rows], _WILD * sigma[rows]), f"innovation{station}", key, "points"))
    half = max(ends, default=0.0) or 1.0
    y = Axis(f"innovation of {name}", display_of(unit, [half / 1.6]), low=-half, high=half)
    size = max((Thinning(len(rows)).size for _, rows in parts), default=1)
    note = f"Two of every {size:,} are drawn, and what is beyond {_WILD:g} sigma." if size > 1 else ""
    return Chart(f"Innovations of {name}", views.axis, y, [*bands, *points], single=True, note=note)


def rows_of(views: Views, stations: Sequence[int]) -> list[tuple[str, Array]]:
    """Rows of each of these stations with its name as labels end; all together for one, or too many to tell apart."""
    problem, tracking = views.comparison.problem, views.comparison.tracking
    index = tracking.stations_of(problem)
    found = [(f", {problem.stations[i].name}", np.flatnonzero(index == i)) for i in stations]
    found = [(name, rows) for name, rows in found if len(rows)]
    return found if 1 < len(found) <= _MOST_STATIONS else [("", np.flatnonzero(np.isin(index, stations)))]


def consistency(views: Views) -> list[Chart]:
    """NEES of every epoch, and NIS averaged over stretches, each with the range of 95 % of a matched run's values."""
    found = (nees_of(views.comparison) if views.truth is not None else None, nis_of(views.comparison))
    return [_squares(views, squares) for squares in found if squares is not None]


def _squares(views: Views, found: Squares) -> Chart:
    """Values against time with their expected mean and range, on a logarithmic scale."""
    thin = Thinning(len(found.times))
    bottom, top = _log_limits([*found.values, np.array([found.low, found.high])])
    shown = thin.at_places(found.times)
    lines = [Line(shown, thin.extremes(v), views.keys[i].label, i) for i, v in enumerate(found.values)]
    return Chart(
        f"{found.name[0].upper()}{found.name[1:]}, {found.ideal}",
        views.axis,
        Axis(found.name, Display(""), "log", max(bottom, 1e-2 * found.low), top),
        lines,
        levels=[(found.expected, "")],
        ranges=[(found.low, found.high, "")],
        note=f"Grey: 95 % of a matched run's values. {views.note(thin)}".strip(),
        column=found.name,
    )
