"""Work space of an optimisation over a chain of states: the arrays, and the two ways to solve a linearised chain."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import ClassVar, Protocol

import numpy as np

from piazzi import kernels
from piazzi.kernels import Discrete, KernelSpec
from piazzi.kernels.spec import lanes_for
from piazzi.model import Model, Sensor
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

# slots of the kernels' report
MEASUREMENT, DYNAMICS, PRIOR, DEFECT, GRADIENT, FIT, STEP, STEP_SMOOTHED, WIDEST = range(9)


def chain_fragments(problem: Problem, *last: str) -> tuple[str, ...]:
    """Fragments of every estimator that works on a chain of states."""
    kind = problem.noise_fragment.removeprefix("noise_")
    return (
        "transition",
        problem.noise_fragment,
        f"linearize_{kind}",
        f"chain_noise_{kind}",
        "decorrelate",
        "linearize",
        "update_components",
        "epoch",
        "innovations",
        "chain",
        "semidefinite",
        "marginals",
        *last,
    )


def graph_fragments(problem: Problem) -> tuple[str, ...]:
    """Fragments that linearise a whole graph."""
    return ("graph_linearize", "graph_weigh") if problem.noise_varies else ("graph_linearize",)


ROUNDING = 4 * float(np.finfo(float).eps)


def solve_spec(n: int, width: int, noise_varies: bool) -> KernelSpec:
    """The kernels that solve a linearised chain: they depend on its sizes only, so all models of one size share them."""
    return _solve_spec(n, width, noise_varies, lanes_for(n))


@lru_cache(maxsize=64)
def _solve_spec(n: int, width: int, noise_varies: bool, lanes: int) -> KernelSpec:
    names = tuple(f"s{i}" for i in range(n))
    sizes = Model(names, ("0",) * n, (Sensor("any", ["0"] * width),), discrete=True)
    noise = f"chain_noise_{'integral' if noise_varies else 'scaled'}"
    return KernelSpec(sizes, Discrete().scheme, ("matrices", noise, "chain", "semidefinite", "marginals", "graph"), lanes)


def tether_of(problem: Problem) -> Array:
    """One over the prior sigma of each value, as a diagonal (n, n); 1 where the prior is certain."""
    sigma = np.sqrt(np.diag(problem.covariance))
    return np.diag(1.0 / np.where(sigma > 0, sigma, 1.0))


class Chain:
    """States `x` (K, n) of one problem and everything that is linearised about them."""

    reweighted: ClassVar[bool] = False  # whether rows are weighed anew at every step, which converges linearly

    def __init__(self, problem: Problem, inputs: Inputs) -> None:
        self.problem, self.inputs = problem, inputs
        self.library = kernels.load(
            problem.spec(*chain_fragments(problem, *graph_fragments(problem)), lanes=lanes_for(problem.model.n))
        )
        K, N, M = inputs.epochs, problem.model.n, problem.model.width
        J = len(inputs.z)
        self.x, self.f, self.Phi = np.empty((K, N)), np.empty((K, N)), np.empty((K, N, N))
        self.Q_all = np.empty((K if problem.noise_varies else 1, N, N))
        self.nu, self.H = np.empty((J, M)), np.zeros((J, M, N))  # no row of H is made for what a sensor does not have
        self.d_pred, self.P_pred = np.empty((K, N)), np.empty((K, N, N))
        self.multiplier, self.dx = np.zeros((K, N)), np.empty((K, N))
        self.broken, self.report = np.zeros((K, N)), np.zeros(9)
        self.tether = tether_of(problem)
        self._linearize = self._bind_linearize()
        if problem.noise_varies:
            self._bind_weigh()

    def _bind_linearize(self) -> Callable[[], None]:
        i, p = self.inputs, self.problem
        bound: Callable[[], None] = self.library.graph_linearize.bind(
            i.epochs,
            i.t,
            i.count,
            i.scale,
            *i.measured(p),
            p.given,
            p.process_noise.covariance,
            p.mean,
            p.covariance,
            self.x,
            self.f,
            self.Phi,
            self.Q_all,
            self.nu,
            self.H,
            self.tether,
            self.broken,
            self.report,
        )
        return bound

    def _bind_weigh(self) -> None:
        """What judges a step by the process noise that it was solved with, where that depends on the states."""
        i, Q = self.inputs, self.problem.process_noise.covariance
        self.Q_before, self.broken_now, self._weighed = np.empty_like(self.Q_all), np.zeros_like(self.x), np.zeros(9)
        self._weigh: Callable[[], None] = self.library.graph_weigh.bind(
            i.epochs, i.scale, Q, self.x, self.f, self.Q_before, self.tether, self.broken_now, self._weighed
        )

    def linearize(self) -> float:
        """Linearise about `x`; the cost there, half the sum of squares."""
        self._linearize()
        return 0.5 * float(self.report[: PRIOR + 1].sum())

    def keep_noise(self) -> None:
        """Remember the process noise of the present linearisation for `as_solved`."""
        if self.problem.noise_varies:
            self.Q_before[:] = self.Q_all

    def as_solved(self) -> tuple[float, Array]:
        """Cost, and defects without noise, of the present states under the process noise that was kept."""
        report = self.report
        if not self.problem.noise_varies:
            return 0.5 * float(report[: PRIOR + 1].sum()), self.broken
        self._weigh()
        return 0.5 * float(report[MEASUREMENT] + report[PRIOR] + self._weighed[DYNAMICS]), self.broken_now

    def largest_step(self, covariance: Array) -> float:
        """The largest step in standard deviations, without rounding; infinite where a value that is certain moves."""
        with np.errstate(invalid="ignore"):
            moved = np.maximum(np.abs(self.dx) - ROUNDING * np.abs(self.x), 0.0)
        return self.largest(np.where(np.isfinite(self.dx), moved, np.inf), covariance)

    def largest(self, changes: Array, covariance: Array) -> float:
        """The largest of changes (K, n) in standard deviations; infinite where a value that is certain changes."""
        with np.errstate(all="ignore"):
            sigmas = np.abs(changes) / np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        sigmas = np.where(changes == 0.0, 0.0, sigmas)
        return float(sigmas.max()) if np.isfinite(sigmas).all() else np.inf

    def change(self, changes: Array) -> float:
        """What changes (K, n) of the states make of all measurements, in units of their noise, as a length."""
        return float(np.linalg.norm(np.where(np.isnan(self.nu), 0.0, self.by_measurement(changes))))

    def in_sigmas(self, changes: Array) -> Array:
        """Changes (K, n) of states in their predicted sigmas, then of measurements in units of their noise, (K n + J m,)."""
        sigma = np.sqrt(np.diagonal(self.P_pred, axis1=1, axis2=2))
        states = changes / np.where(sigma > 0, sigma, 1.0)
        return np.concatenate([states.ravel(), np.where(np.isnan(self.nu), 0.0, self.by_measurement(changes)).ravel()])

    def by_measurement(self, changes: Array) -> Array:
        """Changes (K, n) of the states as changes of the measurements in units of their noise, (J, m)."""
        rows = np.repeat(changes, np.diff(self.inputs.first_row), axis=0)
        with np.errstate(all="ignore"):
            return np.asarray((self.H @ rows[:, :, None])[:, :, 0])

    def cost_rounding(self) -> float:
        """How much of the cost may be rounding of the states."""
        rows = np.repeat(np.abs(self.x), np.diff(self.inputs.first_row), axis=0)
        with np.errstate(all="ignore"):
            return float(np.nansum(np.abs(self.nu) * (np.abs(self.H) @ (ROUNDING * rows)[:, :, None])[:, :, 0]))

    def innovations(self) -> tuple[Array, Array]:
        """Innovations and their covariances along the final linearisation, (J, m) and (J, m, m)."""
        return self._differences(self.d_pred, self.P_pred, 1)

    def residuals(self) -> Array:
        """Measurements minus what the states say they should be, (J, m), NaN where missing."""
        N = self.problem.model.n
        return self._differences(np.zeros((1, N)), np.zeros((1, N, N)), 0)[0]

    def _differences(self, d: Array, P: Array, step: int) -> tuple[Array, Array]:
        """z - h(x) - H d and H P H^T + R of all rows; from epoch to epoch, d and P go on by so many entries."""
        i, M = self.inputs, self.problem.model.width
        nu, S = np.empty((len(i.z), M)), np.empty((len(i.z), M, M))
        self.library.graph_innovations(
            i.epochs,
            i.t,
            *i.measured(self.problem),
            self.problem.given,
            self.x,
            d,
            P,
            step,
            nu,
            S,
        )
        return nu, S


class Solver(Protocol):
    """One way to solve a linearised chain."""

    name: str

    def begin(self, states: Array) -> Array:
        """The states (K, n) to start from, as this solver can take them."""

    def moved(self, states: Array, step: Array) -> Array:
        """The states after a step, (K, n)."""

    def widest(self) -> float:
        """Largest predicted variance of a measurement in units of its noise, after a solve."""

    def solve(self, damping: float) -> None:
        """Leave the Gauss-Newton (or damped) step in the chain's `dx`."""

    def of_constants(self) -> Array:
        """Covariance of the constants (C, C), after an undamped solve."""

    def marginals(self) -> Array:
        """Covariances of all states (K, n, n), after an undamped solve."""

    def cross(self) -> Array:
        """Covariances of each state with the next (K - 1, n, n), after an undamped solve."""


