"""Accelerations that nobody modelled: first-order Gauss-Markov processes as further states."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from piazzi.model.model import Model
from piazzi.model.sensor import Parameter
from piazzi.text import nearest


def driven_states(model: Model, states: str | Sequence[str]) -> tuple[str, ...]:
    """States of a group of the model, or those named; raises ValueError for an unknown one."""
    groups = dict(model.groups)
    if isinstance(states, str):
        if states not in groups:
            raise ValueError(f"{states!r} is not a group of the model{nearest(states, groups)}")
        return tuple(groups[states])
    for name in states:
        if name not in model.states:
            raise ValueError(f"{name!r} is not a state{nearest(name, model.states)}")
    return tuple(states)


def _per_second(unit: str) -> str:
    """The unit of a rate: "m/s^2" of "m/s"."""
    match = re.fullmatch(r"(.+)/s(?:\^(\d+))?", unit)
    return f"{match[1]}/s^{int(match[2] or 1) + 1}" if match else f"{unit}/s"


def with_gauss_markov(
    model: Model, states: str | Sequence[str] = "velocity", time_constant: str | float = "tau", prefix: str = "gm_"
) -> Model:
    """The model with one more state for each of `states`, added to its rate: da/dt = -a / tau, plus white noise.

    Parameters
    ----------
    model : Model
        Continuous.
    states : name of a group, or names of states
        Whose rates are disturbed; the new states are called by them, with the prefix, and form the group "gauss_markov".
    time_constant : name of a parameter, or seconds
        A name that the model does not have is added as a fixed parameter.
    prefix : str

    Raises
    ------
    ValueError
        For a discrete model, unknown states, or a time constant that is not positive.
    """
    if model.discrete:
        raise ValueError("the model is a step, x[k+1]: a Gauss-Markov process needs rates")
    if not isinstance(time_constant, str) and not 0 < time_constant < float("inf"):
        raise ValueError(f"time_constant is {time_constant}; it must be positive, or the name of a parameter")
    driven = driven_states(model, states)
    new = tuple(prefix + s for s in driven)
    tau = time_constant if isinstance(time_constant, str) else repr(float(time_constant))
    rates = dict(zip(model.states, model.dynamics, strict=True))
    rates |= {s: f"{rates[s]} + {a}" for s, a in zip(driven, new, strict=True)}
    rates |= {a: f"-{a}/{tau}" for a in new}
    added = isinstance(time_constant, str) and time_constant not in (*model.parameter_names, *model.states)
    units = {a: _per_second(model.unit(s)) for s, a in zip(driven, new, strict=True) if model.unit(s)}
    return replace(
        model,
        states=(*model.states, *new),
        dynamics=tuple(rates.values()),
        parameters=(*model.parameters, Parameter(str(time_constant), unit="s")) if added else model.parameters,
        groups={**dict(model.groups), "gauss_markov": new},
        units={**dict(model.units), **units},
        memory=dict(model.memory),
    )
