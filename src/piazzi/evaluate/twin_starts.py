"""Where a search for twins begins: the reference turned, mirrored, moved along what is seen worst, and draws from the prior."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations, product

import numpy as np

from piazzi.evaluate.information import NEGLIGIBLE
from piazzi.problem import Problem
from piazzi.problem.checks import Array

_DRAWS, _SEED = 24, 1801
_AXES = 3  # of a space whose reflections and rotations are tried
_WIDEST, _FAR = 2, 30.0  # directions that are seen worst, and how many of their Cramer-Rao sigmas a start lies away


def starts(problem: Problem, first: Array, unit: Array, root: Array) -> Iterator[Array]:
    """Where fits begin; always the same ones.

    In the space of the model's groups of two or three states (position, velocity, ...): quarter turns and reflections of all
    groups together, and in a plane eighths of a turn.  Beside them every state, and every pair of states, with the other sign;
    estimated constants one by one where they are few.  Then far along the directions that measurements see worst, by the
    factor `root` (n, n) of their information in `unit` (n,), and draws from the prior.
    """
    seen = [first]
    for x in (*_turned(problem, first), *_flipped(problem, first), *_widest(first, unit, root), *_drawn(problem)):
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


def _flipped(problem: Problem, first: Array) -> Iterator[Array]:
    """Other signs of one or two values; of constants only where there are no more of them than of states."""
    states = len(problem.model.states)
    turned = len(first) if len(first) <= 2 * states else states
    for size in (1, 2):
        for which in combinations(range(turned), size):
            x = first.copy()
            x[list(which)] *= -1.0
            yield x


def _widest(first: Array, unit: Array, root: Array) -> Iterator[Array]:
    """Both ways along the directions that are seen worst; one prior sigma along those that are not seen at all."""
    _, values, directions = np.linalg.svd(root)
    for value, direction in zip(values[::-1][:_WIDEST], directions[::-1], strict=False):
        length = _FAR / value if value > NEGLIGIBLE * values[0] else 1.0
        yield from (first + unit * direction * length, first - unit * direction * length)


def _drawn(problem: Problem) -> Iterator[Array]:
    values, vectors = np.linalg.eigh(problem.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(_SEED)
    for _ in range(_DRAWS):
        yield problem.mean + root @ rng.standard_normal(len(values))
