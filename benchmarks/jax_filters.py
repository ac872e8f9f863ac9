"""The founding filter over many runs at once in libraries that compile through JAX: the same step, wrapped bearings, float64.

Each function gives a call that has been compiled for its arguments already and returns the last means, (M, 4).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax import numpy as jnp

import piazzi as pz

jax.config.update("jax_enable_x64", True)
MU = 3.986e14  # m^3/s^2


def in_dynamax(problem: pz.Problem, tracking: pz.Tracking, z: np.ndarray) -> Callable[[], np.ndarray]:
    """``extended_kalman_filter`` of dynamax, which derives the Jacobians itself."""
    from dynamax.nonlinear_gaussian_ssm import ParamsNLGSSM, extended_kalman_filter

    dt, substeps = _interval(problem, tracking)
    params = ParamsNLGSSM(
        initial_mean=jnp.array(problem.mean),
        initial_covariance=jnp.array(problem.covariance),
        dynamics_function=lambda x, seen: _travel(x, dt, substeps),
        dynamics_covariance=jnp.array(problem.process_noise.covariance * dt),
        emission_function=_near,
        emission_covariance=jnp.array(problem.stations[0].noise),
    )

    def last(seen: Any) -> Any:
        fields = ["filtered_means", "filtered_covariances"]
        return extended_kalman_filter(params, seen, inputs=seen, output_fields=fields).filtered_means[-1]

    return _compiled(last, z)


def in_cuthbert(problem: pz.Problem, tracking: pz.Tracking, z: np.ndarray) -> Callable[[], np.ndarray]:
    """The filter linearised by moments of cuthbert, in square-root form; its first step stays where it is."""
    from cuthbert import filter as run_filter
    from cuthbert.gaussian import moments

    dt, substeps = _interval(problem, tracking)
    root_P, root_R = jnp.linalg.cholesky(problem.covariance), jnp.linalg.cholesky(problem.stations[0].noise)
    root_Q = jnp.linalg.cholesky(problem.process_noise.covariance * dt)

    def dynamics(state: Any, inputs: Any) -> Any:
        moves = inputs["moves"]
        return lambda x: (jnp.where(moves, _travel(x, dt, substeps), x), moves * root_Q), state.mean

    def observation(state: Any, inputs: Any) -> Any:
        seen = inputs["seen"]
        return lambda x: (_near(x, seen), root_R), state.mean, seen

    kalman = moments.build_filter(jnp.array(problem.mean), root_P, dynamics, observation)
    moves = jnp.arange(z.shape[1]) > 0

    def last(seen: Any) -> Any:
        return run_filter(kalman, {"moves": moves, "seen": seen}, kalman.init_prepare()).mean[-1]

    return _compiled(last, z)


def _interval(problem: pz.Problem, tracking: pz.Tracking) -> tuple[float, int]:
    dt = float(tracking.times[1] - tracking.times[0])
    assert problem.integrator is not None
    return dt, int(problem.integrator.counts(np.array([dt]))[0])


def _travel(x: Any, dt: float, substeps: int) -> Any:
    """The state `dt` seconds later by second-order Taylor substeps."""
    h = dt / substeps

    def substep(_: int, x: Any) -> Any:
        position, velocity = x[:2], x[2:]
        pull = -MU * position / (position @ position) ** 1.5
        return jnp.concatenate([position + h * velocity + 0.5 * h * h * pull, velocity + h * pull])

    return jax.lax.fori_loop(0, substeps, substep, x)


def _near(x: Any, seen: Any) -> Any:
    """The bearing, in the turn of the one that was measured."""
    off = jnp.arctan2(x[1], x[0]) - seen
    return seen + off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))


def _compiled(last: Callable[[Any], Any], z: np.ndarray) -> Callable[[], np.ndarray]:
    many = jax.jit(jax.vmap(last)).lower(jnp.array(z)).compile()
    return lambda: np.asarray(many(jnp.array(z)))
