"""Whether a prior is so wide beside the noise that covariances lose what the measurements leave.

A covariance in double precision holds sixteen digits below its largest entry.  What a measurement of variance R leaves of a
predicted variance S is known to about eps S/R of itself.
"""

from __future__ import annotations

import numpy as np

from piazzi.expressions import evaluate
from piazzi.model import Sensor
from piazzi.model.definitions import with_values
from piazzi.problem import Problem, Station
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

# predicted over noise variance of one measurement beyond which a covariance keeps less than six digits of what is left
DIFFUSE = 1e10
TOO_WIDE = "the prior is too wide for covariances"
NOT_BORDERED = "the bordered form does not apply, because process noise or a manoeuvre moves an estimated constant"


def too_wide_message(widest: Array) -> str:
    """Why a live estimate on covariances cannot be used, "" unless a measurement had more than `DIFFUSE` times its noise."""
    way = "begin with SquareRootKalmanFilter().start(problem), or estimate the whole run"
    return f"{TOO_WIDE} beside the noise of the measurements: {way}" if widest[0] > DIFFUSE else ""


def too_wide(problem: Problem, inputs: Inputs, S: Array) -> bool:
    """Whether innovation covariances (J, m, m) of a filter stand further above the noise than covariances can tell."""
    least = np.diagonal(problem.station_noise, axis1=1, axis2=2)
    if S.size and np.fmax.reduce(S, axis=None) <= DIFFUSE * least[least > 0.0].min():  # an upper bound, which costs little
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
            values = with_values(values, model.definitions, sensor.definitions)
            return np.array([evaluate(equation, values) for equation in sensor.equations])

        moves = [1e-4 * s * unit for s, unit in zip(sigma, np.eye(model.n), strict=True)]
        slopes = [(seen(problem.mean + move) - seen(problem.mean - move)) / 2e-4 for move in moves]
        variance = np.square(slopes).sum(axis=0) / np.diag(station.noise)
        largest = max(largest, float(np.fmax.reduce(variance, initial=0.0)))
    return largest
