"""Where steps that shrink slowly, or not at all, lead: the fixed point that the last of them point at."""

from __future__ import annotations

import numpy as np

from piazzi.estimate.chain import Chain
from piazzi.problem.checks import Array

SLOW = 0.2  # of the step before, or more: Gauss-Newton converges linearly, or repels
NEAR = 1.0  # sigma: steps beyond say nothing about a fixed point
DEPTH = 12  # earlier steps that are looked at
WORSE = 10.0  # times the step before: what came earlier belongs to another place


class Extrapolation:
    """Anderson's mixing (Journal of the ACM 12, 1965; Walker and Ni, SIAM Journal on Numerical Analysis 49, 2011).

    Gauss-Newton leaves the second derivatives of the residuals out, so near a solution each step is a linear function of the
    error, whose slope is -1 in most directions and anything in a few.  From m + 1 states and the steps from them, the states
    are found at which that linear function is nearest to zero.  A few repelling directions thus cost a few more steps; no
    gradient is needed, and what all steps obey, such as dynamics without noise, holds.
    """

    def __init__(self) -> None:
        self._past: list[tuple[Array, Array]] = []
        self._size, self._slow = np.inf, False

    def step(self, chain: Chain, size: float) -> Array | None:
        """The step (K, n) from where the chain is, whose undamped step has this size; None where its own will do."""
        before, self._size = self._size, size
        if not size < NEAR:
            self._past, self._slow = [], False
            return None
        if size > WORSE * before:
            self._past = []
        self._slow = self._slow or size > SLOW * before
        self._past = [*self._past[-DEPTH:], (chain.x.copy(), chain.dx.copy())]
        return self._mixed(chain) if self._slow and len(self._past) > 1 else None

    def _mixed(self, chain: Chain) -> Array:
        moves, changes = (np.diff(np.array(a), axis=0) for a in zip(*self._past, strict=True))
        columns = np.array([chain.in_sigmas(change) for change in changes])
        scale = np.linalg.norm(columns, axis=1)
        scale = np.where(scale > 0, scale, 1.0)
        weights = np.linalg.lstsq((columns / scale[:, None]).T, chain.in_sigmas(chain.dx), rcond=1e-10)[0] / scale
        return np.asarray(chain.dx - np.tensordot(weights, moves + changes, axes=1))
