"""Other first states that give the same measurements, found by fitting from many starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product
from typing import Any

import numpy as np

from piazzi.evaluate.information import factor, from_first, predicted, propagated
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

LISTED = 1.0  # RMS difference, in sigma of a measurement, up to which another solution is worth telling
SAME = 3.0  # solutions whose measurements differ by less than this many sigma in all, to first order, are one
_DRAWS, _SEED = 24, 1801
_ITERATIONS = 40
_SEARCHED = 2000  # epochs of the search; what it finds is then fitted to all
_WORK = 1_000_000  # epochs that such a fit may pass in all
_FEWEST = 4  # times that it may pass all of them, however many there are
_AXES = 3  # of a space whose reflections and rotations are tried


@dataclass(frozen=True, eq=False)
class Twin:
    """Another first state with (nearly) the same measurements.

    Attributes
    ----------
    state : (n,), SI units
    misfit : RMS over all measurements of the difference from those of the reference, in sigma
    prior_distance : sigmas between this state and the prior mean, None where the prior is certain about some value
    """

    state: Array
    misfit: float
    prior_distance: float | None

    def to_dict(self) -> dict[str, Any]:
        """The twin as JSON keeps it."""
        return {"state": self.state.tolist(), "misfit": self.misfit, "prior_distance": self.prior_distance}


def find_twins(problem: Problem, inputs: Inputs, first: Array, unit: Array, root: Array) -> tuple[Twin, ...]:
    """Twins of the orbit that leaves from `first` (n,), best first; the orbit is without process noise.

    Each start is fitted to the noiseless measurements of the reference by Levenberg-Marquardt in units of `unit` (n,).  With
    process noise a filter follows the measurements from there, and its innovations are compared instead.

    Parameters
    ----------
    root : (n, n), triangular factor of the Fisher information in those units: tells whether two states are the same solution
    """
    whole = _noiseless(problem, inputs, first)
    if whole is None:
        return ()
    begun = _head(whole, _SEARCHED)
    found: list[Array] = []
    for start in starts(problem, first):
        state, misfit = fit(problem, begun, start, unit, _ITERATIONS)
        if misfit <= LISTED and all(_differ(state, other, unit, root) for other in (first, *found)):
            found.append(state)
    if begun is not whole:
        few = max(_FEWEST, _WORK // whole.epochs)
        found = [fit(problem, whole, state, unit, _ITERATIONS, few)[0] for state in found]
    twins = [Twin(s, _misfit(problem, whole, s), _prior_distance(problem, s)) for s in found]
    twins.sort(key=lambda twin: (round(twin.misfit, 6), twin.state.tolist()))
    kept: list[Twin] = []
    for twin in twins:
        if twin.misfit <= LISTED and all(_differ(twin.state, o, unit, root) for o in (first, *(k.state for k in kept))):
            kept.append(twin)
    return tuple(kept)


def fit(
    problem: Problem, inputs: Inputs, start: Array, unit: Array, iterations: int, passes: float = np.inf
) -> tuple[Array, float]:
    """The first state (n,) near `start` that fits best, and its misfit, infinite where none has a finite one.

    It takes so many iterations at most, and passes over the measurements.
    """
    x, damping = np.array(start, dtype=float), 1e-3
    with np.errstate(all="ignore"):
        shot = from_first(problem, inputs, x)
        r, cost = _residuals(shot.innovations)
        for _ in range(iterations):
            if not np.isfinite(cost) or cost < 1e-16 * len(r):
                break
            if not np.isfinite(shot.rows).all():
                break
            T = factor(np.column_stack([shot.rows * unit, r]))  # the same least squares in n + 1 rows
            J, rest = T[:, :-1], T[:, -1]
            scale = np.linalg.norm(J, axis=0)
            ridge = np.diag(np.where(scale > 0, scale, 1.0))
            while damping < 1e9 and passes > 1:
                passes -= 1
                step = np.linalg.lstsq(np.vstack([J, np.sqrt(damping) * ridge]), np.append(rest, 0.0 * scale), rcond=None)[0]
                trial = from_first(problem, inputs, x + unit * step)
                r_new, cost_new = _residuals(trial.innovations)
                if cost_new < cost:
                    break
                damping *= 10.0
            else:
                break
            small = cost - cost_new < 1e-9 * cost
            x, shot, r, cost, damping = x + unit * step, trial, r_new, cost_new, max(damping / 10.0, 1e-9)
            if small:
                break
    return x, float(np.sqrt(cost / max(len(r), 1))) if np.isfinite(cost) else np.inf


def starts(problem: Problem, first: Array) -> Iterator[Array]:
    """Where fits begin: reflections and rotations of the reference, then draws from the prior; always the same ones.

    In the space of the model's groups of two or three states (position, velocity, ...): quarter turns and reflections of all
    groups together, and in a plane eighths of a turn.  Beside them every state, and every pair of states, with the other sign.
    """
    n = len(first)
    seen = [first]
    for x in (*_turned(problem, first), *_flipped(first), *_drawn(problem, n)):
        if not any(np.array_equal(x, other) for other in seen):
            seen.append(x)
            yield x


def _turned(problem: Problem, first: Array) -> Iterator[Array]:
    groups = [g for g in problem.model.group_indices.values() if 2 <= len(g) <= _AXES]
    for d in sorted({len(g) for g in groups}):
        for turn in _turns(d):
            x = first.copy()
            for g in (g for g in groups if len(g) == d):
                x[list(g)] = turn @ first[list(g)]
            yield x


def _turns(d: int) -> Iterator[Array]:
    """Orthogonal matrices (d, d): eighths of a turn and their reflections in a plane, the symmetries of a cube in space."""
    if d == 2:
        for angle in np.arange(8) * (np.pi / 4):
            c, s = np.cos(angle), np.sin(angle)
            yield from (np.array([[c, -s], [s, c]]), np.array([[c, s], [s, -c]]))
        return
    for order in permutations(range(d)):
        for signs in product((1.0, -1.0), repeat=d):
            yield np.eye(d)[list(order)] * np.array(signs)


def _flipped(first: Array) -> Iterator[Array]:
    for size in (1, 2):
        for which in combinations(range(len(first)), size):
            x = first.copy()
            x[list(which)] *= -1.0
            yield x


def _drawn(problem: Problem, n: int) -> Iterator[Array]:
    values, vectors = np.linalg.eigh(problem.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(_SEED)
    for _ in range(_DRAWS):
        yield problem.mean + root @ rng.standard_normal(n)


def _noiseless(problem: Problem, inputs: Inputs, first: Array) -> Inputs | None:
    """The same run with the noiseless measurements of the orbit from `first`; None where that is not finite."""
    with np.errstate(all="ignore"):
        z = predicted(problem, inputs, propagated(problem, inputs, first))
    z = np.where(np.isnan(inputs.z), np.nan, z)
    return replace(inputs, z=z) if np.isfinite(z[~np.isnan(inputs.z)]).all() else None


def _head(inputs: Inputs, epochs: int) -> Inputs:
    """The run up to so many epochs; itself where it is no longer."""
    if inputs.epochs <= epochs:
        return inputs
    last = inputs.first_row[epochs]
    return Inputs(
        np.ascontiguousarray(inputs.t[:epochs]),
        inputs.t_prior,
        np.ascontiguousarray(inputs.count[:epochs]),
        np.ascontiguousarray(inputs.scale[:epochs]),
        np.ascontiguousarray(inputs.first_row[: epochs + 1]),
        np.ascontiguousarray(inputs.z[:last]),
        np.ascontiguousarray(inputs.station[:last]),
    )


def _residuals(innovations: Array) -> tuple[Array, float]:
    """Innovations as one vector, missing ones as zero, and their sum of squares (of a failed filter: infinite)."""
    r = innovations.reshape(-1)
    r = np.where(np.isnan(r), 0.0, r)
    cost = float(r @ r)
    return r, cost if np.isfinite(cost) else np.inf


def _misfit(problem: Problem, inputs: Inputs, state: Array) -> float:
    with np.errstate(all="ignore"):
        nu = from_first(problem, inputs, state).innovations
    there = int((~np.isnan(inputs.z)).sum())
    return float(np.sqrt(_residuals(nu)[1] / max(there, 1)))


def _differ(a: Array, b: Array, unit: Array, root: Array) -> bool:
    """Whether two states are different solutions: farther apart than measurements could hide to first order."""
    return bool(np.linalg.norm(root @ ((a - b) / unit)) > SAME)


def _prior_distance(problem: Problem, state: Array) -> float | None:
    sigma = np.sqrt(np.diag(problem.covariance))
    if not sigma.min() > 0:
        return None
    values, vectors = np.linalg.eigh(problem.covariance / np.outer(sigma, sigma))
    if values.min() <= 1e-13:
        return None
    return float(np.linalg.norm(vectors.T @ ((state - problem.mean) / sigma) / np.sqrt(values)))
