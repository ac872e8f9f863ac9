"""An orbit without noise whose epochs are dense, with its derivatives by the first state: on a multi-step grid of its own."""

from __future__ import annotations

import re
from functools import lru_cache
from math import ceil, isqrt

import numpy as np

from piazzi import kernels
from piazzi.kernels.multistep import second_order
from piazzi.model import Model
from piazzi.problem.arcs import FEWEST, spec_of
from piazzi.problem.checks import Array
from piazzi.problem.problem import Problem
from piazzi.problem.stepping import STAGES

FINER, RESOLVED = 1.5, 20  # steps of the multi-step method for one of order 8; more for fields beyond a degree of 30
KINKED = 40.0  # s: the longest of them where forces have kinks
SHORT = 20.0  # s: steps of order 8 that leave less than a millimetre at the edges of shadows in days of LAGEOS-2
KINKS = re.compile(r"\b(?:abs|sign|min|max|heaviside)\(")
WORTH = 3  # times the evaluations of a grid, from which on it is the faster way by far
BEGINNING = 10  # steps of order 8 that a grid begins with


def dense_grid(problem: Problem, times: Array, step: float) -> int:
    """Steps of a grid instead of steps of order 8 of so many seconds, and one at least to each epoch; 0 where these are better.

    For forces that are dear and without jumps, so that nothing interrupts the multi-step method.  Kinks, as the edges of
    shadows, need short steps: in 2.75 days of LAGEOS-2 those of 20, 40, 80 s leave 2, 8, 73 mm, of order 8 and 120 s 3 mm.
    """
    smooth = not (problem.manoeuvres or problem.model.events or "burning" in problem.functions)
    if not (smooth and problem.functions and problem.is_noise_free and second_order(problem.model)):
        return 0
    degree = max((getattr(f, "degree", None) or 0 for f in problem.functions.values()), default=0)
    longest = step / max(FINER, degree / RESOLVED)
    if longest > KINKED and kinked(problem.model):
        return 0
    count = int(np.ceil((times[-1] - times[0]) / longest))
    alone = STAGES * np.ceil(np.diff(times) / step).sum()
    return count if count >= FEWEST and alone >= WORTH * (count + STAGES * BEGINNING) else 0


def within_kinks(model: Model, step: float) -> float:
    """The step of order 8 (s) of orbits between epochs, no longer than kinks of the forces allow, as edges of shadows are."""
    return min(step, SHORT) if kinked(model) else step


@lru_cache(maxsize=64)
def kinked(model: Model) -> bool:
    """Whether the motion calls a function that has jumps or kinks."""
    texts = [*model.dynamics, *(text for one in model.definitions for text in one.texts)]
    return any(KINKS.search(str(text)) for text in texts)


def on_dense_grid(problem: Problem, times: Array, first: Array, count: int) -> tuple[Array, Array]:
    """States (K, n) at increasing times, and their derivatives (K, n, n) by the first of them, in so many equal steps.

    Between the steps' ends they lie on the polynomial through the rates, whose order is the method's.
    """
    problem.cover(float(times[0]), float(times[-1]))
    K, n = len(times), len(first)
    x, W, last = np.empty((K, n)), np.empty((K, n, n)), np.empty((n, n))
    x[0], W[0] = first, np.eye(n)
    scheme = kernels.GaussJackson(max_step=1.0).arc_scheme
    fragments = ("matrices", "arc_unwatched", "gauss_jackson_rows", "gauss_jackson_whole", "gauss_jackson")
    library = kernels.load(spec_of(problem, scheme, fragments))
    done = np.array([count, K - 1, times[-1]])
    library.run_multistep(K, np.ascontiguousarray(times), count, problem.given_bundle, x, W, done, last)
    return x, W


def products(Phi: Array) -> Array:
    """Derivatives (K, n, n) by the first state, of transition matrices (K - 1, n, n): the first is a unit matrix.

    In blocks of about the root of their number, all blocks at once, then from block to block.
    """
    many, n = len(Phi), Phi.shape[-1]
    size = max(isqrt(many), 1)
    blocks = ceil(many / size)
    out = np.tile(np.eye(n), (blocks * size + 1, 1, 1))
    out[1 : many + 1] = Phi
    own = out[1:].reshape(blocks, size, n, n)
    for k in range(1, size):
        own[:, k] = own[:, k] @ own[:, k - 1]
    for b in range(1, blocks):
        own[b] = own[b] @ own[b - 1, -1]
    return out[: many + 1]
