"""Which root of which station was not found, where an estimate cannot be used or a measurement not be simulated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from piazzi.kernels import KernelSpec, load_plain
from piazzi.kernels.bundle import Given
from piazzi.model import Model, Sensor
from piazzi.model.functions import ROOT
from piazzi.problem.checks import Array
from piazzi.problem.problem import Problem
from piazzi.problem.tracking import Tracking

MOST_EPOCHS = 100  # that are looked at


def lost_root(problem: Problem, tracking: Tracking, mean: Array) -> str:
    """Words for the first root without a solution at the first states (K, n) that are none, or after the last that is one.

    "" where all are found, or the model has none.
    """
    if not has_roots(problem.model):
        return ""
    try:
        return _lost(problem, tracking, mean)
    except (ValueError, ArithmeticError):  # the failure is told without it
        return ""


def lost_root_of(problem: Problem, s: int, t: float, x: Array) -> str:
    """Words for the first root of station `s` without a solution at a time and state, "" where all are found."""
    try:
        return _lost_at(problem, s, t, x, problem.given_over(t, t))
    except (ValueError, ArithmeticError):
        return ""


def check_roots(problem: Problem, times: Array, index: Array, states: Array, z: Array, marks: Array) -> None:
    """Raise ValueError where a simulated measurement has no value because a root has no solution.

    Parameters
    ----------
    times, index, states : (K,), stations (S,) that measure at each of them, (K, n)
    z : (K S, m)
    marks : (K, S), which of them measure
    """
    if not has_roots(problem.model):
        return
    width = np.array([len(s.noise) for s in problem.stations])[index]
    there = marks[:, :, None] & (np.arange(z.shape[1]) < width[:, None])
    for k, s in np.argwhere((there & np.isnan(z.reshape(there.shape))).any(axis=2))[:MOST_EPOCHS]:
        lost = lost_root_of(problem, int(index[s]), float(times[k]), np.ascontiguousarray(states[k]))
        if lost:
            raise ValueError(f"nothing can be simulated: {lost}")


def has_roots(model: Model) -> bool:
    """Whether a model has any."""
    return any(_roots(model, sensor) for sensor in model.sensors)


def _lost(problem: Problem, tracking: Tracking, mean: Array) -> str:
    finite = np.asarray(np.isfinite(mean).all(axis=1))
    begin = 0 if finite.all() else int(np.argmin(finite))
    given, stations = problem.given_over(*tracking.times[[0, -1]]), tracking.stations_of(problem)
    for k, x in _states(problem, tracking, mean, range(begin, min(begin + MOST_EPOCHS, len(finite)))):
        t = float(tracking.times[k])
        for row in range(tracking.first_row[k], tracking.first_row[k + 1]):
            lost = _lost_at(problem, int(stations[row]), t, x, given)
            if lost:
                return lost
    return ""


def _lost_at(problem: Problem, s: int, t: float, x: Array, given: Given) -> str:
    kernel = load_plain(_probe(problem.spec("transition", "functions")))
    numbers, sensor = problem.station_numbers[s], int(problem.station_sensor[s])
    found = _roots(problem.model, problem.model.sensors[sensor])
    out = np.empty((1, max(len(_roots(problem.model, each)) + each.width for each in problem.model.sensors)))
    kernel.evaluate_measurement(1, sensor, np.array([t]), x[None], given, numbers, out)
    for name, value in zip(found, out[0].tolist(), strict=False):
        if np.isnan(value):
            return f"root {name!r} of station {problem.stations[s].name!r} has no solution at t = {t:g} s"
    return ""


@lru_cache(maxsize=16)
def _probe(spec: KernelSpec) -> KernelSpec:
    """The module of a model whose sensors see the roots."""
    return KernelSpec(replace(spec.model, sensors=_probes(spec.model)), spec.scheme, spec.fragments)


def _states(problem: Problem, tracking: Tracking, mean: Array, epochs: range) -> Iterator[tuple[int, Array]]:
    """Epochs with their states, those that are none as foretold by the epoch before, or by the prior."""
    start = epochs.start
    t, x = (float(tracking.times[start - 1]), mean[start - 1]) if start else (problem.prior_start(tracking.times), problem.mean)
    for k in epochs:
        now = float(tracking.times[k])
        x = mean[k] if np.isfinite(mean[k]).all() else problem.step(x, now - t, t)[0] if now > t else x
        t = now
        yield k, np.ascontiguousarray(x)


def _roots(model: Model, sensor: Sensor) -> list[str]:
    """Names of all roots, in the order in which they are solved."""
    return [d.names[0] for d in (*model.definitions, *sensor.definitions) if d.function == ROOT]


def _probes(model: Model) -> tuple[Sensor, ...]:
    """Sensors that see the roots, and behind them what they see else, so that they need the same numbers of a station."""
    out = []
    for sensor in model.sensors:
        roots = {f"root_{i}": name for i, name in enumerate(_roots(model, sensor))}
        seen = {f"seen_{i}": equation for i, equation in enumerate(sensor.equations)}
        out.append(Sensor(sensor.name, roots | seen, definitions=sensor.definitions, visible=sensor.visible))
    return tuple(out)
