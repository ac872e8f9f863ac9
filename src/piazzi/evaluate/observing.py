"""Whether the first state can be seen at all, how well, and whether it is the only one that fits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.estimate.factor_graph import FactorGraph
from piazzi.evaluate.attempts import attempts
from piazzi.evaluate.bounds import full_truth
from piazzi.evaluate.information import Information, along, bound, factor, growth, singular
from piazzi.evaluate.observable import Observability
from piazzi.evaluate.twins import NO_SEARCH, find_twins
from piazzi.model import Sensor
from piazzi.problem import Problem, ProcessNoise, Station, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs, prepare
from piazzi.simulation import seen, simulate, true_problem

Addition = Station | tuple[Sensor, Station]
_POINTS = 400  # epochs after which the growing information is kept


def observability(
    problem: Problem,
    tracking: Tracking,
    *,
    add: Sequence[Addition] = (),
    twins: bool = True,
    source: str = "",
    times: Any = None,
    seed: int = 0,
    announce: Callable[[str], object] = lambda step: None,
) -> Observability:
    """What the measurements say about the first state, at the truth (where it is not known, at the factor graph's estimate).

    Estimated constants count as states.  The information is that of the measurements alone, without prior, with the process
    noise that the problem assumes taken into account, so that the Cramer-Rao sigma is a bound for the problem as it is
    estimated; `without_noise` has the textbook matrix H Phi.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    add : stations that measure at every epoch too, each alone or with a sensor that the model does not have, (sensor, station)
        `Observability.added` tells what they would change.
    twins : whether to look for other first states with the same measurements
    source : where the measurements came from, for the record
    times, seed : of the simulation that the tracking is, where the added stations may measure at other epochs than those
        it has, by their own rules and schedules: all are simulated anew
    announce : told what is being done, of what takes long

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem, a station of `add` does not fit the model or has a name that is taken, or
        there is neither truth nor a finite estimate.
    """
    inputs = prepare(problem, tracking)
    more = _with_stations(problem, add) if add else None
    states, about, message = _about(problem, tracking)
    found = _observability(problem, tracking, inputs, states, about, twins, source, announce)
    found = replace(found, attempts=attempts(problem, tracking, found.twins), message=message)
    if more is None:
        return found
    if times is None:
        wider = _with_rows(tracking, problem, more, states)
    else:
        wider = simulate(more, times, np.random.default_rng(seed))
        states = _about(more, wider)[0]
    return replace(found, added=_observability(more, wider, prepare(more, wider), states, about, twins, source, announce))


def _with_stations(problem: Problem, add: Sequence[Addition]) -> Problem:
    sensors = [part for item in add if isinstance(item, tuple) for part in item[:1]]
    stations = [item[1] if isinstance(item, tuple) else item for item in add]
    model = replace(problem.model, sensors=(*problem.model.sensors, *sensors)) if sensors else problem.model
    return replace(problem, model=model, stations=[*problem.stations, *stations])


def _about(problem: Problem, tracking: Tracking) -> tuple[Array, str, str]:
    """States to linearise about (K, n), what they are, and why they may be wrong."""
    truth = full_truth(problem, tracking)
    if truth is not None:
        return truth, "truth", ""
    estimate = FactorGraph().estimate(problem, tracking)
    if not np.isfinite(estimate.mean).all():
        raise ValueError(f"there is no truth, and the factor graph has no estimate to take its place: {estimate.message}")
    return estimate.mean, "estimate", "" if estimate.success else estimate.message


def _observability(
    problem: Problem,
    tracking: Tracking,
    inputs: Inputs,
    states: Array,
    about: str,
    twins: bool,
    source: str,
    announce: Callable[[str], object],
) -> Observability:
    sigma = np.sqrt(np.diag(problem.covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    rows = _finite(along(problem, inputs, states).rows * scale)
    total = _summary(factor(rows), scale)
    epochs = _epochs(inputs.epochs)
    values, directions = singular(growth(rows, inputs.first_row[epochs + 1] * inputs.z.shape[1]))
    without_noise = None
    if problem.process_noise.covariance.any():
        noiseless = replace(problem, process_noise=ProcessNoise(np.zeros(len(problem.model.states)), "step"), truth=None)
        without_noise = _summary(factor(_finite(along(noiseless, inputs, states).rows * scale)), scale)
    root = factor(rows)
    search = find_twins(problem, inputs, states[0], scale, root, announce) if twins else NO_SEARCH
    return Observability(
        problem,
        tracking,
        source,
        about,
        states[0].copy(),
        scale,
        total,
        without_noise,
        inputs.t[epochs],
        values,
        bound(values, directions) * scale,
        search.twins,
        searched=search,
    )


def _finite(rows: Array) -> Array:
    bad = ~np.isfinite(rows).all(axis=1)
    if bad.any():
        raise ValueError(f"measurement {int(np.argmax(bad))} has no derivative where the problem is linearised")
    return rows


def _summary(root: Array, scale: Array) -> Information:
    values, directions = singular(root)
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions = directions * np.sign(largest)
    return Information(values, directions, bound(values, directions) * scale)


def _epochs(K: int) -> Array:
    """Epochs to tell the growth after: all where there are few, else ever fewer of them, with some spread evenly."""
    if K <= _POINTS:
        return np.arange(K)
    half = _POINTS // 2
    return np.unique(np.concatenate([np.geomspace(1, K, half), np.linspace(1, K, half)]).round().astype(np.int64)) - 1


def _with_rows(tracking: Tracking, problem: Problem, more: Problem, states: Array) -> Tracking:
    """The tracking with a row for each further station at every epoch, behind those that are there.

    Their values are of no account, as long as they are there: at states (K, n) that a station does not see, they are not.
    """
    width, new = more.model.width, more.stations[len(problem.stations) :]
    K, S = len(tracking.times), len(more.stations) - len(problem.stations)
    extra = np.full((S, width), np.nan)
    for s, station in enumerate(new):
        extra[s, : len(station.noise)] = 0.0
    old = tracking.row_stations if tracking.row_stations is not None else [problem.stations[0].name] * len(tracking.row_times)
    times = np.concatenate([tracking.row_times, np.repeat(tracking.times, S)])
    order = np.argsort(times, kind="stable")
    marks = seen(true_problem(more), tracking.times, states)[:, -S:].reshape(-1, 1)
    values = np.concatenate([tracking.padded(width), np.where(marks, np.tile(extra, (K, 1)), np.nan)])[order]
    names = np.concatenate([old, np.tile([s.name for s in new], K)])[order]
    return Tracking(times[order], values, names, tracking.truth, tracking.epoch)
