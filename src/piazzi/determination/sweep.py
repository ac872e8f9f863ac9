"""An orbit with its derivatives by its first state: in steps as long as it allows, and between them by a polynomial.

Within a pass epochs are seconds apart, where a step of order 8 may take half a minute: one step for each would cost more than
the orbit.  A multi-step grid costs least; where kinks forbid it, steps are of order 8, and between their ends positions, and
their derivatives by the first state, are those of the polynomial of degree 7 through the four nearest ends, which knows their
rates too.
"""

from __future__ import annotations

from math import ceil

import numpy as np

from piazzi.determination.guesses import CARTESIAN
from piazzi.determination.setup import follow
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.dense import dense_grid, on_dense_grid, products

ENDS = 4  # of steps, which a polynomial goes through
WORTH = 1.2  # times the steps, above which the polynomials cost less


def swept(problem: Problem, times: Array, first: Array, step: float) -> tuple[Array, Array]:
    """States (K, n) at increasing times, and their derivatives (K, n, n) by the first of them.

    Raises
    ------
    ValueError
        Where the orbit ends on its way.
    """
    grid = dense_grid(problem, times, step)
    if grid:
        x, W = on_dense_grid(problem, times, first, grid)
        if np.isfinite(x).all():
            return x, W
    span = float(times[-1] - times[0])
    count = ceil(span / step)
    if not (_smooth(problem) and count >= ENDS and np.ceil(np.diff(times) / step).sum() > WORTH * count):
        x, Phi = follow(problem, times, first, step)
        return x, products(Phi)
    x, Phi = follow(problem, times[0] + np.arange(count + 1) * (span / count), first, step)
    W = products(Phi)
    n = len(first)
    ends = np.concatenate([x[:, :6, None], W[:, :6]], axis=2)  # beside the states, their derivatives
    found = _between(ends.reshape(count + 1, 2, -1), (times - times[0]) * (count / span), span / count)
    found = found.reshape(len(times), 6, 1 + n)
    states, derivatives = np.tile(first, (len(times), 1)), np.tile(np.eye(n), (len(times), 1, 1))
    states[:, :6], derivatives[:, :6] = found[..., 0], found[..., 1:]
    states[0], derivatives[0] = first, np.eye(n)
    return states, derivatives


def _smooth(problem: Problem) -> bool:
    """Whether only position and velocity change, by forces without jumps."""
    still = not (problem.manoeuvres or problem.model.events or "burning" in problem.functions)
    return still and problem.model.states == tuple(CARTESIAN) and problem.is_noise_free


def _between(ends: Array, place: Array, h: float) -> Array:
    """Values and rates (K, 2, m) at places in steps (K,), from those at the ends of all steps of `h` seconds (G, 2, m)."""
    start = np.clip(np.floor(place).astype(int) - (ENDS // 2 - 1), 0, len(ends) - ENDS)
    u, at = place - start, np.arange(float(ENDS))
    others = [[m for m in range(ENDS) if m != j] for j in range(ENDS)]
    weights = np.empty((len(u), 2, ENDS, 2))
    for j, rest in enumerate(others):
        scale = np.prod(at[j] - at[rest])
        L = np.prod(u[:, None] - at[rest], axis=1) / scale
        slope = sum(np.prod(u[:, None] - at[[m for m in rest if m != k]], axis=1) for k in rest) / scale
        own, d = float(np.sum(1.0 / (at[j] - at[rest]))), u - at[j]
        weights[:, 0, j, 0], weights[:, 0, j, 1] = (1.0 - 2.0 * own * d) * L**2, h * d * L**2
        weights[:, 1, j, 0] = (-2.0 * own * L**2 + (1.0 - 2.0 * own * d) * 2.0 * L * slope) / h
        weights[:, 1, j, 1] = L**2 + d * 2.0 * L * slope
    near = ends[start[:, None] + np.arange(ENDS)].reshape(len(u), 2 * ENDS, -1)
    return np.asarray(weights.reshape(len(u), 2, 2 * ENDS) @ near)
