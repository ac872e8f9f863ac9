"""The problem of a determination: forces, sensors and a prior that is as wide as a guess is uncertain."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.guesses import Guess
from piazzi.determination.motion import Extra, process_noise, with_processes
from piazzi.determination.orbit import root_of
from piazzi.determination.orbit_forces import Chosen
from piazzi.determination.physical import (
    AIR,
    LOGARITHM,
    USUAL,
    at_rest,
    is_coefficient,
    is_node,
    result_name,
    said_name,
    worth,
)
from piazzi.determination.sensing import Measured
from piazzi.determination.unknowns import Label
from piazzi.earth import EphemerisWarning, Epoch
from piazzi.kernels import RungeKutta8
from piazzi.problem import Gaussian, Problem, Tracking
from piazzi.problem.arcs import Steps, arc
from piazzi.problem.checks import Array
from piazzi.problem.dense import dense_grid, on_dense_grid
from piazzi.problem.manoeuvres import SAME
from piazzi.text import brief

if TYPE_CHECKING:
    from piazzi.determination.earlier import Earlier

WIDE = 0.1  # of distance and speed: the sigma of a guess, which says where to begin and nothing else


@dataclass(frozen=True, eq=False)
class Setup:
    """A problem with its tracking, and which row of it is which of `measured`.

    Attributes
    ----------
    problem, tracking : times are past `measured.epoch`
    rows : (J, m), indices of the observations, -1 where there is none
    states : (K, n), of the guess at all epochs, to begin from
    earlier : what was known before, None for no more than a guess
    before : (n,) and (n, n), that at the first epoch with a lower triangular root of its covariance
    solution : index of the epoch at which the answer stands
    spare : (J,), rows that are set aside, because they say what others say; None for none
    """

    measured: Measured
    chosen: Chosen
    guess: Guess
    problem: Problem
    tracking: Tracking
    rows: Array
    states: Array
    solution: int
    assumed: tuple[str, ...]
    earlier: Earlier | None = None
    before: tuple[Array, Array] | None = None
    spare: Array | None = None

    __repr__ = brief

    @property
    def labels(self) -> Mapping[str, Label]:
        """How users know what has names for kernels only."""
        return labels_of(self.measured, self.chosen)


def labels_of(measured: Measured, chosen: Chosen) -> dict[str, Label]:
    """How users know what has names for kernels only."""
    return {**measured.labels_of_constants, **chosen.extra.labels}


def setup(
    measured: Measured,
    chosen: Chosen,
    guess: Guess,
    *,
    at: Epoch | None = None,
    earlier: Earlier | None = None,
) -> Setup:
    """The problem that these make.

    Parameters
    ----------
    measured, chosen, guess : what was measured, forces, where to begin
    at : when the answer is to stand; default the last row
    earlier : an orbit with its covariance, which is the prior, carried to the first row with process noise

    Raises
    ------
    ValueError
        Where they do not fit, or the guess cannot be followed to the measurements.
    """
    problem = posed(measured, chosen, guess)
    tracking, rows, solution = _with_epoch(measured, at)
    times = tracking.times
    begin = float(times[0]) if earlier is None else earlier.epoch - measured.epoch
    problem = _begun(problem, begin)
    assumed = [*guess.assumed, *measured.assumed, *chosen.assumed]
    before = None
    if earlier is not None:
        if begin > float(times[0]):
            raise ValueError(
                f"--prior {earlier.source}: it is of {earlier.epoch}, after the first measurement that is new to it, at "
                f"{measured.epoch + float(times[0])}: give an orbit of before, or leave out what is older, "
                f"--from {_plain(earlier.epoch)}"
            )
        assumed += earlier.assumed
        problem, before = _known(problem, earlier, labels_of(measured, chosen), begin, float(times[0]))
    start = np.concatenate([guess.state, problem.mean[6:]])
    states = _followed(problem, start, guess.epoch - measured.epoch, times, chosen.max_step)
    if earlier is None:
        mean = states[0, : len(problem.model.states)]
        problem = problem.with_prior(_prior(mean, chosen.extra), begin)
    said = tuple(dict.fromkeys(assumed))
    return Setup(measured, chosen, guess, problem, tracking, rows, states, solution, said, earlier, before)


def _plain(epoch: Epoch) -> str:
    """A date as options take it."""
    return f"{str(epoch).removesuffix(' UTC')}Z" if str(epoch).endswith(" UTC") else f"'{epoch}'"


def at_last_used(given: Setup, keep: Array) -> Setup:
    """The same with the answer at the last row that was used, where it stood at the last row."""
    tracking = given.tracking
    used = tracking.row_times[keep & np.isfinite(tracking.values).any(axis=1)]
    asked = given.solution < len(tracking.times) - 1 or not (given.rows[-1] >= 0).any()  # a date of its own
    if asked or not len(used):
        return given
    return replace(given, solution=int(np.searchsorted(tracking.times, used.max())))


def renewed(given: Setup, measured: Measured, chosen: Chosen) -> Setup:
    """The same with other unknowns, its states and its prior of the orbit as they were."""
    problem, before = posed(measured, chosen, given.guess), None
    begin, old = float(given.problem.prior_time or 0.0), given.problem
    problem = _begun(problem, begin)
    if given.earlier is None:
        problem = problem.with_prior(old.prior, begin)
    else:
        problem, before = _known(problem, given.earlier, labels_of(measured, chosen), begin, float(given.tracking.times[0]))
    place = {name: i for i, name in enumerate(old.model.names)}
    states = np.tile(problem.mean, (len(given.states), 1))
    for i, name in enumerate(problem.model.names):
        if name in place:
            states[:, i] = given.states[:, place[name]]
    return replace(given, measured=measured, chosen=chosen, problem=problem, states=states, before=before)


def _begun(problem: Problem, t: float) -> Problem:
    """The problem with those manoeuvres that are behind its prior."""
    left = [m for m in problem.manoeuvres if m.time > t + SAME * max(abs(t), 1.0)]
    return problem if len(left) == len(problem.manoeuvres) else replace(problem, manoeuvres=left)


def _known(
    problem: Problem, earlier: Earlier, labels: Mapping[str, Label], t: float, first: float
) -> tuple[Problem, tuple[Array, Array]]:
    """The problem with an earlier orbit for its prior, and the belief at the first row with a root of its covariance.

    What that knew of the same processes and constants goes on with its correlations: constants are states then, at rest.
    """
    places = {name: earlier.place(result_name(labels, name), t, first) for name in problem.model.names}
    known = {name: place for name, place in places.items() if place is not None}
    problem = at_rest(problem, [name for name in problem.model.constants if name in known])
    names, parameters = problem.model.states, dict(problem.parameters)
    mean, P = problem.prior.mean.copy(), problem.prior.covariance.copy()
    own = [i for i, name in enumerate(names) if name in known]
    where = [known[names[i]] for i in own]
    J, values = np.eye(len(own)), earlier.mean[where]
    for k, i in enumerate(own):
        if is_coefficient(names[i]):
            parameters[said_name(names[i])] = size = float(values[k])
            values[k] = 0.0 if names[i].endswith(LOGARITHM) else USUAL
            J[k, k] = 1.0 / (size * worth(names[i], values[k])[1])
        if is_node(names[i]):
            sigma = parameters[f"{AIR}sigma"]
            J[k, k], values[k] = 1.0 / sigma, (values[k] - parameters[f"{AIR}mean"]) / sigma
    P[own, :] = P[:, own] = 0.0
    mean[own] = values
    P[np.ix_(own, own)] = J @ earlier.covariance[np.ix_(where, where)] @ J.T
    problem = replace(problem, prior=Gaussian(mean, P), prior_time=t, parameters=parameters)
    from piazzi.estimate.propagation import propagate

    found = propagate(problem, np.array([first]))
    return problem, (found.mean[0], root_of(found.covariance[0]))


def with_prior(given: Setup, states: Array, covariance: Array) -> Setup:
    """The same with states (K, n) to begin from, and a prior about the first of them of this covariance."""
    count = len(given.problem.model.states)
    prior = Gaussian(states[0, :count], covariance[:count, :count])
    return replace(given, problem=given.problem.with_prior(prior, given.problem.prior_time), states=states)


def posed(measured: Measured, chosen: Chosen, guess: Guess) -> Problem:
    """The problem, with its prior at the guess."""
    every = {**chosen.roles, **{name: role for name, (role, _) in measured.parameters.items()}}
    numbers = {**chosen.values, **{name: value for name, (_, value) in measured.parameters.items()}}
    air = chosen.choice.air(measured.epoch, guess.state[:6], guess.epoch - measured.epoch)
    extra = chosen.extra
    every |= {p.state: "fixed" for p in extra.processes}  # until they are states
    functions = {**measured.functions, **extra.functions}
    model = with_processes(
        chosen.forces.model(measured.sensors, every, extra.added, extra.definitions, functions), extra.processes
    )
    mean = np.concatenate([guess.state, np.zeros(len(extra.processes))])
    return Problem(
        model,
        _prior(mean, extra),
        process_noise(extra.processes, len(mean)),
        stations=measured.stations,
        parameters={**numbers, **{p.parameter: p.time for p in extra.processes}},
        manoeuvres=extra.manoeuvres,
        integrator=RungeKutta8(max_step=chosen.max_step),
        functions={**_data(chosen, measured.epoch, air), **functions},
        epoch=measured.epoch,
        name=measured.object,
    )


def _data(chosen: Chosen, epoch: Epoch, air: Any) -> Mapping[str, Any]:
    """Data of the forces; where planets are by series a result says so, once."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EphemerisWarning)
        return chosen.choice.functions(epoch, air)


