"""What a study can vary: settings of estimators, and numbers of the problem as it is believed and as it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from math import isfinite
from typing import Any, cast

import numpy as np

from piazzi.problem import Gaussian, Problem, Station
from piazzi.text import nearest

ASSUMED, TRUTH = "assumed.", "truth."
Value = int | float | str
Change = Callable[[Problem, float], Problem]


@dataclass(frozen=True)
class Axis:
    """One thing that is varied, and the values that it takes."""

    name: str
    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError(f"{self.name} is to be varied, but over no values")
        seen: set[Value] = set()
        for i, value in enumerate(self.values):
            if isinstance(value, float) and not isfinite(value):
                raise ValueError(f"value {i} of {self.name} is {value}; it must be finite")
            if value in seen:
                raise ValueError(f"{self.name} takes the value {value} twice")
            seen.add(value)


def read_value(text: Any) -> Value:
    """A whole number, a number or a word."""
    if isinstance(text, (np.integer, np.floating)):
        return text.item()
    if not isinstance(text, str):
        return text  # type: ignore[no-any-return]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text.strip()


def problem_changes(problem: Problem) -> dict[str, Change]:
    """Everything of this problem that can be varied, by name."""
    out: dict[str, Change] = {
        "R.scale": lambda p, c: replace(p, stations=[_scaled(s, c) for s in p.stations]),
        "Q.scale": _scale_noise,
        "P.scale": lambda p, c: replace(p, prior=Gaussian(p.prior.mean, p.prior.covariance * c)),
        "substeps": _set_substeps,
    }
    for station in problem.stations:
        out[f"R.{station.name}.scale"] = _station_change(station.name)
    for name, recipe in problem.functions.items():
        settings = [key for key in ("degree", "gradient_degree") if hasattr(recipe, key)]
        for owner in (name, "earth") if name == "field" else (name,):
            out |= {f"{owner}.{key}": _function_change(name, key) for key in settings}
    for name in problem.model.parameter_names:
        out[name] = _parameter_change(name)
    return out


def estimator_settings(estimator: Any) -> tuple[str, ...]:
    """Names of the settings of an estimator."""
    return tuple(f.name for f in fields(estimator)) if is_dataclass(estimator) else ()


def split(axes: Sequence[Axis], problem: Problem, estimators: Mapping[str, Any]) -> tuple[tuple[Axis, ...], tuple[Axis, ...]]:
    """Axes of the problem, and axes of estimators; raises ValueError for a name that is neither, with the nearest."""
    known = problem_changes(problem)
    settings = {name for e in estimators.values() for name in estimator_settings(e)}
    of_problem, of_estimators = [], []
    for axis in axes:
        bare = axis.name.removeprefix(ASSUMED).removeprefix(TRUTH)
        if axis.name in settings:
            of_estimators.append(axis)
        elif bare in known and axis.name.count(".") - bare.count(".") <= 1:
            of_problem.append(axis)
        else:
            names = sorted({*settings, *known, *(s + k for s in (ASSUMED, TRUTH) for k in known)})
            raise ValueError(f"nothing here is called {axis.name!r}, so it cannot be varied{nearest(axis.name[:60], names)}")
    return tuple(of_problem), tuple(of_estimators)


def problems_at(problem: Problem, axes: Sequence[Axis], values: Sequence[Value]) -> tuple[Problem, Problem]:
    """The problem as it is (with its truth half) and as estimators believe it to be, with these values of the axes.

    A plain name changes both; ``assumed.`` before it, what estimators believe; ``truth.``, what happens.

    Raises
    ------
    ValueError
        For a value that does not fit.
    """
    changes, world, assumed = problem_changes(problem), problem, problem
    for axis, value in zip(axes, values, strict=True):
        change = changes[axis.name.removeprefix(ASSUMED).removeprefix(TRUTH)]
        if isinstance(value, str):
            raise ValueError(f"{axis.name} is {value!r}; it must be a number")
        try:
            world = world if axis.name.startswith(ASSUMED) else change(world, value)
            assumed = assumed if axis.name.startswith(TRUTH) else change(assumed, value)
        except ValueError as error:
            raise ValueError(f"{axis.name} = {value}: {error}") from None
    return world, assumed


def variant(estimator: Any, settings: Mapping[str, Value]) -> Any:
    """The estimator with these settings; raises ValueError for one that does not fit."""
    try:
        return replace(estimator, **settings)
    except (TypeError, ValueError) as error:
        shown = ", ".join(f"{k} = {v}" for k, v in settings.items())
        raise ValueError(f"{type(estimator).__name__} with {shown}: {error}") from None


def _positive(factor: float) -> float:
    if not factor > 0:
        raise ValueError("a scale must be positive")
    return factor


def _scaled(station: Station, factor: float) -> Station:
    noise = station.noise * _positive(factor)
    return Station(station.name, station.sensor, noise, station.numbers, schedule=station.schedule)


def _station_change(name: str) -> Change:
    return lambda p, c: replace(p, stations=[_scaled(s, c) if s.name == name else s for s in p.stations])


def _scale_noise(problem: Problem, factor: float) -> Problem:
    """Process noise times a factor, that of the truth half too."""
    if factor < 0:
        raise ValueError("a scale of process noise must be zero or more")
    noise, truth = problem.process_noise, problem.truth
    if truth is not None and truth.process_noise is not None:
        other = truth.process_noise
        truth = replace(truth, process_noise=replace(other, covariance=np.asarray(other.covariance, dtype=float) * factor))
    return replace(problem, process_noise=replace(noise, covariance=noise.covariance * factor), truth=truth)


def _set_substeps(problem: Problem, count: float) -> Problem:
    assert problem.integrator is not None
    return replace(problem, integrator=replace(problem.integrator, substeps=cast(int, count), max_step=None))


def _parameter_change(name: str) -> Change:
    def change(problem: Problem, value: float) -> Problem:
        given = problem.parameters[name]
        parameters = {**problem.parameters, name: Gaussian([value], given.covariance) if isinstance(given, Gaussian) else value}
        truth = problem.truth
        if truth is not None and name in truth.parameters:
            truth = replace(truth, parameters={**truth.parameters, name: value})
        return replace(problem, parameters=parameters, truth=truth)

    return change


def _function_change(name: str, key: str) -> Change:
    """Another setting of a function from outside, that of the truth half too."""

    def changed(functions: Mapping[str, Any], value: float) -> dict[str, Any]:
        return {**functions, name: replace(functions[name], **{key: value})} if name in functions else dict(functions)

    def change(problem: Problem, value: float) -> Problem:
        truth = problem.truth
        if truth is not None:
            truth = replace(truth, functions=changed(truth.functions, value))
        return replace(problem, functions=changed(problem.functions, value), truth=truth)

    return change
