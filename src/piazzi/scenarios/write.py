"""A problem as the tables of a scenario file, in SI: for formats that keep a problem beside its measurements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piazzi.model import Model, Parameter, Sensor
from piazzi.model.definitions import Definition, Definitions
from piazzi.model.functions import ROOT, STATION_TABLE
from piazzi.problem import Gaussian, Problem, ProcessNoise, Schedule, Station, Truth
from piazzi.scenarios.earth_sensors import write_place
from piazzi.scenarios.functions import write_function
from piazzi.scenarios.loader import read_problem
from piazzi.scenarios.motion import write_integrator, write_manoeuvre
from piazzi.scenarios.table import Faults, ScenarioError, Table
from piazzi.units import Labels

SECTIONS = (
    "states", "memory", "groups", "functions", "events", "dynamics", "step", "parameters", "sensors", "stations", "prior",
    "process_noise", "integrator", "manoeuvres", "truth", "epoch",
)  # fmt: skip


def problem_to_tables(problem: Problem, *, whole: bool = True) -> dict[str, Any]:
    """Plain tables, lists, numbers and text that `problem_from_tables` reads back to the same problem, bit for bit.

    Not `whole`, data of functions from outside are told apart by checksums only, and cannot be read back.

    Raises
    ------
    ValueError
        For a problem that the tables cannot hold, such as one with an integrator that has no name.
    """
    assert problem.integrator is not None
    tables: dict[str, Any] = {
        **_equations(problem.model),
        "parameters": {p.name: _parameter(problem, p) for p in problem.model.parameters},
        "stations": [_station(s, whole) for s in problem.stations],
        "prior": {"mean": _listed(problem.prior.mean), "covariance": _listed(problem.prior.covariance)},
        "process_noise": _noise(problem.process_noise),
        "integrator": write_integrator(problem.integrator),
        "manoeuvres": [write_manoeuvre(m) for m in problem.manoeuvres],
    }
    if problem.functions:
        tables["functions"] = {name: write_function(f) for name, f in problem.functions.items()} if whole else problem.checksums
    if problem.epoch is not None:
        tables["epoch"] = problem.epoch.exact()
    if problem.prior_time is not None:
        tables["prior"]["time"] = float(problem.prior_time)
    if problem.truth is not None:
        tables["truth"] = _truth(problem.truth, whole)
    if whole:
        problem_from_tables(tables, problem.name, "the problem cannot be written to a file")
    return tables


def problem_from_tables(tables: Mapping[str, Any], name: str, source: str) -> Problem:
    """The problem that `problem_to_tables` wrote, checked like any file; raises ScenarioError with all faults."""
    faults = Faults()
    file = Table(tables, "", faults)
    with np.errstate(all="ignore"):
        problem = read_problem(file, name, Labels())
    file.finish(SECTIONS)
    if problem is None or faults:
        raise ScenarioError(source, list(faults))
    return problem


def _equations(model: Model) -> dict[str, Any]:
    return {
        "states": {s: model.unit(s) for s in model.states},
        "memory": dict(model.memory),
        "groups": {g: list(members) for g, members in model.groups},
        "definitions": _values(model.definitions),
        "roots": {d.names[0]: _root(d) for d in model.definitions if d.function == ROOT},
        **({"events": dict(model.events)} if model.events else {}),
        "step" if model.discrete else "dynamics": dict(zip(model.states, model.dynamics, strict=True)),
        "sensors": {s.name: _sensor(model, s) for s in model.sensors},
    }


def _sensor(model: Model, sensor: Sensor) -> dict[str, Any]:
    own = [name for name in model.numbers(sensor) if name != STATION_TABLE]
    taken = {*model.names, *(p.name for p in model.parameters)}  # biases of instruments stand among the parameters
    units = {name: unit for name, unit in sensor.number_units if name not in taken}
    beside = dict(sensor.on_sky)
    rows = zip(sensor.components, sensor.equations, sensor.is_angle, dict(sensor.units).values(), strict=True)
    return {
        **({"visible": list(sensor.visible)} if sensor.visible else {}),
        "numbers": dict.fromkeys(own, "") | units,
        "definitions": _values(sensor.definitions),
        "roots": {d.names[0]: _root(d) for d in sensor.definitions if d.function == ROOT},
        "components": {
            c: {"equation": e, "unit": unit, "angle": angle} | ({"on_sky": beside[c]} if c in beside else {})
            for c, e, angle, unit in rows
        },
    }


def _values(definitions: Definitions) -> dict[str, str]:
    """Those that are no roots."""
    return {", ".join(d.names): d.text for d in definitions if d.function != ROOT}


def _root(d: Definition) -> dict[str, Any]:
    return {
        "root": d.texts[0],
        "start": d.texts[1],
        "iterations": d.iterations,
        "definitions": _values(d.inner),
        "roots": {own.names[0]: _root(own) for own in d.inner if own.function == ROOT},
    }


def _parameter(problem: Problem, parameter: Parameter) -> dict[str, Any]:
    value, kind = problem.parameters[parameter.name], {"role": parameter.role, "unit": problem.model.unit(parameter.name)}
    if isinstance(value, Gaussian):
        return {"value": float(value.mean[0]), "variance": float(value.covariance[0, 0]), **kind}
    return {"value": float(value), **kind}


def _station(station: Station, whole: bool) -> dict[str, Any]:
    numbers = {k: float(v) for k, v in station.numbers.items() if k != STATION_TABLE}
    noise = {"covariance": _listed(station.noise)}
    out = {"name": station.name, "sensor": station.sensor, "noise": noise, "numbers": numbers, **_schedule(station.schedule)}
    if station.place is None:
        return out
    return out | {"place": write_place(station.place) if whole else station.place.checksum}


def _schedule(schedule: Schedule | None) -> dict[str, float]:
    said = {} if schedule is None else {"every": schedule.every, "from": schedule.start, "until": schedule.until}
    return {key: float(value) for key, value in said.items() if value is not None}


def _noise(noise: ProcessNoise) -> dict[str, Any]:
    key = "covariance" if np.ndim(noise.covariance) == 2 else "variance"
    return {key: _listed(noise.covariance), "per": noise.per, "method": noise.method, "axes": noise.axes}


def _truth(truth: Truth, whole: bool) -> dict[str, Any]:
    out: dict[str, Any] = {
        "parameters": {k: float(v) for k, v in truth.parameters.items()},
        "measurement_noise": bool(truth.measurement_noise),
    }
    for key, texts in (("dynamics", truth.dynamics), ("definitions", truth.definitions)):
        if texts:
            out[key] = {left: str(text) for left, text in texts.items()}
    if truth.functions:
        out["functions"] = {name: write_function(f) if whole else f.checksum for name, f in truth.functions.items()}
    if truth.stations or truth.places:
        stations: dict[str, Any] = {name: {k: float(v) for k, v in of.items()} for name, of in truth.stations.items()}
        for name, place in truth.places.items():
            stations.setdefault(name, {})["place"] = write_place(place) if whole else place.checksum
        out["stations"] = stations
    if truth.accept:
        out["accept"] = list(truth.accept)
    if truth.state is not None:
        out["state"] = _listed(truth.state)
    if truth.process_noise is not None:
        out["process_noise"] = _noise(truth.process_noise)
    if truth.integrator is not None:
        out["integrator"] = write_integrator(truth.integrator)
    if truth.manoeuvres is not None:
        out["manoeuvres"] = [write_manoeuvre(m) for m in truth.manoeuvres]
    return out


def _listed(value: Any) -> Any:
    return np.asarray(value, dtype=float).tolist()
