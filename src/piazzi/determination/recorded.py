"""A file of tracking as what a scenario measures: it takes the place of times, sensors and measurements."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from piazzi.determination.partners import partners_of, with_partners
from piazzi.determination.sensing import Measured, measured, of_object
from piazzi.earth import Epoch
from piazzi.estimate.prior import with_prior_at
from piazzi.formats import read_tracking
from piazzi.model import Parameter
from piazzi.model.pruning import remaining
from piazzi.orbit.interpolation import interpolated
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.scenarios import Recording, ScenarioError
from piazzi.scenarios.loader import read_scenario, tables_of
from piazzi.scenarios.orbit_prior import KEYS
from piazzi.scenarios.scenario import read_recording
from piazzi.scenarios.table import Faults, Table
from piazzi.units import Units

START_SIGMA = (1e3, 1e3, 1e3, 10.0, 10.0, 10.0)  # m and m/s, of a start from positions
NEAR = 9  # positions that it is made of


def recorded(path: str | os.PathLike[str], scenario: str | os.PathLike[str], said: Recording) -> tuple[Problem, Tracking]:
    """The problem of a scenario, measured as a file of tracking says.

    The scenario's [earth] (or other equations of states x, y, z, vx, vy, vz), numbers, noise, integrator and prior hold; its
    times, sensors, stations and truth give way.  Without a prior, or with one that has a sigma only, positions give the start.

    Parameters
    ----------
    path : a file that `read_tracking` knows
    scenario : name or path
    said : object, standard deviations and files of stations

    Raises
    ------
    OSError
        Where a file cannot be read.
    ValueError
        For what is wrong in either, or open.
    """
    tables, faults = tables_of(scenario)
    usual = _recording(tables)
    words = {name: getattr(said, name) or getattr(usual, name) for name in ("sigma", "columns", "scale", "frame")}
    answers = {**usual.answers, **said.answers, **{name: word for name, word in words.items() if word}}
    partners = partners_of(said.participants or usual.participants or None)
    observations = of_object(with_partners(read_tracking(path, **answers), partners), said.chosen or usual.chosen)
    stations = list(said.stations or usual.stations) or None
    seen = partial(
        measured, observations, stations, corrections=answers.get("corrections"), epoch=_epoch(tables), partners=partners
    )
    found = seen()
    name = os.path.basename(os.fspath(scenario)).removesuffix(".toml")
    read = None if faults else read_scenario(_with_measurements(tables, found, os.fspath(path)), name, faults)
    if read is None:
        raise ScenarioError(os.fspath(scenario), list(faults))
    eop = getattr(read.problem.functions.get("fixed"), "eop", None)
    if eop is not None:
        found = seen(eop=eop)
    problem = _measuring(read.problem, found)
    tracking = found.tracking
    first = float(tracking.times[0])
    if problem.prior_time is not None and problem.prior_time > first:
        problem = with_prior_at(problem, first)
    return problem, tracking


def _recording(tables: Mapping[str, Any]) -> Recording:
    """What the scenario says of recordings, as far as it is sound; the rest is found when it is read."""
    given = tables.get("recording")
    return read_recording(Table(given if isinstance(given, Mapping) else {}, "recording", Faults()))


def _epoch(tables: Mapping[str, Any]) -> Epoch | None:
    """The epoch that the scenario says, None where it says none."""
    return Epoch(tables["epoch"]) if isinstance(tables.get("epoch"), str) else None


def _with_measurements(tables: Mapping[str, Any], found: Measured, path: str) -> dict[str, Any]:
    """The tables with the file's times, no stations, and a start where they have none."""
    units = Units.parse(tables["units"]) if isinstance(tables.get("units"), str) else Units()
    out = {key: value for key, value in tables.items() if key not in ("stations", "sensors", "truth", "study", "times")}
    out["epoch"] = found.epoch.exact()
    times = found.tracking.times
    out["times"] = {"list": [float(times[0]) / units.time()]}
    out["stations"] = []
    prior = tables.get("prior", {})
    usual = tables.get("times", {})
    if isinstance(prior, Mapping) and "mean" not in prior and not any(key in prior for key in KEYS):
        state = _start(found, path)
        factors = [units.length()] * 3 + [units.length() / units.time()] * 3
        spread = (
            {} if any(key in prior for key in ("sigma", "variance", "covariance")) else {"sigma": _list(START_SIGMA, factors)}
        )
        out["prior"] = {**prior, **spread, "mean": _list(state, factors), "time": float(times[0]) / units.time()}
    elif isinstance(prior, Mapping) and "time" not in prior and isinstance(usual, Mapping) and "start" in usual:
        out["prior"] = {**prior, "time": usual["start"]}
    stands = out.get("prior", {}).get("time") if isinstance(prior, Mapping) else None
    if isinstance(stands, int | float):  # a prior later than the file begins is propagated back to it
        out["times"] = {"list": [max(float(times[0]) / units.time(), float(stands))]}
    return out


def _list(values: Any, factors: list[float]) -> list[float]:
    return (np.asarray(values, dtype=float) / factors).tolist()  # type: ignore[no-any-return]


def _start(found: Measured, path: str) -> Array:
    """Position and velocity (6,) at the first row: of a polynomial through the first positions."""
    sensors = {sensor.name: sensor for sensor in found.sensors}
    places = {s.name for s in found.stations if sensors[s.sensor].equations[:3] == ("x", "y", "z")}
    rows = np.array([name in places for name in _names(found)])[: len(found.tracking.row_times)]
    t, first = np.unique(found.tracking.row_times[rows], return_index=True)
    if len(t) < 3 or not rows[0]:
        raise ValueError(f"{path}: the scenario has no [prior], and only a file of positions gives a start by itself")
    near = slice(0, min(NEAR, len(t)))
    position = found.tracking.values[rows][first][near, :3]
    v = interpolated(t[near], position, None, t[:1], len(position) - 1).v[0]
    return np.concatenate([position[0], v])


def _names(found: Measured) -> list[str]:
    named = found.tracking.row_stations
    return [found.stations[0].name] * len(found.tracking.row_times) if named is None else [str(name) for name in named]


def _measuring(problem: Problem, found: Measured) -> Problem:
    """The problem with the sensors and stations of what was measured."""
    model = problem.model
    if not {"x", "y", "z", "vx", "vy", "vz"} <= {*model.states}:
        raise ValueError(
            "files of tracking measure orbits: the scenario's states must be x, y, z, vx, vy, vz, as [earth] makes them"
        )
    seen = [name for sensor in found.sensors for name in sensor.free_names]
    own = {p.name for p in model.parameters}
    more = [Parameter(name, role) for name, (role, _) in found.parameters.items() if name not in own]  # type: ignore[arg-type]
    kept: dict[str, Any] = {name: dict(getattr(model, name)) for name in ("groups", "units", "memory")}
    definitions: Any = remaining(model.definitions, {}, [*model.dynamics, *seen, *(name for _, name in model.events)])
    measuring = replace(
        model,
        sensors=found.sensors,
        parameters=(*model.parameters, *more),
        definitions=definitions,
        functions={**dict(model.functions), **found.functions},
        **kept,
    )
    return replace(
        problem,
        model=measuring,
        stations=found.stations,
        parameters={**{name: value for name, (_, value) in found.parameters.items()}, **problem.parameters},
        functions={**problem.functions, **found.functions},
        truth=None,
    )
