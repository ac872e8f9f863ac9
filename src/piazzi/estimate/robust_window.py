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


def loss_numbers(problem: Problem, loss: Loss | None) -> Array:
    """A loss as kernels take it: its kind, and the squares of its constant for rows of 0 ... M components."""
    return np.zeros(1) if loss is None else np.array([loss.kind, *loss.squares(problem.model.width)], dtype=float)
