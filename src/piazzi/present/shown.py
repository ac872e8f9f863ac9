"""What notebooks show of problems and results, and the same tables as LaTeX."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

from piazzi.earth import Epoch
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.grids import Grid, as_html
from piazzi.evaluate.latex import as_latex
from piazzi.evaluate.quantities import displays, duration, fine, number, with_sigma
from piazzi.model import Model
from piazzi.present.study_table import columns, failures, heading
from piazzi.present.tables import residual_line, state_grid
from piazzi.problem import Problem, Station, Tracking
from piazzi.study import Stored, Summary
from piazzi.text import listed

_MOST = 40  # rows of a table
_LONGEST = 90  # characters of an equation
_SCALES = ("UTC", "TAI", "TT", "TDB")


def html(thing: Any) -> str:
    """Tables and sentences as HTML; all text is escaped."""
    return as_html(*_of(thing))


def latex(thing: Any) -> str:
    """The tables as LaTeX (booktabs)."""
    return as_latex(_of(thing)[0])


@singledispatch
def _of(thing: Any) -> tuple[list[Grid], list[str]]:
    raise TypeError(f"there is no table of a {type(thing).__name__}")


@_of.register(Epoch)
def _epoch(epoch: Epoch) -> tuple[list[Grid], list[str]]:
    scales = _SCALES if str(epoch).endswith("UTC") else _SCALES[1:]
    rows = [(scale, epoch.to(scale).rpartition(" ")[0]) for scale in scales]
    day, part = epoch.jd("TT")
    return [Grid("", ("scale", "date"), (*rows, ("JD, TT", f"{day + part:.8f}")), 2)], []


@_of.register(Model)
def _model(model: Model) -> tuple[list[Grid], list[str]]:
    left = "{}[k+1]" if model.discrete else "d{}/dt"
    moves = [(left.format(s), _short(text), model.unit(s)) for s, text in zip(model.states, model.dynamics, strict=True)]
    seen = [
        (sensor.name, name, _short(text), dict(sensor.units)[name])
        for sensor in model.sensors
        for name, text in zip(sensor.components, sensor.equations, strict=True)
    ]
    tables = Grid("", ("", "equation", "unit"), tuple(moves), 3), Grid("", ("sensor", "", "equation", "unit"), tuple(seen), 4)
    said = [f"Parameters: {listed(model.parameter_names, 20)}."] if model.parameters else []
    return _with_rows(*tables), said


@_of.register(Problem)
def _problem(problem: Problem) -> tuple[list[Grid], list[str]]:
    model, sigmas = problem.model, np.sqrt(np.maximum(np.diagonal(problem.covariance), 0.0))
    shows = displays([model.unit(n) for n in model.names], [[v] for v in problem.mean.tolist()], model.group_indices.values())
    rows = [
        (name, *with_sigma(mean * show.factor, sigma * show.factor), show.unit)
        for name, mean, sigma, show in zip(model.names, problem.mean.tolist(), sigmas.tolist(), shows, strict=True)
    ]
    stations = [(station.name, station.sensor, _noise(problem, station)) for station in problem.stations]
    when = "" if problem.epoch is None else f", past {problem.epoch}"
    title = f"{problem.name + ': ' if problem.name else ''}what is believed at t = {problem.prior_time or 0.0:g} s{when}"
    prior = Grid(title, ("", "value", "sigma", "unit"), tuple(rows))
    return _with_rows(prior, Grid("", ("station", "sensor", "sigma of the noise"), tuple(stations), 3)), []


@_of.register(Tracking)
def _tracking(tracking: Tracking) -> tuple[list[Grid], list[str]]:
    names = np.full(len(tracking.row_times), "") if tracking.row_stations is None else np.asarray(tracking.row_stations)
    missing, rows = np.isnan(tracking.values).all(axis=1), []
    for name in dict.fromkeys(names.tolist()):
        own = names == name
        ends = [_when(tracking, float(t)) for t in tracking.row_times[own][[0, -1]]]
        rows.append((name or "-", f"{int((own & ~missing).sum()):,}", f"{int((own & missing).sum()):,}", *ends))
    epochs = f"{len(tracking.times):,} epochs over {duration(float(np.ptp(tracking.times)))}"
    title = f"{len(tracking.row_times):,} rows, {epochs}, truth {'not ' if tracking.truth is None else ''}known"
    return _with_rows(Grid(title, ("station", "measured", "missing", "first", "last"), tuple(rows))), []


@_of.register(Estimate)
def _estimate(estimate: Estimate) -> tuple[list[Grid], list[str]]:
    said = [str(line) for line in residual_line(estimate)] + ([estimate.message] if estimate.message else [])
    return [state_grid(estimate.problem.name or "estimate", estimate)], said


@_of.register(Summary)
def _summary(summary: Summary) -> tuple[list[Grid], list[str]]:
    shown = columns(summary)
    words = next(i for i, column in enumerate(shown) if column.title == "view") + 1
    heads = tuple(f"{column.title}\n{column.unit}" if column.unit else column.title for column in shown)
    grid = Grid(heading(summary.stored), heads, tuple(zip(*(column.texts for column in shown), strict=True)), words)
    return [grid], failures(summary)


@_of.register(Stored)
def _stored(stored: Stored) -> tuple[list[Grid], list[str]]:
    return _summary(stored.summary)


def _with_rows(*grids: Grid) -> list[Grid]:
    """Those tables that have any, the first rows of long ones."""
    more = "... and {:,} more"
    cut = [
        g
        if len(g.rows) <= _MOST
        else replace(g, rows=(*g.rows[:_MOST], (more.format(len(g.rows) - _MOST), *[""] * (len(g.heads) - 1))))
        for g in grids
    ]
    return [grid for grid in cut if grid.rows]


def _short(equation: str) -> str:
    return equation if len(equation) <= _LONGEST else f"{equation[:_LONGEST]} ..."


def _when(tracking: Tracking, t: float) -> str:
    return f"{t:g} s" if tracking.epoch is None else (tracking.epoch + t).to(str(tracking.epoch).rpartition(" ")[2], digits=3)


def _noise(problem: Problem, station: Station) -> str:
    """Sigma of every component that a station measures, with its unit."""
    sensor = problem.model.sensor(station.sensor)
    units, parts = dict(sensor.units), []
    for name, variance in zip(sensor.components, np.diagonal(np.atleast_2d(station.noise)).tolist(), strict=False):
        show = fine(units[name], float(np.sqrt(variance)))
        parts.append(f"{name} {number(np.sqrt(variance) * show.factor, 3)}{show.suffix}")
    return ", ".join(parts)
