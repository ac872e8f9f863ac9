"""What is estimated as results tell it: coefficients, of which the logarithm is estimated, and the air's density over time.

Coefficients of sunlight and of air are positive.  With a sigma of a share s before the measurements, one sigma of the
logarithm is a factor of 1 + s either way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import log1p
from typing import Any

import numpy as np

from piazzi.determination.motion import Extra, Numbers, instead, words_of
from piazzi.determination.unknowns import Label
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

POSITIVE = ("cr_a_m", "cd_a_m")
LOG, AIR, DENSITY = "_log", "air_", "density_"


def by_logarithms(numbers: Numbers, extra: Extra, definitions: Mapping[str, str]) -> Extra:
    """What replaces coefficients that are uncertain by their values before the measurements times exponentials."""
    changed: dict[str, str] = {}
    labels: dict[str, Label] = {}
    for name, role in list(numbers.roles.items()):
        before = numbers.values.get(name)
        if role == "fixed" or not name.startswith(POSITIVE) or not isinstance(before, Gaussian):
            continue
        mean, spread = float(np.ravel(before.mean)[0]), float(np.ravel(before.covariance)[0]) ** 0.5
        if not mean > 0.0:
            raise ValueError(f"{name} is {mean:g} before the measurements; a coefficient that is estimated is positive")
        numbers.roles[name], numbers.values[name] = "fixed", mean
        numbers.roles[name + LOG], numbers.values[name + LOG] = role, Gaussian(0.0, log1p(spread / mean) ** 2)
        changed |= instead({**definitions, **changed}, name, f"({name}*exp({name}{LOG}))")
        labels[name + LOG] = extra.labels.get(name) or Label(name, words_of(name))
    return Extra(changed, labels=labels)


def air_of(problem: Problem) -> tuple[list[int], Array]:
    """Where what drives the density stands, and the matrix (k, k) that makes its logarithm at the nodes of it."""
    names = problem.model.names
    count = sum(is_node(name) for name in names)
    where = [names.index(f"{AIR}{k}") for k in range(1, count + 1)]
    if not count:
        return where, np.empty((0, 0))
    sigma, left, new = (float(problem.parameters[f"{AIR}{what}"]) for what in ("sigma", "left", "new"))
    lag = np.subtract.outer(np.arange(count), np.arange(count))
    root = np.where(lag >= 0, left ** np.maximum(lag, 0), 0.0) * new
    root[:, 0] = sigma * left ** np.arange(count)
    return where, root


def is_node(name: str, of: str = AIR) -> bool:
    """Whether a name is that of the density at a node."""
    return name.startswith(of) and name.removeprefix(of).isdigit()


def nodes_of(problem: Problem) -> list[Any]:
    """Dates at which the density is estimated."""
    first, step = (problem.parameters.get(f"{AIR}{what}", 0.0) for what in ("first", "step"))
    return [problem.epoch + (first + step * k) for k in range(len(air_of(problem)[0]))]


def said_name(name: str) -> str:
    """The name by which results have a value that is estimated."""
    if is_node(name):
        return DENSITY + name.removeprefix(AIR)
    return name.removesuffix(LOG) if name.startswith(POSITIVE) else name


def said(problem: Problem, mean: Array) -> tuple[Array, Array]:
    """Values (n,) as results have them, and their derivatives (n, n) by those that are estimated."""
    values, J = mean.copy(), np.eye(len(mean))
    for i, name in enumerate(problem.model.names):
        if name.startswith(POSITIVE) and name.endswith(LOG):
            values[i] = J[i, i] = float(problem.parameters[said_name(name)]) * np.exp(mean[i])
    where, root = air_of(problem)
    values[where], J[np.ix_(where, where)] = root @ mean[where], root
    return values, J


def believed(problem: Problem, name: str) -> tuple[float, float]:
    """Value and sigma before the measurements of what is estimated or considered, as results have them."""
    if name in problem.model.names:
        i = problem.model.names.index(name)
        values, J = said(problem, problem.mean)
        return float(values[i]), float(np.sqrt(J[i] @ problem.covariance @ J[i]))
    given: Any = problem.parameters[name]
    value, sigma = float(given.mean[0]), float(np.sqrt(given.covariance[0, 0]))
    if said_name(name) == name:
        return value, sigma
    size = float(problem.parameters[said_name(name)]) * float(np.exp(value))
    return size, size * sigma


def at_rest(problem: Problem, names: Sequence[str]) -> Problem:
    """The problem with constants as states that do not move: what is known of them goes with that of the others."""
    if not names:
        return problem
    old = problem.model
    count, beliefs = len(old.states), [problem.parameters[name] for name in names]
    model = replace(
        old,
        states=(*old.states, *names),
        dynamics=(*old.dynamics, *("0" for _ in names)),
        parameters=tuple(p for p in old.parameters if p.name not in names),
        groups=dict(old.groups),
        units={**dict(old.units), **{name: old.unit(name) for name in names if old.unit(name)}},
        memory=dict(old.memory),
    )
    mean = np.concatenate([problem.prior.mean, [float(one.mean[0]) for one in beliefs]])
    P = np.zeros((len(mean), len(mean)))
    P[:count, :count] = problem.prior.covariance
    P[count:, count:] = np.diag([float(one.covariance[0, 0]) for one in beliefs])
    Q = np.zeros_like(P)
    Q[:count, :count] = problem.process_noise.covariance[:count, :count]
    parameters = {name: value for name, value in problem.parameters.items() if name not in names}
    return replace(problem, model=model, prior=Gaussian(mean, P), process_noise=replace(problem.process_noise, covariance=Q),
                   parameters=parameters)  # fmt: skip
