"""Wide priors: whether covariances lose what the measurements leave of one, and which direction they say nothing about.

A covariance in double precision holds sixteen digits below its largest entry.  What a measurement of variance R leaves of a
predicted variance S is known to about eps S/R of itself.
"""

from __future__ import annotations

import numpy as np

from piazzi.expressions import evaluate
from piazzi.model import Sensor
from piazzi.model.functions import STATION
from piazzi.model.values import with_values
from piazzi.problem import Problem, Station
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

# predicted over noise variance of one measurement beyond which a covariance keeps less than six digits of what is left
DIFFUSE = 1e10
ROUNDED = 1e6  # and beyond which what is left may be too coarse for the last steps of a graph
TOO_WIDE = "the prior is too wide for covariances"
WIDE = 1e6  # times the size of a value: a prior that wide says that it is not known
UNINFORMED = 0.9  # of the prior's variance: the measurements said nothing
NOT_BORDERED = "the bordered form does not apply, because process noise or a manoeuvre moves an estimated constant"


def too_wide_message(widest: Array) -> str:
    """Why a live estimate on covariances cannot be used, "" unless a measurement had more than `DIFFUSE` times its noise."""
    way = "begin with SquareRootKalmanFilter().start(problem), or estimate the whole run"
    return f"{TOO_WIDE} beside the noise of the measurements: {way}" if widest[0] > DIFFUSE else ""


def too_wide(problem: Problem, inputs: Inputs, S: Array) -> bool:
    """Whether innovation covariances (J, m, m) of a filter stand further above the noise than covariances can tell."""
    if np.fmax.reduce(S, axis=None, initial=0.0) <= DIFFUSE * problem.least_noise:  # an upper bound, which costs little
        return False
    return bool((ratios(problem, inputs, S) > DIFFUSE).any())


def ratios(problem: Problem, inputs: Inputs, S: Array) -> Array:
    """Largest S / R of each row, (J,)."""
    R = np.diagonal(problem.station_noise, axis1=1, axis2=2)[inputs.station]
    with np.errstate(all="ignore"):
        return np.asarray(np.fmax.reduce(np.diagonal(S, axis1=1, axis2=2) / R, axis=1, initial=0.0))


def last_wide(problem: Problem, inputs: Inputs, S: Array) -> int:
    """The last epoch with a row that is too wide, -1 where there is none."""
    rows = np.flatnonzero(ratios(problem, inputs, S) > DIFFUSE)
    return int(np.searchsorted(inputs.first_row, rows[-1], side="right")) - 1 if rows.size else -1


def prior_ratio(problem: Problem) -> float:
    """Roughly the largest S / R of a measurement at the prior mean, value by value, without a compiled model."""
    model, sigma = problem.model, np.sqrt(np.diag(problem.covariance))
    given = dict(zip(model.given, problem.given.tolist(), strict=False)) | {"t": problem.prior_time or 0.0}
    largest = 0.0
    for station in problem.stations:
        sensor = model.sensor(station.sensor)

        def seen(x: Array, station: Station = station, sensor: Sensor = sensor) -> Array:
            values = given | dict(zip(model.names, x.tolist(), strict=True)) | dict(station.numbers)
            values = with_values(
                values,
                model.definitions,
                sensor.definitions,
                functions=dict(problem.functions) | {STATION: station.place},
                model=model,
            )
            return np.array([evaluate(equation, values) for equation in sensor.equations])

        moves = [1e-4 * s * unit for s, unit in zip(sigma, np.eye(model.n), strict=True)]
        slopes = [(seen(problem.mean + move) - seen(problem.mean - move)) / 2e-4 for move in moves]
        variance = np.square(slopes).sum(axis=0) / np.diag(station.noise)
        largest = max(largest, float(np.fmax.reduce(variance, initial=0.0)))
    return largest


def undetermined(problem: Problem, first: Array, states: Array, last: Array | None = None) -> str:
    """A line naming the direction that a wide prior left open and the measurements did not close, "" if there is none.

    Parameters
    ----------
    problem : Problem
    first : (n, n), covariance of the first state given all measurements
    states : (K, n), estimates, which tell how large each value (each group, as a vector) is
    last : (n, n), optional
        Covariance of the last state, where `first` is given the first measurements only: it tells what the others closed.
        So do dynamics that let the direction shrink: what they take from it counts as closed.
    """
    sigma = np.sqrt(np.diag(problem.covariance))
    if not (sigma > WIDE * np.maximum(np.abs(states[0]), 1.0)).any():  # a lower bound of the sizes, which are dearer
        return ""
    wide = sigma > WIDE * _sizes(problem, states)
    if not wide.any():
        return ""
    direction = _widest_direction(first, sigma, wide)
    if direction is None or (last is not None and _widest_direction(last, sigma, wide) is None):
        return ""
    return f"the measurements do not determine {_words(problem, direction)}: it is as uncertain as the prior left it"


def _widest_direction(covariance: Array, sigma: Array, wide: Array) -> Array | None:
    """The widest direction in units of the prior's sigma, None where the measurements said something about it."""
    if not np.isfinite(covariance).all():
        return None
    unit = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    direction: Array = vectors[:, -1]
    return direction if values[-1] > UNINFORMED and wide[np.argmax(np.abs(direction))] else None


def _sizes(problem: Problem, states: Array) -> Array:
    """How large each value is along the way, or the group that it belongs to as a vector; one unit at least."""
    with np.errstate(over="ignore"):
        size = np.maximum(np.abs(states).max(axis=0), np.abs(problem.mean))
        for members in problem.model.group_indices.values():
            columns = list(members)
            size[columns] = np.maximum(size[columns], np.sqrt((states[:, columns] ** 2).sum(axis=1)).max())
    return np.asarray(np.maximum(size, 1.0))


def _words(problem: Problem, direction: Array) -> str:
    """A direction in the names of its states, in units of their prior sigma, the largest first."""
    order = [int(i) for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > 0.1]
    names = problem.model.names
    if len(order) == 1:
        return repr(names[order[0]])
    sign = np.sign(direction[order[0]])
    terms = " ".join(f"{sign * direction[i]:+.2f} {names[i]}" for i in order)
    return f"the combination {terms} (in prior sigmas)"
