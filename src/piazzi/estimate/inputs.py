"""A problem and its tracking as the flat arrays that every estimator kernel takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array


@dataclass(frozen=True, eq=False)
class Inputs:
    """Arrays of one run.

    Shapes: `t`, `count`, `scale` (K,); `first_row` (K + 1,); `z` (J, M); `station` (J,).  `t_prior` is the time of the prior.
    """

    t: Array
    t_prior: float
    count: Array
    scale: Array
    first_row: Array
    z: Array
    station: Array

    @property
    def epochs(self) -> int:
        return len(self.t)

    def measured(self, problem: Problem) -> tuple[Array, ...]:
        """The arguments that describe the measurements, in the order all kernels share."""
        return (
            self.first_row,
            self.z,
            self.station,
            problem.station_sensor,
            problem.station_numbers,
            problem.station_noise,
            problem.station_correlated,
        )


def prepare(problem: Problem, tracking: Tracking) -> Inputs:
    """Check that the tracking fits the problem and lay both out; raises ValueError where it does not fit."""
    station = tracking.stations_of(problem)
    times = tracking.times
    start, count, scale = problem.intervals(times)
    return Inputs(times, start, count, scale, tracking.first_row, tracking.padded(problem.model.width), station)


def scratch(problem: Problem) -> tuple[Array, Array, Array]:
    """Work space of a measurement update: innovation (M,), Jacobian (M, N), and factors (M, M + N)."""
    M, N = problem.model.width, problem.model.n
    return np.zeros(M), np.zeros((M, N)), np.zeros(M * (M + N))


def with_prior_node(inputs: Inputs) -> Inputs:
    """The same run with a state, without measurements, at the time of the prior, where that is before the first epoch."""
    if inputs.t_prior >= inputs.t[0]:
        return inputs
    return Inputs(
        np.append(inputs.t_prior, inputs.t),
        inputs.t_prior,
        np.append(np.int64(1), inputs.count),
        np.append(0.0, inputs.scale),
        np.append(np.int64(0), inputs.first_row),
        inputs.z,
        inputs.station,
    )
