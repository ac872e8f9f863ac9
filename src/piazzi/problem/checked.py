"""Each part of a problem, checked against its model: what is given as the user likes comes out as everything else expects it.

Raises ValueError for wrong shapes, values that are not finite, and names that are missing or unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.kernels import Discrete, Integrator, RungeKutta4
from piazzi.model import Model
from piazzi.model.functions import STATION_TABLE
from piazzi.problem import outside
from piazzi.problem.checks import covariance, finite_vector, frozen, numeric
from piazzi.problem.parts import Gaussian, ProcessNoise, Station
from piazzi.text import nearest, suggest


def prior(given: Gaussian, model: Model) -> Gaussian:
    """The belief about the states."""
    states = model.states
    mean = finite_vector(given.mean, len(states), "prior mean", states)
    return Gaussian(mean, covariance(given.covariance, len(states), "prior covariance", states))


def process_noise(given: Any, model: Model) -> ProcessNoise:
    """Process noise of everything estimated, from a matrix of the states too."""
    states, names = model.states, model.names
    noise = given if isinstance(given, ProcessNoise) else ProcessNoise(np.zeros(len(states)) if given is None else given)
    if model.discrete and noise.is_integral:
        noise = replace(noise, per="second" if given is None else noise.per, method="scaled")
    whole = np.shape(noise.covariance)[:1] == (len(names),) and len(names) > len(states)
    matrix = covariance(noise.covariance, len(names if whole else states), "process noise Q", names if whole else states)
    full = np.zeros((len(names), len(names)))
    full[: len(matrix), : len(matrix)] = matrix
    if noise.axes == "orbit":
        from piazzi.problem.two_body import check_orbit_axes

        check_orbit_axes(model)
    return replace(noise, covariance=frozen(full))


def stations(given: Sequence[Station], model: Model) -> tuple[Station, ...]:
    """Stations with R as a matrix, and the numbers that their sensors use in alphabetical order."""
    out: list[Station] = []
    for station in given:
        sensor = model.sensor(station.sensor)
        if any(station.name == other.name for other in out):
            raise ValueError(f"two stations are called {station.name!r}")
        what = f"measurement noise R of station {station.name!r}"
        noise = covariance(station.noise, sensor.width, what, sensor.components, definite=True)
        out.append(replace(station, noise=noise, numbers=_numbers(station, model)))
    tables = outside.station_numbers(model, [s.place for s in out])
    numbers = [dict(sorted({**s.numbers, **table}.items())) for s, table in zip(out, tables, strict=True)]
    return tuple(replace(s, numbers=own) for s, own in zip(out, numbers, strict=True))


def _numbers(station: Station, model: Model) -> dict[str, float]:
    wanted = model.numbers(model.sensor(station.sensor))
    if STATION_TABLE in wanted and station.place is None:
        raise ValueError(f"station {station.name!r} has no place, which its sensor {station.sensor!r} needs: give place=")
    if STATION_TABLE in wanted:
        wanted = tuple(name for name in wanted if name != STATION_TABLE)
        station = replace(station, numbers={k: v for k, v in station.numbers.items() if k != STATION_TABLE})
    for name in station.numbers:
        if name not in wanted:
            raise ValueError(
                f"station {station.name!r} gives {name!r}, which sensor {station.sensor!r} does not use{nearest(name, wanted)}"
            )
    for name in wanted:
        if name not in station.numbers:
            near = suggest(name, [*station.numbers, *model.states, *model.parameter_names])
            raise ValueError(
                f"station {station.name!r} gives no value for {name!r}, which sensor {station.sensor!r} uses{near}"
            )
    return {name: _number(station.numbers[name], f"{name!r} of station {station.name!r}") for name in wanted}


def parameters(given: Mapping[str, Any], model: Model) -> dict[str, Any]:
    """A number for each parameter that is fixed, else a belief."""
    known = {p.name: p for p in model.parameters}
    for name in given:
        if name not in known:
            raise ValueError(f"unknown parameter {name!r}{nearest(name, known)}")
    return {name: _parameter(name, known[name].role, given) for name in known}


def _parameter(name: str, role: str, values: Mapping[str, Any]) -> Any:
    if name not in values:
        raise ValueError(f"parameter {name!r} has no value")
    given = values[name]
    if role == "fixed":
        return _number(given, f"parameter {name!r}")
    if not isinstance(given, Gaussian):
        raise ValueError(f"parameter {name!r} is {role}: give Gaussian(mean, variance), not {given!r}")
    mean = finite_vector(given.mean, 1, "parameter mean", [name])
    return Gaussian(mean, covariance(given.covariance, 1, "parameter variance", [name]))


def integrator(given: Integrator | None, model: Model) -> Integrator:
    """The integrator, or the usual one of the model."""
    if given is None:
        return Discrete() if model.discrete else RungeKutta4()
    if model.discrete != isinstance(given, Discrete):
        kind = "a step, x[k+1]: use Discrete()" if model.discrete else "continuous: Discrete() does not apply"
        raise ValueError(f"integrator {type(given).__name__} does not fit: the model is {kind}")
    return given


def _number(value: Any, what: str) -> float:
    out = numeric(value, what)
    if out.size != 1 or not np.isfinite(out).all():
        raise ValueError(f"{what} is {value!r}; it must be one finite number")
    return float(out.reshape(-1)[0])