def scale_of(given: Setup, first: Array) -> Array:
    """Units (n,) of a state: a tenth of distance and speed, and the sigmas of constants before the measurements."""
    sigma = np.sqrt(np.diag(given.problem.covariance)).copy()
    sigma[:3], sigma[3:6] = WIDE * np.linalg.norm(first[:3]), WIDE * np.linalg.norm(first[3:6])
    return np.where(sigma > 0, sigma, 1.0)


def _prior(mean: Array, extra: Extra) -> Gaussian:
    distance, speed = np.linalg.norm(mean[:3]), np.linalg.norm(mean[3:6])
    sigma = np.concatenate([np.full(3, WIDE * distance), np.full(3, WIDE * speed), [p.sigma for p in extra.processes]])
    return Gaussian(mean, np.diag(sigma**2))


def _with_epoch(measured: Measured, at: Epoch | None) -> tuple[Tracking, Array, int]:
    """The tracking with an empty row where the answer is to stand, if there is none; and that epoch's index."""
    tracking, rows = measured.tracking, measured.rows
    if at is None:
        return tracking, rows, len(tracking.times) - 1
    t = at - measured.epoch
    same = np.flatnonzero(np.abs(tracking.times - t) < 1e-9)
    if len(same):
        return tracking, rows, int(same[0])
    place = int(np.searchsorted(tracking.row_times, t))
    blank = np.full((1, tracking.values.shape[1]), np.nan)
    values = np.insert(tracking.values, place, blank, axis=0)
    names = np.insert(tracking.row_stations, place, measured.stations[0].name)
    new = Tracking(np.insert(tracking.row_times, place, t), values, names, epoch=tracking.epoch)
    return new, np.insert(rows, place, -1, axis=0), int(np.searchsorted(new.times, t))


