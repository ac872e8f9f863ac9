"""Draw a truth and measurements of it."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.problem import Problem, Tracking, Truth
from piazzi.problem.arcs import arc
from piazzi.problem.checks import Array, check_span, finite_vector, numeric
from piazzi.problem.gaps import is_restricted
from piazzi.problem.inputs import Inputs, wrapped
from piazzi.problem.lost_root import check_roots
from piazzi.problem.truth import true_problem
from piazzi.simulation.long_gaps import gap_warning
from piazzi.simulation.rule import MOST_DRAWS, NoTruthError, Rule
from piazzi.simulation.visibility import rules, seen

__all__ = [
    "MOST_DRAWS",
    "NoTruthError",
    "Rule",
    "check_finite",
    "check_times",
    "is_restricted",
    "placed",
    "propagate",
    "rules",
    "seen",
    "simulate",
    "true_problem",
]


def simulate(problem: Problem, times: Any, rng: np.random.Generator, stations: Sequence[str] | None = None) -> Tracking:
    """A tracking with truth, drawn from the problem (from its `truth` half where that says otherwise).

    Parameters
    ----------
    problem : Problem
    times : (K,) seconds, strictly increasing
    rng : numpy.random.Generator
        The same generator state gives the same bytes.  Draws, in order: first state, process noise, measurement noise.  Rows
        that are not measured have draws too, so that no rule of who sees what changes the noise of another row.
    stations : names, optional
        Who measures; default all: at every time, or where the rules of their sensors and their schedules have it.

    Raises
    ------
    ValueError
        For bad times, unknown stations, a truth that becomes infinite, a root without a solution, or nothing to be seen.
    """
    epochs = check_times(times)
    truth_half = problem.truth or Truth()
    actual = true_problem(problem)
    index = np.array([problem.station_index(s) for s in (stations or [s.name for s in problem.stations])], dtype=np.int64)
    if not index.size:
        raise ValueError("the problem has no stations, so nothing can be measured")
    K, n, M = len(epochs), problem.model.n, problem.model.width
    first = _first_state(problem, actual, truth_half, rng)
    w = rng.standard_normal((K, n))
    v = rng.standard_normal((K * len(index), M))
    states, z = propagate(problem, actual, epochs, index, first, w, v if truth_half.measurement_noise else None)
    names = np.array([s.name for s in problem.stations])[np.tile(index, K)] if len(problem.stations) > 1 else None
    whole = Tracking(np.repeat(epochs, len(index)), z, names, states, problem.epoch)
    marks = seen(actual, epochs, states)[:, index]
    check_roots(actual, epochs, index, states, z, marks)
    if not is_restricted(problem):
        return whole
    tracking = _measured(problem, whole, marks)
    if told := gap_warning(problem, tracking):
        warnings.warn(told, stacklevel=2)
    return tracking


def _measured(problem: Problem, whole: Tracking, marks: Array) -> Tracking:
    """The rows that are marked, (K, S).

    Where the prior is at the first epoch, whichever that is, it stays, as a row without a value, to be the same as simulated;
    so does every epoch where what happens between two depends on which they are: steps, memories, noise per step.
    """
    if not marks.any():
        said = rules(problem, range(len(problem.stations)))
        raise ValueError(f"no station sees anything at these {len(whole.times)} times: {said}")
    z = np.where(marks.reshape(-1, 1), whole.values, np.nan)
    rows = marks.copy()
    model, noise = problem.model, problem.process_noise
    if model.discrete or model.memory or (noise.per == "step" and noise.covariance.any()):
        rows[~rows.any(axis=1), 0] = True
    elif problem.prior_time is None:
        rows[0, 0] |= not rows[0].any()
    kept, flat = rows.any(axis=1), rows.reshape(-1)
    names = None if whole.row_stations is None else whole.row_stations[flat]
    return Tracking(whole.row_times[flat], z[flat], names, whole.truth[kept], whole.epoch)


def propagate(
    problem: Problem, actual: Problem, epochs: Array, index: Array, first: Array, w: Array, v: Array | None
) -> tuple[Array, Array]:
    """True states (K, n) and measurements (J, m) that follow from a first state and unit normal draws.

    Parameters
    ----------
    problem, actual : Problem as it is measured, and as it moves
    epochs : (K,)
    index : which stations measure, at every epoch
    first : (n,), the true state at the time of the prior
    w : (K, n), for process noise
    v : (J, m), for measurement noise; None for sensors without error

    Raises
    ------
    ValueError
        For a truth that becomes infinite.
    """
    K, n, M = len(epochs), problem.model.n, problem.model.width
    start, count, scale = actual.intervals(epochs)
    row_station, first_row = np.tile(index, K), np.arange(K + 1, dtype=np.int64) * len(index)
    states, z = np.empty((K, n)), np.empty((K * len(index), M))
    actual.cover(start, float(epochs[-1]))
    run, p, measured, _ = Inputs(epochs, start, count, scale, first_row, z, row_station).bundles(actual)
    if actual.is_noise_free:
        nodes = np.append(start, epochs) if start < epochs[0] else epochs
        states[:] = arc(actual, nodes, first, actual.steps(start, float(epochs[-1]), first), derivative=False).x[-K:]
        kernels.load(actual.spec("transition", "measurements")).run_measurements(run, p, measured, states)
    else:
        library = kernels.load(actual.spec("transition", actual.noise_fragment, "simulate"))
        library.run_simulation(run, p, measured, first, w, np.empty((n, n)), states)
    check_finite(problem, epochs, first, states)
    if v is not None:
        noise = np.einsum("jab,jb->ja", np.linalg.cholesky(problem.station_noise)[row_station], v)
        z += noise / on_sky(problem, row_station, z)
    return states, wrapped(problem, row_station, z)


def check_finite(problem: Problem, epochs: Array, first: Array, states: Array) -> None:
    """Raise ValueError, saying where it began, for a truth (K, n) that is not finite."""
    if not np.isfinite(states).all():
        k = int(np.argmin(np.isfinite(states).all(axis=1)))
        start_text = ", ".join(f"{name} = {value:g}" for name, value in zip(problem.model.names, first, strict=True))
        raise ValueError(f"the simulated truth is not finite from epoch {k} (t = {epochs[k]:g} s); it started at {start_text}")


def _first_state(problem: Problem, actual: Problem, truth: Truth, rng: np.random.Generator) -> Array:
    """The true first state: as given, or drawn from the prior; estimated constants are drawn unless their truth is given.

    Where the truth has a rule about which of them count, the first that it accepts.
    """
    rule = Rule(truth.accept, actual)
    values, vectors = np.linalg.eigh(actual.covariance)
    for _ in range(MOST_DRAWS):
        draw = rng.standard_normal(problem.model.n)
        x = actual.mean + vectors @ (np.sqrt(np.maximum(values, 0.0)) * (vectors.T @ draw))
        x = placed(problem, truth, x[None])
        if rule.accepts(x)[0]:
            first: Array = x[0]
            return first
    raise NoTruthError(rule)


def placed(problem: Problem, truth: Truth, x: Array) -> Array:
    """First states (M, n) drawn from the prior, with what the truth fixes, and memories of what they remember."""
    states = problem.model.states
    if truth.state is not None:
        x[:, : len(states)] = finite_vector(truth.state, len(states), "true state", states)
    moving = len(problem.model.moving)
    x[:, :moving] = x[:, list(problem.model.sources)]
    out: Array = np.ascontiguousarray(x)
    return out


def check_times(times: Any) -> Array:
    """Times as (K,) numbers; raises ValueError unless they are finite and increase."""
    out = np.ascontiguousarray(numeric(times, "times").reshape(-1))
    if not out.size:
        raise ValueError("there are no times to simulate")
    if not np.isfinite(out).all():
        raise ValueError(f"time {int(np.argmin(np.isfinite(out)))} is not finite")
    down = np.flatnonzero(out[1:] <= out[:-1])
    if down.size:
        k = int(down[0]) + 1
        raise ValueError(f"times must increase: time {k} is {out[k]:g} s, after {out[k - 1]:g} s")
    check_span(out[0], out[-1], f"time {len(out) - 1}")
    return out


def on_sky(problem: Problem, row_station: Array, z: Array) -> Array:
    """What innovations of the measurements (J, M) are multiplied by, 1 but for angles that are on the sky."""
    out = np.ones(z.shape)
    for s, station in enumerate(problem.stations):
        for i, partner in enumerate(problem.model.sensor(station.sensor).circle):
            if partner is not None:
                out[row_station == s, i] = np.cos(z[row_station == s, partner])
    return out
