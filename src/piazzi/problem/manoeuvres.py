"""Manoeuvres as kernels take them: in order of time, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.model import Model
from piazzi.problem.checks import Array, covariance, finite_vector, frozen, numeric
from piazzi.problem.parts import Manoeuvre
from piazzi.text import nearest

SAME = 1e-12
NONE = frozen([0.0])  # as `packed`


def checked(manoeuvres: Manoeuvre | Sequence[Manoeuvre], model: Model) -> tuple[Manoeuvre, ...]:
    """The manoeuvres in order of time, with full covariances and the names of the states that jump; raises ValueError."""
    given = [manoeuvres] if isinstance(manoeuvres, Manoeuvre) else list(manoeuvres)
    if given and model.discrete:
        raise ValueError("the model is a step, x[k+1], which cannot be interrupted: manoeuvres need a continuous model")
    return tuple(sorted((_checked(m, i, model) for i, m in enumerate(given)), key=lambda m: m.time))


def _checked(manoeuvre: Manoeuvre, i: int, model: Model) -> Manoeuvre:
    time = numeric(manoeuvre.time, f"time of manoeuvre {i}").reshape(-1)
    if time.size != 1 or not np.isfinite(time).all():
        raise ValueError(f"time of manoeuvre {i} is {manoeuvre.time!r}; it must be one finite number of seconds")
    what = f"the manoeuvre at {time[0]:g} s"
    states = _states(manoeuvre.states, model, what)
    delta = finite_vector(manoeuvre.delta_v, len(states), f"delta_v of {what}", states)
    spread = np.zeros(len(states)) if manoeuvre.covariance is None else manoeuvre.covariance
    return Manoeuvre(float(time[0]), delta, covariance(spread, len(states), f"covariance of {what}", states), states)


def _states(given: str | Sequence[str], model: Model, what: str) -> tuple[str, ...]:
    groups = dict(model.groups)
    if isinstance(given, str):
        if given not in groups:
            raise ValueError(f"{what} changes {given!r}, which is not a group of the model{nearest(given, groups)}")
        return tuple(groups[given])
    for name in given:
        if name not in model.names:
            raise ValueError(f"{what} changes {name!r}, which is not a state{nearest(name, model.names)}")
    return tuple(given)


def check_after(manoeuvres: Sequence[Manoeuvre], start: float) -> None:
    """Raise ValueError for a manoeuvre that is not after the prior, at `start`: nothing would apply it.

    As in the kernels, times are one that differ by 1e-12 of themselves, or by as many seconds.
    """
    if manoeuvres and manoeuvres[0].time - start <= SAME * max(abs(manoeuvres[0].time), 1.0):
        raise ValueError(f"the manoeuvre at {manoeuvres[0].time:g} s is not after the prior at {start:g} s")


def packed(manoeuvres: Sequence[Manoeuvre], model: Model) -> Array:
    """Their number; then for each its time, the jump of the whole state (n) and its covariance (n, n)."""
    if not manoeuvres:
        return NONE
    n = model.n
    out = [np.array([float(len(manoeuvres))])]
    for m in manoeuvres:
        where = [model.names.index(s) for s in m.states]
        jump, spread = np.zeros(n), np.zeros((n, n))
        jump[where] = m.delta_v
        spread[np.ix_(where, where)] = m.covariance
        out += [np.array([m.time]), jump, spread.reshape(-1)]
    return frozen(np.concatenate(out))
