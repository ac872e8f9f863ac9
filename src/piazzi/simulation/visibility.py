"""Who sees what, when: which stations measure at which epochs, by the rules of their sensors and by their schedules."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from piazzi.expressions import evaluate_arrays
from piazzi.model.definitions import TIME, Definitions, needed
from piazzi.model.functions import STATION
from piazzi.model.values import with_arrays
from piazzi.problem import Gaussian, Problem, Station
from piazzi.problem.checks import Array


def seen(problem: Problem, times: Array, states: Array) -> Array:
    """Which stations measure at epochs (K,) the true states (..., K, n): marks (..., K, S).

    A station measures where every rule of its sensor is above zero (not where one has no value) and its schedule has the time.

    Parameters
    ----------
    problem : Problem as it is, `true_problem`
    """
    out = np.ones((*states.shape[:-1], len(problem.stations)), dtype=bool)
    given = {name: problem.parameters[name] for name in problem.model.given}
    values = {name: float(v.mean[0]) if isinstance(v, Gaussian) else float(v) for name, v in given.items()}
    arrays = {TIME: times, **dict(zip(problem.model.names, np.moveaxis(states, -1, 0), strict=True))}
    for s, station in enumerate(problem.stations):
        if station.schedule is not None:
            out[..., s] &= station.schedule.has(times)
        out[..., s] &= _visible(problem, station, {**values, **arrays})
    return out


def _visible(problem: Problem, station: Station, values: dict[str, Array | float]) -> Array | bool:
    """Where the rules of a station's sensor are all above zero, at states and times by name."""
    sensor = problem.model.sensor(station.sensor)
    if not sensor.visible:
        return True
    layers: tuple[Definitions, ...] = (problem.model.definitions, sensor.definitions)
    functions = {**problem.functions, STATION: station.place}
    wanted = needed(sensor.visible, *layers)
    known = with_arrays({**values, **station.numbers}, wanted, *layers, functions=functions, model=problem.model)
    above = [np.asarray(evaluate_arrays(text, known)) > 0 for text in sensor.visible]
    return reduce(np.logical_and, above)  # one by one: a rule of the time alone is not of each run


def rules(problem: Problem, stations: Sequence[int]) -> str:
    """What has to hold for any of these stations to measure, for a message."""
    parts = []
    for station in (problem.stations[s] for s in stations):
        visible = [f"{text} > 0" for text in problem.model.sensor(station.sensor).visible]
        parts.append(f"{station.name}: {' and '.join([*visible, *([str(station.schedule)] if station.schedule else [])])}")
    return "; ".join(parts[:3])
