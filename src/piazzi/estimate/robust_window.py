"""What the kernels of a sliding window need where there is a loss."""

from __future__ import annotations

import numpy as np

from piazzi.estimate.chain import chain_fragments
from piazzi.estimate.losses import Loss
from piazzi.problem import Problem
from piazzi.problem.checks import Array


def window_fragments(problem: Problem, loss: Loss | None, *last: str) -> tuple[str, ...]:
    """Fragments of a sliding window; those for a loss stand in place of those whose functions they replace."""
    parts = chain_fragments(problem)
    if loss is None:
        return (*parts, "window_prior", "window_step", *last)
    rest = (name for name in parts if name != "linearize")
    return (*rest, "epoch_guarded", "linearize_robust", "window_prior", "window_step_robust", *last)


def row_space(problem: Problem, loss: Loss | None, rows: int) -> Array:
    """Work space of linearised rows; with a loss, its numbers and the weights of so many rows behind it."""
    M, N = problem.model.width, problem.model.n
    factors = np.empty(M * (M + N))
    return factors if loss is None else np.concatenate([factors, [loss.kind], loss.squares(M), np.ones(rows)])


def row_weights(space: Array, rows: int) -> Array:
    """The weights of so many rows in that work space, (rows,)."""
    return space[len(space) - rows :].copy()
