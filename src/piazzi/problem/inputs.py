"""A problem and its tracking as the flat arrays that every estimator kernel takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from piazzi.kernels.bundle import Belief, Given, Measured, Run
from piazzi.problem.checks import Array
from piazzi.problem.problem import Problem
from piazzi.problem.tracking import Tracking

_PREPARED: WeakKeyDictionary[Tracking, tuple[Problem, Inputs]] = WeakKeyDictionary()


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

    def __getstate__(self) -> dict[str, Any]:
        """Without addresses of arrays, which mean nothing elsewhere."""
        return {name: value for name, value in self.__dict__.items() if name != "_bundles"}

    @property
    def epochs(self) -> int:
        return len(self.t)

    @cached_property
    def most_rows(self) -> int:
        """Rows of the epoch that has the most."""
        return int(np.diff(self.first_row).max())

    def bundles(self, problem: Problem) -> tuple[Run, Given, Measured, Belief]:
        """Run, model, measurements and prior as kernels take them, looked up once for all estimators."""
        kept: tuple[Problem, tuple[Run, Given, Measured, Belief]] | None = self.__dict__.get("_bundles")
        if kept is None or kept[0] is not problem:
            run = Run(
                epochs=self.epochs,
                t_prior=self.t_prior,
                t=self.t,
                count=self.count,
                scale=self.scale,
                first_row=self.first_row,
                Q=problem.process_noise.covariance,
            )
            measured = measured_by(problem, self.z, self.station)
            kept = self.__dict__["_bundles"] = problem, (run, problem.given_bundle, measured, problem.prior_bundle)
        return kept[1]


def epoch_alone(problem: Problem, t: float, rows: int) -> Run:
    """A run of one epoch that a prediction has reached already."""
    one, first_row = np.array([t]), np.array([0, rows])
    Q = problem.process_noise.covariance
    return Run(epochs=1, t_prior=t, t=one, count=np.array([1]), scale=np.zeros(1), first_row=first_row, Q=Q)


def measured_by(problem: Problem, z: Array, station: Array) -> Measured:
    """Measurements (J, M) of stations (J,), which are numbered as in the problem."""
    return Measured(
        z=z,
        station=station,
        sensor=problem.station_sensor,
        numbers=problem.station_numbers,
        R=problem.station_noise,
        correlated=problem.station_correlated,
    )


def prepare(problem: Problem, tracking: Tracking) -> Inputs:
    """Check that the tracking fits the problem and lay both out, once; raises ValueError where it does not fit.

    What was laid out for the last problem is kept as long as the tracking is: estimators that are compared share it.
    """
    kept = _PREPARED.get(tracking)
    if kept is None or kept[0] is not problem:
        station = tracking.stations_of(problem)
        start, count, scale = problem.intervals(tracking.times)
        problem.cover(min(start, float(tracking.times[0])), float(tracking.times[-1]))
        z = tracking.padded(problem.model.width)
        _check_resolved(problem, tracking, station, z)
        inputs = Inputs(tracking.times, start, count, scale, tracking.first_row, z, station)
        inputs.bundles(problem)
        kept = _PREPARED[tracking] = problem, inputs
    return kept[1]


def _check_resolved(problem: Problem, tracking: Tracking, station: Array, z: Array) -> None:
    """Raise ValueError for a measurement whose rounding, as a number, is larger than its noise."""
    if np.fmax.reduce(np.abs(z), axis=None, initial=0.0) <= problem.least_limit:
        return
    beyond = np.argwhere(np.abs(z) > np.array(problem.station_limits)[station])
    if beyond.size:
        row, i = (int(v) for v in beyond[0])
        where = f"row {row} (t = {tracking.row_times[row]:g} s)"
        raise ValueError(f"{where}: {unresolved(problem, int(station[row]), i, float(z[row, i]))}")


def unresolved(problem: Problem, station: int, component: int, value: float) -> str:
    """What to say of a measurement that is larger than its station's limit."""
    eps = float(np.finfo(float).eps)
    name, sigma = problem.stations[station].name, eps * problem.station_limits[station][component]
    return (
        f"station {name!r} measured {value:g}, which a number holds to {eps * abs(value):.2g}, with noise of sigma "
        f"{sigma:.2g}; nothing is measured below rounding: give more noise"
    )


def with_prior_node(inputs: Inputs) -> Inputs:
    """The same run with a state, without measurements, at the time of the prior, where that is before the first epoch."""
    if inputs.t_prior >= inputs.t[0]:
        return inputs
    return replace(
        inputs,
        t=np.append(inputs.t_prior, inputs.t),
        count=np.append(np.int64(1), inputs.count),
        scale=np.append(0.0, inputs.scale),
        first_row=np.append(np.int64(0), inputs.first_row),
    )


def wrapped(problem: Problem, row_station: Array, z: Array) -> Array:
    """Angle components brought into (-pi, pi]."""
    angle = np.zeros((len(problem.stations), z.shape[1]), dtype=bool)
    for s, station in enumerate(problem.stations):
        marks = problem.model.sensor(station.sensor).is_angle
        angle[s, : len(marks)] = marks
    return np.where(angle[row_station], z - 2 * np.pi * np.ceil((z - np.pi) / (2 * np.pi)), z)