def _followed(problem: Problem, first: Array, begun: float, times: Array, step: float) -> Array:
    """States (K, n) at the times of the orbit that is at `first` when `begun`."""
    gap = float(times[0]) - begun
    if gap:
        nodes = np.linspace(begun, float(times[0]), max(ceil(abs(gap) / step), 1) + 1)
        first = follow(problem, nodes, first, step)[0][-1]
    count = dense_grid(problem, times, step)
    if count:  # which costs a fraction of a step to each epoch
        states = on_dense_grid(problem, times, first, count)[0]
        if np.isfinite(states).all():
            return states
    return follow(problem, times, first, step)[0]


def carried(given: Setup, epoch: Epoch, state: Array) -> Array:
    """State (6,) of another orbit of the same forces, from an epoch to that of the answer, on the axes of the GCRF."""
    begun, end = epoch - given.measured.epoch, float(given.tracking.times[given.solution])
    nodes = np.linspace(begun, end, max(ceil(abs(end - begun) / given.chosen.max_step), 1) + 1)
    first = np.concatenate([state, given.problem.mean[6:]])
    return follow(given.problem, nodes, first, given.chosen.max_step)[0][-1, :6]


def follow(problem: Problem, times: Array, first: Array, step: float) -> tuple[Array, Array]:
    """States (K, n) and transition matrices (K - 1, n, n) at times that increase, or decrease by no more than a step each.

    Raises
    ------
    ValueError
        Where the orbit ends on its way, as at the centre of the Earth.
    """
    if len(times) == 1:
        return first[None, :].copy(), np.empty((0, len(first), len(first)))
    problem.cover(float(min(times[0], times[-1])), float(max(times[0], times[-1])))
    if times[-1] < times[0] and problem.manoeuvres:
        return _backwards(problem, times, first, step)
    with np.errstate(all="ignore"):
        found = arc(problem, np.ascontiguousarray(times), np.asarray(first), Steps(step), derivative=True)
    lost = np.flatnonzero(~np.isfinite(found.x).all(axis=1))
    if len(lost):
        raise ValueError(f"the guess cannot be followed beyond {problem.epoch + float(times[lost[0]])}: it leaves every orbit")
    return found.x, found.Phi


def _backwards(problem: Problem, times: Array, first: Array, step: float) -> tuple[Array, Array]:
    """The same where times decrease: kernels end steps at manoeuvres on the way forwards only, so that these are nodes."""
    edges = np.array([m.time for m in problem.manoeuvres])
    nodes = distinct(np.concatenate([times, edges[(edges < times[0]) & (edges > times[-1])]]))[::-1]
    states, Phi = follow(replace(problem, manoeuvres=()), nodes, first, step)
    where = np.searchsorted(-nodes, -times)
    total = np.empty((len(times) - 1, *Phi.shape[1:]))
    for k, (i, j) in enumerate(zip(where[:-1].tolist(), where[1:].tolist(), strict=True)):
        now = np.eye(len(first))
        for one in Phi[i:j]:
            now = one @ now
        total[k] = now
    return states[where], total
