"""What a tracking says about the first state: rows of a square root of its Fisher information, and factors of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.evaluate.quantities import finite
from piazzi.kernels.bundle import Noiseless, Observation
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

_BLOCK = 1 << 14  # rows factored at a time
# singular values below this share of the largest are rounding errors of the rows
NEGLIGIBLE = 1e-11


@dataclass(frozen=True, eq=False)
class Shot:
    """A filter that starts from one state for certain.

    Attributes
    ----------
    innovations : (J, m), whitened, NaN where missing
    rows : (J * m, n), minus their derivative by the first state, zero where missing: a root of the Fisher information
    states : (K, n), those about which measurements were predicted
    """

    innovations: Array
    rows: Array
    states: Array


@dataclass(frozen=True, eq=False)
class Information:
    """Fisher information of the first state as the singular values of its root, each state in units of its prior sigma.

    A singular value s of a direction means that measurements alone tell it to 1/s prior sigmas.

    Attributes
    ----------
    singular_values : (n,), falling, zero where a direction cannot be seen
    directions : (n, n), the unit vector of each singular value in a row, states in units of `Observability.scale`
    crlb_sigma : (n,), Cramer-Rao standard deviation of each state, SI units, infinite where it cannot be seen
    """

    singular_values: Array
    directions: Array
    crlb_sigma: Array

    @property
    def condition(self) -> float:
        """Largest singular value over smallest, infinite where one is zero."""
        low = float(self.singular_values[-1])
        return float(self.singular_values[0]) / low if low > 0 else float("inf")

    @property
    def blind(self) -> int:
        """How many directions cannot be seen."""
        return int((self.singular_values == 0).sum())

    def to_dict(self) -> dict[str, Any]:
        """The information as JSON keeps it."""
        return {
            "singular_values": self.singular_values.tolist(),
            "condition": finite(self.condition),
            "crlb_sigma": [finite(v) for v in self.crlb_sigma.tolist()],
        }


def along(problem: Problem, inputs: Inputs, states: Array) -> Shot:
    """Linearised about given states (K, n)."""
    return _observe(problem, inputs, np.array(states, dtype=float, order="C"), follow=False)


def from_first(problem: Problem, inputs: Inputs, first: Array) -> Shot:
    """Linearised about what the filter makes of the measurements when it starts from this state (n,)."""
    states = np.empty((inputs.epochs, problem.model.n))
    states[0] = first
    return _observe(problem, inputs, states, follow=True)


def propagated(problem: Problem, inputs: Inputs, first: Array) -> Array:
    """States (K, n) of the orbit from this first state (n,), without process noise and without measurements."""
    return from_first(problem, replace(inputs, z=np.full_like(inputs.z, np.nan)), first).states


def predicted(problem: Problem, inputs: Inputs, states: Array) -> Array:
    """Noiseless measurements (J, m) of states (K, n), NaN where a sensor has fewer components."""
    run, p, measured, _ = inputs.bundles(problem)
    noiseless = Noiseless(states=np.ascontiguousarray(states), z=np.empty_like(inputs.z))
    _of_rows(problem).predict_rows(run, p, measured, noiseless)
    return noiseless.z  # type: ignore[no-any-return]


def whitened(problem: Problem, inputs: Inputs, states: Array) -> tuple[Array, Array]:
    """Whitened innovations (J, m) at states (K, n), NaN where missing, and minus their derivatives (J, m, n) by these."""
    N, (J, M) = problem.model.n, inputs.z.shape
    run, p, measured, _ = inputs.bundles(problem)
    seen = Observation(states=np.ascontiguousarray(states, dtype=float), innovations=np.empty((J, M)), rows=np.empty((J, M, N)))
    _of_rows(problem).whiten_rows(run, p, measured, seen)
    return seen.innovations, seen.rows


def _of_rows(problem: Problem) -> SimpleNamespace:
    """What moves nothing; of models whose motion is compiled into every kernel, a part of the one that does."""
    return kernels.load(problem.spec("decorrelate", "rows")) if problem.functions else _library(problem)


def _library(problem: Problem) -> SimpleNamespace:
    return kernels.load(problem.spec("transition", problem.noise_fragment, "decorrelate", "rows", "observe"))


def _observe(problem: Problem, inputs: Inputs, states: Array, *, follow: bool) -> Shot:
    N, (J, M) = problem.model.n, inputs.z.shape
    run, p, measured, _ = inputs.bundles(problem)
    seen = Observation(states=states, innovations=np.empty((J, M)), rows=np.empty((J, M, N)))
    _library(problem).observe(run, p, measured, int(follow), seen)
    return Shot(seen.innovations, seen.rows.reshape(J * M, N), states)


def factor(rows: Array, above: Array | None = None) -> Array:
    """Triangular R (n, n) with R^T R = rows^T rows (+ above^T above), by QR of blocks: nothing is squared."""
    n = rows.shape[1]
    R = np.zeros((n, n)) if above is None else above
    for start in range(0, len(rows), _BLOCK):
        R = np.asarray(np.linalg.qr(np.vstack([R, rows[start : start + _BLOCK]]), mode="r"))
    return R


def growth(rows: Array, ends: Array) -> Array:
    """Factors (E, n, n) of the first ends[0], ends[1], ... rows."""
    out, R, start = np.empty((len(ends), rows.shape[1], rows.shape[1])), None, 0
    for i, end in enumerate(ends):
        R = factor(rows[start:end], R)
        out[i], start = R, end
    return out


def singular(R: Array) -> tuple[Array, Array]:
    """Singular values (..., n), negligible ones as zero, and their directions (..., n, n), one in each row."""
    _, values, directions = np.linalg.svd(R)
    return np.where(values > NEGLIGIBLE * values[..., :1], values, 0.0), directions


def bound(values: Array, directions: Array) -> Array:
    """Cramer-Rao standard deviations (..., n), infinite for what takes part in a direction without information."""
    blind = values == 0
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.where(blind, 0.0, 1.0 / np.where(blind, 1.0, values))
    sigma = np.sqrt(np.einsum("...ij,...i->...j", directions**2, spread**2))
    hidden = (blind[..., :, None] & (np.abs(directions) > 1e-9)).any(axis=-2)
    return np.where(hidden, np.inf, sigma)
