"""Work space of an optimisation over a chain of states: the arrays, and the two ways to solve a linearised chain."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Protocol

import numpy as np

from piazzi import kernels
from piazzi.kernels import Discrete, KernelSpec, bundle
from piazzi.kernels.spec import lanes_for
from piazzi.model import Model, Sensor
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

# places in the report of a chain
MEASUREMENT, DYNAMICS, PRIOR, DEFECT, GRADIENT, FIT, STEP, STEP_SMOOTHED, WIDEST = range(9)


def report_of(figures: Array) -> bundle.Report:
    """Figures (9,) as kernels write them."""
    return bundle.Report(**{name: figures[i : i + 1] for i, name in enumerate(bundle.Report.slots)})


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


def chain_spec(problem: Problem, dynamics: str = "") -> KernelSpec:
    """The kernels that linearise a chain, by this fragment where one is given."""
    fragments = chain_fragments(problem, *graph_fragments(problem))
    if dynamics:
        fragments = tuple(dynamics if name.startswith("linearize_") else name for name in fragments)
    return problem.spec(*fragments, lanes=lanes_for(problem.model.n))


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


def scaling_of(problem: Problem) -> Array:
    """One over the prior sigma of each value, as a diagonal (n, n); 1 where the prior is certain."""
    sigma = np.sqrt(np.diag(problem.covariance))
    return np.diag(1.0 / np.where(sigma > 0, sigma, 1.0))


class Chain:
    """States `x` (K, n) of one problem and everything that is linearised about them."""

    dynamics: ClassVar[str] = ""  # the fragment that linearises them, where that is not the problem's usual one
    reweighted: ClassVar[bool] = False  # whether rows are weighed anew at every step, which converges linearly

    def __init__(self, problem: Problem, inputs: Inputs) -> None:
        self.problem, self.inputs = problem, inputs
        self.library = kernels.load(chain_spec(problem, self.dynamics))
        K, N, M = inputs.epochs, problem.model.n, problem.model.width
        J, A, varies = len(inputs.z), inputs.most_rows * M + N, problem.noise_varies
        self.linear = bundle.Chain.empty(X=K, C=K, N=N, L=K if varies else 1, B=J, M=M, A=A)
        self.x, self.f, self.Phi, self.Q_all, self.nu, self.H, self.d_pred, self.P_pred, *others = self.linear.members
        _, self.multiplier, self.dx, self.scaling, *_ = others
        self.H.fill(0.0)  # no row of H is made for what a sensor does not have
        self.multiplier.fill(0.0)
        self.scaling[:] = scaling_of(problem)
        self.broken, self.report = np.zeros((K, N)), np.zeros(9)
        self.run, p, measured, self.prior = inputs.bundles(problem)
        self.figures = report_of(self.report)
        self._linearize: Callable[[], None] = self.library.graph_linearize.bind(
            self.run, p, measured, self.prior, self.linear, self.broken, self.figures
        )
        if varies:
            self._bind_weigh()

    def _bind_weigh(self) -> None:
        """What judges a step by the process noise that it was solved with, where that depends on the states."""
        self.Q_before, self.broken_now, self._weighed = np.empty_like(self.Q_all), np.zeros_like(self.x), np.zeros(9)
        members = dict(zip(self.linear.slots, self.linear.members, strict=True))
        solved = bundle.Chain(**members | {"Q_all": self.Q_before})
        self._weigh: Callable[[], None] = self.library.graph_weigh.bind(
            self.run, solved, self.broken_now, report_of(self._weighed)
        )

    def linearize(self) -> float:
        """Linearise about `x`; the cost there, half the sum of squares."""
        self._linearize()
        return self.cost()

    def cost(self) -> float:
        """Half the sum of squares of the last linearisation."""
        measured, moved, prior = self.report[: PRIOR + 1].tolist()
        return float(0.5 * (measured + moved + prior))

    def keep_noise(self) -> None:
        """Remember the process noise of the present linearisation for `as_solved`."""
        if self.problem.noise_varies:
            self.Q_before[:] = self.Q_all

    def as_solved(self) -> tuple[float, Array]:
        """Cost, and defects without noise, of the present states under the process noise that was kept."""
        report = self.report
        if not self.problem.noise_varies:
            return self.cost(), self.broken
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
        """How much of the cost may be rounding of the states, and of what they should measure."""
        rows = np.repeat(np.abs(self.x), np.diff(self.inputs.first_row), axis=0)
        with np.errstate(all="ignore"):
            bits = (np.abs(self.H) @ (ROUNDING * rows)[:, :, None])[:, :, 0] + self.measured_bits
            return float(np.nansum(np.abs(self.nu) * bits))

    @cached_property
    def measured_bits(self) -> Array:
        """How much of each measurement (J, m) is rounding, in units of its noise: a frequency of 0.1 Hz has many digits."""
        eps, width = float(np.finfo(float).eps), self.inputs.z.shape[1]
        limits = np.array([[*row, *[np.inf] * width][:width] for row in self.problem.station_limits])
        return np.asarray(ROUNDING / eps * np.abs(self.inputs.z) / limits[self.inputs.station])

    def innovations(self) -> tuple[Array, Array]:
        """Innovations and their covariances along the final linearisation, (J, m) and (J, m, m)."""
        return self._differences(self.d_pred, self.P_pred, 1)

    def residuals(self) -> Array:
        """Measurements minus what the states say they should be, (J, m), NaN where missing."""
        N = self.problem.model.n
        return self._differences(np.zeros((1, N)), np.zeros((1, N, N)), 0)[0]

    def _differences(self, d: Array, P: Array, step: int) -> tuple[Array, Array]:
        """z - h(x) - H d and H P H^T + R of all rows; from epoch to epoch, d and P go on by so many entries."""
        innovations = bundle.Innovations.empty(J=len(self.inputs.z), M=self.problem.model.width)
        run, p, measured, _ = self.inputs.bundles(self.problem)
        self.library.graph_innovations(run, p, measured, self.x, d, P, step, innovations)
        return innovations.members  # type: ignore[no-any-return]


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

    def disturb(self, bits: Array) -> None:
        """Let the dynamics round the states (K, n) by so much, for the next solve."""

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
        self.P_last = np.empty((model.n, model.n))
        self._solve = chain.run, chain.prior, chain.linear, self.P_last, chain.figures
        self._undamped: Callable[[], None] = self.kernels.graph_solve.bind(*self._solve, 0.0)

    def begin(self, states: Array) -> Array:
        return states

    def moved(self, states: Array, step: Array) -> Array:
        return states + step

    def widest(self) -> float:
        c = self.chain
        self.kernels.graph_probe(c.run, c.linear, c.figures)
        return float(c.report[WIDEST])

    def solve(self, damping: float) -> None:
        if damping > 0.0:
            self.kernels.graph_solve(*self._solve, float(damping))
        else:
            self._undamped()

    def disturb(self, bits: Array) -> None:
        self.chain.f[:-1] += bits[1:]

    def of_constants(self) -> Array:
        c = slice(len(self.chain.problem.model.moving), None)
        return self.P_last[c, c]

    def marginals(self) -> Array:
        return smoothed_covariances(self.kernels, self.chain.run, self.chain.linear, self.P_last, self.chain.figures)[0]

    def cross(self) -> Array:
        c = self.chain
        return smoothed_covariances(self.kernels, c.run, c.linear, self.P_last, c.figures, keep_cross=True)[1]


def smoothed_covariances(
    library: Any, run: bundle.Run, linear: bundle.Chain, P_last: Array, figures: bundle.Report, keep_cross: bool = False
) -> tuple[Array, Array]:
    """Covariances of all states (K, n, n), and of each with the next (K - 1, n, n) where wanted."""
    covariance, mean = np.empty_like(linear.P_pred), linear.dx
    cross = np.empty((len(mean) - 1 if keep_cross else 1, *covariance.shape[1:]))
    smoothed = bundle.Smoothed(mean=mean, covariance=covariance, keep_cross=int(keep_cross), cross=cross)
    library.graph_marginals(run, linear, P_last, smoothed, figures)
    return covariance, cross
