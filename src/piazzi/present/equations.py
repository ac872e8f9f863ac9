"""The equations of a problem as text: definitions, rates of the states, numbers, data, sensors, and what is true instead."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from piazzi.problem import Gaussian, Problem, Truth


def equations(problem: Problem) -> str:
    """All equations that result, one a line, sorted by what they need."""
    return "\n".join(_lines(problem)) + "\n"


def _lines(problem: Problem) -> Iterator[str]:
    model = problem.model
    if model.definitions:
        yield from ("# what is defined", *(f"{names} = {text}" for names, text in model.definitions), "")
    yield "# the next state" if model.discrete else "# rates of the states"
    for state, text in zip(model.states, model.dynamics, strict=True):
        left = f"{state}[k+1]" if model.discrete else f"d{state}/dt"
        unit = model.unit(state)
        yield f"{left} = {text}" + (f"    # {state} in {unit}" if unit else "")
    if model.events:
        yield from ("", "# steps end where", *(f"{definition} = 0    # {event}" for event, definition in model.events))
    if model.parameters:
        yield from ("", "# numbers")
        yield from (_number(problem, parameter) for parameter in model.parameters)
    if problem.functions:
        yield from ("", "# functions from outside")
        yield from (f"{name}: {_told(recipe)}" for name, recipe in problem.functions.items())
    for sensor in model.sensors:
        yield from ("", f"# sensor {sensor.name}")
        yield from (f"{', '.join(d.names)} = {d.text}" for d in sensor.definitions)
        units = dict(sensor.units)
        for name, text in zip(sensor.components, sensor.equations, strict=True):
            yield f"{name} = {text}" + (f"    # {units[name]}" if units.get(name) else "")
        yield from (f"seen where 0 < {rule}" for rule in sensor.visible)
    if problem.truth is not None:
        yield from _differences(problem.truth)


def _number(problem: Problem, parameter: Any) -> str:
    value, unit = problem.parameters[parameter.name], parameter.unit
    if isinstance(value, Gaussian):
        text = f"{value.mean[0]:.9g} +- {value.covariance[0, 0] ** 0.5:.3g}"
        return f"{parameter.name} = {text} {unit}".rstrip() + f", {parameter.role}"
    return f"{parameter.name} = {value:.9g} {unit}".rstrip()


def _told(recipe: Any) -> str:
    """What the data of a function are."""
    kind = type(recipe).__name__
    if kind == "Gravity":
        degrees = f"to degree {recipe.degree}, its gradient to {recipe.gradient_degree}"
        return f"gravity of {recipe.field.name} ({recipe.field.source}) {degrees}"
    if kind == "Rotation":
        return f"rotation from {recipe.from_} to {recipe.to}"
    if kind == "Body":
        return f"place of {recipe.name}, {'by series' if recipe.kernel is None else f'from {recipe.kernel}'}"
    return kind if recipe.span is None else f"{kind}, t from {recipe.span[0]:g} to {recipe.span[1]:g} s"


def _differences(truth: Truth) -> Iterator[str]:
    parts: list[tuple[str, Mapping[str, Any]]] = [("", truth.definitions), ("d{}/dt", truth.dynamics)]
    lines = [f"{(form or '{}').format(left)} = {text}" for form, of in parts for left, text in of.items()]
    lines += [f"{name} = {value:.9g}" for name, value in truth.parameters.items()]
    lines += [f"{name}: {_told(recipe)}" for name, recipe in truth.functions.items()]
    lines += [f"{key} of {name} = {value:.9g}" for name, numbers in truth.stations.items() for key, value in numbers.items()]
    lines += [f"station {name} stands elsewhere" for name in truth.places]
    if lines:
        yield from ("", "# what is true instead", *lines)
