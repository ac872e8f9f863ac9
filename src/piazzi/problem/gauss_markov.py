"""Accelerations that nobody modelled: first-order Gauss-Markov processes as further states of a problem."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.model import Model, Parameter
from piazzi.problem.checks import Array, numeric
from piazzi.problem.parts import Gaussian, ProcessNoise, Truth
from piazzi.problem.problem import Problem
from piazzi.text import nearest


def with_gauss_markov(
    problem: Problem,
    sigma: Any,
    time_constant: float,
    states: str | Sequence[str] = "velocity",
    parameter: str = "tau",
    prefix: str = "gm_",
) -> Problem:
    """The problem with a stationary first-order Gauss-Markov process added to the rate of each of `states`.

    A process is a further state of the model: da/dt = -a / tau, plus white noise.

    Parameters
    ----------
    problem : Problem
        With a continuous model, and process noise per second (or none).
    sigma : float or (d,)
        Standard deviation of each process: m/s^2 for velocities in m/s.  Its prior is zero with that deviation, its process
        noise density 2 sigma^2 / tau.
    time_constant : float
        Seconds after which a disturbance has decayed to 1/e.
    states : name of a group, or names of states
        The new states are called by them, with the prefix, and form the group "gauss_markov".
    parameter : str
        Name that the time constant gets in the model.
    prefix : str

    Returns
    -------
    Problem
        Where the problem says what is true otherwise, the truth has no such disturbances: a given first state is continued by
        zeros, and so is the truth's own process noise.

    Raises
    ------
    ValueError
        For a discrete model, unknown states, process noise per step, or values that are not positive.
    """
    driven = _driven(problem.model, states)
    model = _extended(problem.model, driven, parameter, prefix)
    spread = np.broadcast_to(numeric(sigma, "sigma"), (len(driven),))
    if not (np.isfinite(spread) & (spread > 0)).all() or not 0 < time_constant < np.inf:
        raise ValueError(f"sigma is {sigma} and time_constant {time_constant}; both must be positive")
    if problem.process_noise.per != "second" and problem.process_noise.covariance.any():
        raise ValueError("process noise is per step, a Gauss-Markov process needs it per second: give a density")
    noise = problem.process_noise if problem.process_noise.covariance.any() else ProcessNoise(problem.process_noise.covariance)
    nd = len(problem.model.states)
    prior = np.zeros((nd + len(driven), nd + len(driven)))
    prior[:nd, :nd] = problem.prior.covariance
    prior[nd:, nd:] = np.diag(spread**2)
    density = _continued(problem, noise.covariance, model, 2 * spread**2 / time_constant)
    return replace(
        problem,
        model=model,
        prior=Gaussian([*problem.prior.mean, *np.zeros(len(driven))], prior),
        process_noise=replace(noise, covariance=density),
        parameters={**problem.parameters, parameter: float(time_constant)},
        truth=None if problem.truth is None else _undisturbed(problem, problem.truth, model, len(driven)),
    )


def _driven(model: Model, states: str | Sequence[str]) -> tuple[str, ...]:
    """States of a group of the model, or those named; raises ValueError for an unknown one."""
    if model.discrete:
        raise ValueError("the model is a step, x[k+1]: a Gauss-Markov process needs rates")
    groups = dict(model.groups)
    if isinstance(states, str):
        if states not in groups:
            raise ValueError(f"{states!r} is not a group of the model{nearest(states, groups)}")
        return tuple(groups[states])
    for name in states:
        if name not in model.states:
            raise ValueError(f"{name!r} is not a state{nearest(name, model.states)}")
    return tuple(states)


def _extended(model: Model, driven: Sequence[str], tau: str, prefix: str) -> Model:
    """The model with one more state for each driven one, added to its rate."""
    new = tuple(prefix + s for s in driven)
    rates = dict(zip(model.states, model.dynamics, strict=True))
    rates |= {s: f"{rates[s]} + {a}" for s, a in zip(driven, new, strict=True)}
    rates |= {a: f"-{a}/{tau}" for a in new}
    added = tau not in (*model.parameter_names, *model.states)
    units = {a: _per_second(model.unit(s)) for s, a in zip(driven, new, strict=True) if model.unit(s)}
    return replace(
        model,
        states=(*model.states, *new),
        dynamics=tuple(rates.values()),
        parameters=(*model.parameters, Parameter(tau, unit="s")) if added else model.parameters,
        groups={**dict(model.groups), "gauss_markov": new},
        units={**dict(model.units), **units},
        memory=dict(model.memory),
    )


def _per_second(unit: str) -> str:
    """The unit of a rate: "m/s^2" of "m/s"."""
    match = re.fullmatch(r"(.+)/s(?:\^(\d+))?", unit)
    return f"{match[1]}/s^{int(match[2] or 1) + 1}" if match else f"{unit}/s"


def _continued(problem: Problem, covariance: Array, model: Model, variances: Array) -> Array:
    """A covariance of the old values with these variances of the new ones, by name, (n, n)."""
    out = np.zeros((model.n, model.n))
    old = [model.names.index(name) for name in problem.model.names]
    out[np.ix_(old, old)] = covariance
    new = [i for i in range(len(model.states)) if i not in old]
    out[new, new] = variances
    return out


def _undisturbed(problem: Problem, truth: Truth, model: Model, count: int) -> Truth:
    """The truth, undisturbed by the new states."""
    state = None if truth.state is None else [*numeric(truth.state, "true state").reshape(-1), *np.zeros(count)]
    noise = truth.process_noise
    if noise is not None:
        given = replace(problem, process_noise=noise, truth=None).process_noise
        noise = replace(given, covariance=_continued(problem, given.covariance, model, np.zeros(count)))
    return replace(truth, state=state, process_noise=noise)
