"""What is estimated as results tell it: coefficients, which are positive, and the density of the air over time.

Of a coefficient of sunlight or of air its share s of a usual value is estimated.  The value is that times
(s + sqrt(s^2 + 4 a)) / 2 with a = 0.01: above a fifth of the usual it is s to some percent, so that estimators which linearise
once see a straight line, and it comes near to zero without ever being there, whatever they make of s.  What varies over time is
the logarithm of a factor of it: so is the density of the air, that over the density of its model.  Where that is estimated the
logarithm of the coefficient of drag is too: measurements tell their sum, so that what is known of both then is Gaussian.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.determination.motion import Extra, Numbers, instead, words_of
from piazzi.determination.unknowns import Label
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

POSITIVE = ("cr_a_m", "cd_a_m")
SHARE, LOGARITHM, AIR, DENSITY = "_share", "_log", "air_", "density_"
BEND = 0.01
LIGHT = f"cr_a_m{SHARE}"
DRAG, DRAG_LOGARITHM, WAVES = "cd_a_m_share", "cd_a_m_log", ("density_cos", "density_sin")
USUAL = 1.0 - BEND  # the share of the usual value itself


def value_of(share: Any) -> Any:
    """The coefficient in units of the usual one."""
    return 0.5 * (share + np.sqrt(share**2 + 4.0 * BEND))


def share_of(value: Any) -> Any:
    """The share of a coefficient in units of the usual one, which is positive."""
    return value - BEND / value


def slope_of(share: Any) -> Any:
    """The derivative of `value_of`."""
    return 0.5 * (1.0 + share / np.sqrt(share**2 + 4.0 * BEND))


def is_coefficient(name: str) -> bool:
    """Whether a name is that of what is estimated of a coefficient."""
    return name.startswith(POSITIVE) and name.endswith((SHARE, LOGARITHM))


def worth(name: str, x: float) -> tuple[float, float]:
    """The coefficient in units of the usual one, of a share or a logarithm as the name says, and its derivative."""
    value, slope = (np.exp(x), np.exp(x)) if name.endswith(LOGARITHM) else (value_of(x), slope_of(x))
    return float(value), float(slope)


def by_shares(numbers: Numbers, extra: Extra, definitions: Mapping[str, str]) -> Extra:
    """What replaces coefficients that are uncertain, or have a process, by their usual values and shares of them."""
    changed: dict[str, str] = {}
    labels: dict[str, Label] = {}
    processes = {process.state for process in extra.processes}
    for name, role in list(numbers.roles.items()):
        before, varies = numbers.values.get(name), f"{name}_change" in processes
        if not name.startswith(POSITIVE) or not (varies or (role != "fixed" and isinstance(before, Gaussian))):
            continue
        total = repr(USUAL)
        if isinstance(before, Gaussian) and role != "fixed":
            mean, spread = float(np.ravel(before.mean)[0]), float(np.ravel(before.covariance)[0]) ** 0.5
            if not mean > 0.0:
                raise ValueError(f"{name} is {mean:g} before the measurements; a coefficient that is estimated is positive")
            numbers.roles[name], numbers.values[name] = "fixed", mean
            numbers.roles[name + SHARE], numbers.values[name + SHARE] = role, Gaussian(USUAL, (spread / mean) ** 2)
            labels[name + SHARE] = extra.labels.get(name) or Label(name, words_of(name))
            total = name + SHARE
        text = f"{name}*({total} + sqrt({total}**2 + {4.0 * BEND!r}))/2"
        changed |= instead({**definitions, **changed}, name, f"({text}*exp({name}_change))" if varies else f"({text})")
    return Extra(changed, labels=labels)


def air_of(problem: Problem) -> tuple[list[int], Array]:
    """Where what drives the density stands, and the matrix (k, k) that makes its logarithm at its nodes, about its mean."""
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
    return name.removesuffix(SHARE).removesuffix(LOGARITHM) if name.startswith(POSITIVE) else name


def result_name(labels: Mapping[str, Label], name: str) -> str:
    """The name by which results have a value, and another night finds it again: of which station, date or engine it is."""
    return labels[name].name if name in labels else said_name(name)


def said(problem: Problem, mean: Array) -> tuple[Array, Array]:
    """Values (n,) as results have them, and their derivatives (n, n) by those that are estimated."""
    names = problem.model.names
    values, J = mean.copy(), np.eye(len(mean))
    where, root = air_of(problem)
    if where:
        values[where], J[np.ix_(where, where)] = root @ mean[where] + float(problem.parameters[f"{AIR}mean"]), root
    for i, name in enumerate(names):
        if is_coefficient(name):
            size = float(problem.parameters[said_name(name)])
            values[i], J[i, i] = (size * one for one in worth(name, mean[i]))
    return values, J


def believed(problem: Problem, name: str) -> tuple[float, float]:
    """Value and sigma before the measurements of what is estimated or considered, as results have them.

    Of a coefficient whose logarithm is estimated they are its mean and sigma.
    """
    if name in problem.model.names:
        i = problem.model.names.index(name)
        if name.endswith(LOGARITHM):
            m, P = float(problem.mean[i]), float(problem.covariance[i, i])
            value = float(problem.parameters[said_name(name)] * np.exp(m + 0.5 * P))
            return value, value * float(np.sqrt(np.expm1(P)))
        values, J = said(problem, problem.mean)
        return float(values[i]), float(np.sqrt(J[i] @ problem.covariance @ J[i]))
    given: Any = problem.parameters[name]
    value, sigma = float(given.mean[0]), float(np.sqrt(given.covariance[0, 0]))
    if said_name(name) == name:
        return value, sigma
    size = float(problem.parameters[said_name(name)])
    of, slope = worth(name, value)
    return size * of, size * slope * sigma


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
