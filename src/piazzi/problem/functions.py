"""A problem's equations as functions of one state or many."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi import kernels
from piazzi.expressions import evaluate
from piazzi.model.definitions import with_values
from piazzi.problem.checks import Array, numeric

if TYPE_CHECKING:
    from piazzi.problem.problem import Problem


def _states(problem: Problem, x: Any, t: Any) -> tuple[Array, Array, bool]:
    """States (K, n), times (K,), and whether one state was given."""
    n = problem.model.n
    out = np.ascontiguousarray(numeric(x, "state"))
    if out.ndim not in (1, 2) or out.shape[-1] != n:
        raise ValueError(f"state has shape {out.shape}; it must be ({n},) or (K, {n}) ({', '.join(problem.model.names)})")
    many = np.atleast_2d(out)
    times = numeric(t, "time")
    if times.size not in (1, len(many)):
        raise ValueError(f"time has shape {times.shape}; it must be one number or ({len(many)},), one for each state")
    times = np.ascontiguousarray(np.broadcast_to(times.reshape(-1), (len(many),)))
    return many, times, out.ndim == 1


def _rates(problem: Problem, entry: str, x: Any, t: Any, shape: tuple[int, ...]) -> Array:
    if problem.model.discrete:
        raise ValueError("the model is a step, x[k+1], and has no rates: use step()")
    many, times, one = _states(problem, x, t)
    out = np.empty((len(many), *shape))
    library = kernels.load(problem.spec("transition", "rates"))
    getattr(library, entry)(len(many), times, many, problem.given, out)
    return out[0] if one else out


def dynamics(problem: Problem, x: Any, t: Any) -> Array:
    """dx/dt, same shape as the states."""
    return _rates(problem, "evaluate_dynamics", x, t, (problem.model.n,))


def dynamics_jacobian(problem: Problem, x: Any, t: Any) -> Array:
    """F = df/dx, (n, n) or (K, n, n)."""
    return _rates(problem, "evaluate_dynamics_jacobian", x, t, (problem.model.n, problem.model.n))


def step(problem: Problem, x: Any, dt: float, t: Any) -> tuple[Array, Array]:
    """Next states and the derivative of the step."""
    assert problem.integrator is not None
    if not np.isfinite(dt):
        raise ValueError(f"dt is {dt} s; it must be finite")
    many, times, one = _states(problem, x, t)
    n, count = problem.model.n, int(problem.integrator.counts(np.array([abs(float(dt))]))[0])
    out, Phi = np.empty((len(many), n)), np.empty((len(many), n, n))
    library = kernels.load(problem.spec("transition", "functions"))
    library.evaluate_step(len(many), times, float(dt), count, many, problem.given, out, Phi)
    return (out[0], Phi[0]) if one else (out, Phi)


def measure(problem: Problem, station: str, x: Any, t: Any) -> Array:
    """h of one station, (m,) or (K, m)."""
    s = problem.station_index(station)
    many, times, one = _states(problem, x, t)
    out = np.empty((len(many), problem.model.width))
    library = kernels.load(problem.spec("transition", "functions"))
    library.evaluate_measurement(
        len(many), int(problem.station_sensor[s]), times, many, problem.given, problem.station_numbers[s], out
    )
    out = out[:, : len(problem.stations[s].noise)]
    return out[0] if one else out


def measurement_jacobian(problem: Problem, station: str, x: Any, t: Any) -> Array:
    """H = dh/dx of one station, (m, n) or (K, m, n)."""
    s, m, n = problem.station_index(station), problem.model.width, problem.model.n
    many, times, one = _states(problem, x, t)
    out, nu, H = np.empty((len(many), m, n)), np.zeros(m), np.zeros((m, n))
    library = kernels.load(problem.spec("transition", "functions"))
    library.evaluate_measurement_jacobian(
        len(many), int(problem.station_sensor[s]), times, many, problem.given, problem.station_numbers[s], nu, H, out
    )
    out = out[:, : len(problem.stations[s].noise)]
    return out[0] if one else out


def singular_equation(problem: Problem) -> str:
    """A line naming the first equation without a finite value at the prior mean, or "" where all have one."""
    model = problem.model
    values = dict(zip(model.names, problem.mean, strict=True)) | dict(zip(model.given, problem.given, strict=False))
    values = with_values(values | {"t": problem.prior_time or 0.0, "dt": 1.0}, model.definitions)
    at = ", ".join(f"{k} = {v:g}" for k, v in zip(model.names, problem.mean, strict=True))
    for state, equation in zip(model.states, model.dynamics, strict=True):
        if not np.isfinite(evaluate(equation, values)):
            return f"the dynamics of {state!r} have no finite value at the prior mean ({at})"
    for station in problem.stations:
        sensor = model.sensor(station.sensor)
        for component, equation in zip(sensor.components, sensor.equations, strict=True):
            here = with_values(values | dict(station.numbers), sensor.definitions)
            if not np.isfinite(evaluate(equation, here)):
                return f"component {component!r} of station {station.name!r} has no finite value at the prior mean ({at})"
    return ""