class CovarianceSolver:
    """Linearised Kalman filter forward, Bryson-Frazier back; covariances from before and after each state, in Joseph form."""

    name = "chain"

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        model = chain.problem.model
        self.kernels = kernels.load(solve_spec(model.n, model.width, chain.problem.noise_varies))
        c, i, p, N = chain, chain.inputs, chain.problem, model.n
        self.gains, self.P_last = np.empty((i.most_rows * model.width + N, N + 1)), np.empty((N, N))
        self._linearized = kernels.ready(
            i.epochs,
            i.scale,
            i.first_row,
            p.process_noise.covariance,
            p.mean,
            p.covariance,
            c.x,
            c.f,
            c.Phi,
            c.Q_all,
            c.nu,
            c.H,
            c.tether,
            c.d_pred,
            c.P_pred,
            self.P_last,
            self.gains,
            c.multiplier,
            c.dx,
            c.report,
        )

    def begin(self, states: Array) -> Array:
        return states

    def moved(self, states: Array, step: Array) -> Array:
        return states + step

    def widest(self) -> float:
        c, i = self.chain, self.chain.inputs
        self.kernels.graph_probe(i.epochs, i.first_row, c.nu, c.H, c.P_pred, c.report)
        return float(c.report[WIDEST])

    def solve(self, damping: float) -> None:
        self.kernels.graph_solve.after(self._linearized, float(damping))

    def of_constants(self) -> Array:
        c = slice(len(self.chain.problem.model.moving), None)
        return self.P_last[c, c]

    def marginals(self) -> Array:
        return self._marginals(np.empty((1, 1)), keep_cross=False)

    def cross(self) -> Array:
        N = self.chain.problem.model.n
        out = np.empty((self.chain.inputs.epochs - 1, N, N))
        self._marginals(out, keep_cross=True)
        return out

    def _marginals(self, cross: Array, keep_cross: bool) -> Array:
        c, i, N = self.chain, self.chain.inputs, self.chain.problem.model.n
        covariance = np.empty((i.epochs, N, N))
        self.kernels.graph_marginals(
            i.epochs,
            i.scale,
            i.first_row,
            c.problem.process_noise.covariance,
            c.Phi,
            c.Q_all,
            c.nu,
            c.H,
            c.P_pred,
            self.P_last,
            int(keep_cross),
            c.dx,
            covariance,
            cross,
            c.report,
        )
        return covariance
