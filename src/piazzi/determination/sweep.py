"""An orbit with its derivatives by its first state: in steps as long as it allows, and between them by a polynomial.

Within a pass epochs are seconds apart, where a step of order 8 may take half a minute: one step for each would cost more than
the orbit.
"""

from __future__ import annotations

import numpy as np

from piazzi.determination.setup import follow
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.dense import dense_grid, on_dense_grid, products


def swept(problem: Problem, times: Array, first: Array, step: float) -> tuple[Array, Array]:
    """States (K, n) at increasing times, and their derivatives (K, n, n) by the first of them.

    Raises
    ------
    ValueError
        Where the orbit ends on its way.
    """
    count = dense_grid(problem, times, step)
    if count:
        x, W = on_dense_grid(problem, times, first, count)
        if np.isfinite(x).all():
            return x, W
    x, Phi = follow(problem, times, first, step)  # which says where an orbit ends
    return x, products(Phi)
