"""The problem as it really is, where that differs from what estimators assume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from piazzi.model import Model, Parameter
from piazzi.model.pruning import remaining
from piazzi.problem.checks import numeric
from piazzi.problem.parts import Gaussian, Station, Truth
from piazzi.problem.problem import Problem
from piazzi.text import nearest


def true_problem(problem: Problem) -> Problem:
    """The problem as it really is: with the physics, parameters, process noise and integrator of its `truth` half.

    Raises
    ------
    ValueError
        For a truth that does not fit the problem.
    """
    truth = problem.truth
    if truth is None:
        return problem
    parameters = dict(problem.parameters)
    for name, value in truth.parameters.items():
        number = float(numeric(value, f"true value of parameter {name!r}"))
        parameters[name] = Gaussian(number, 0.0) if isinstance(parameters.get(name), Gaussian) else number
    return replace(
        problem,
        model=_true_model(problem.model, truth),
        parameters=parameters,
        stations=_true_stations(problem.stations, truth),
        functions={**problem.functions, **truth.functions},
        process_noise=truth.process_noise or problem.process_noise,
        integrator=truth.integrator or problem.integrator,
        manoeuvres=problem.manoeuvres if truth.manoeuvres is None else truth.manoeuvres,
        truth=None,
    )


def _true_model(model: Model, truth: Truth) -> Model:
    """The model with other equations of motion; itself where they are the same."""
    if not (truth.dynamics or truth.definitions):
        return model
    for state in truth.dynamics:
        if state not in model.states:
            raise ValueError(f"the truth has an equation for {state!r}, which is not a state{nearest(state, model.states)}")
    rates: Any = {state: truth.dynamics.get(state, text) for state, text in zip(model.states, model.dynamics, strict=True)}
    own = {left: str(text) for left, text in truth.definitions.items()}
    seen = [name for sensor in model.sensors for name in sensor.free_names]
    users = [*map(str, rates.values()), *seen, *(name for _, name in model.events)]
    definitions: Any = remaining(model.definitions, own, users)
    further = [Parameter(name) for name in truth.parameters if name not in model.parameter_names]
    kept: dict[str, Any] = {name: dict(getattr(model, name)) for name in ("groups", "units", "memory")}
    return replace(
        model,
        dynamics=rates,
        definitions=definitions,
        parameters=(*model.parameters, *further),
        functions={**dict(model.functions), **truth.functions},
        **kept,
    )


def _true_stations(stations: Sequence[Station], truth: Truth) -> list[Station]:
    """The stations with their true numbers, where they really are."""
    names = [station.name for station in stations]
    for name in (*truth.stations, *truth.places):
        if name not in names:
            raise ValueError(f"the truth has numbers or a place of {name!r}, which is no station{nearest(name, names)}")
    return [
        replace(s, numbers={**s.numbers, **truth.stations.get(s.name, {})}, place=truth.places.get(s.name, s.place))
        for s in stations
    ]
