"""Problems without process noise as one orbit: only its first state and the constants are unknown."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace

import numpy as np

from piazzi import kernels
from piazzi.estimate.bordered import root_of
from piazzi.estimate.chain import GRADIENT, STEP, STEP_SMOOTHED, Chain
from piazzi.kernels import Discrete, KernelSpec, bundle
from piazzi.kernels.spec import FILLS_REGISTERS
from piazzi.model import Model, Sensor
from piazzi.problem import Problem
from piazzi.problem.arcs import arc
from piazzi.problem.checks import Array
from piazzi.problem.dense import dense_grid, on_dense_grid, products
from piazzi.problem.inputs import Inputs


class OrbitChain(Chain):
    """A chain whose states are one orbit, linearised while it is followed: by a multi-step method, or interval by interval.

    For methods whose states cannot be linearised several at a time, and for epochs denser than the steps that forces ask for.
    """

    dynamics = "linearize_given"

    def __init__(self, problem: Problem, inputs: Inputs) -> None:
        super().__init__(problem, inputs)
        self.dense = dense_steps(problem, inputs)
        self.steps = problem.steps(float(inputs.t[0]), float(inputs.t[-1]))
        self.Phi.fill(np.nan)  # on a dense grid there is none
        self._orbit: tuple[Array, Array] | None = None

    def orbit(self, first: Array) -> Array:
        """States at all nodes (K, n) of the orbit from `first`."""
        if self._orbit is None or not np.array_equal(self._orbit[0][0], first):
            self._orbit = self._followed(first)
        return np.asarray(self._orbit[0])

    def _followed(self, first: Array) -> tuple[Array, Array]:
        if self.dense:
            x, W = on_dense_grid(self.problem, self.inputs.t, first, self.dense)
            if np.isfinite(x).all():
                return x, W
        found = arc(self.problem, self.inputs.t, first, self.steps, derivative=True)
        self.Phi[:-1] = found.Phi
        return found.x, products(found.Phi)

    def by_first(self) -> Array:
        """Derivatives (K, n, n) of all states by the first."""
        assert self._orbit is not None
        return self._orbit[1]

    def transitions(self) -> Array:
        """Transition matrices (K - 1, n, n)."""
        if not self.dense:
            return np.asarray(self.Phi[:-1])
        W = self.by_first()
        return np.asarray(np.linalg.solve(W[:-1].transpose(0, 2, 1), W[1:].transpose(0, 2, 1)).transpose(0, 2, 1))

    @property
    def grid_step(self) -> float | None:
        """The step of a multi-step method in seconds, where there is one."""
        t = self.inputs.t
        return float(t[-1] - t[0]) / self.dense if self.dense else self.steps.grid

    def linearize(self) -> float:
        self.x[:] = self.orbit(self.x[0])
        self.f[:-1] = self.x[1:]
        return super().linearize()

    @staticmethod
    def applies(problem: Problem, inputs: Inputs) -> bool:
        """Whether it is the faster way."""
        assert problem.integrator is not None
        if not problem.moves_in_lanes or problem.model.n > FILLS_REGISTERS:
            return True  # with lanes or without them: the way, and so the rounding, is a matter of the problem alone
        if dense_steps(problem, inputs):
            return True
        return bool(problem.integrator.arc_scheme) and problem.steps(float(inputs.t[0]), float(inputs.t[-1])).grid is not None


def dense_steps(problem: Problem, inputs: Inputs) -> int:
    """Steps of a grid on which a problem with steps of one length is as exact, with fewer evaluations; 0 where none is."""
    integrator = problem.integrator
    assert integrator is not None
    given = isinstance(integrator, kernels.RungeKutta8) and integrator.max_step is not None and not integrator.arc_scheme
    return dense_grid(problem, inputs.t, integrator.max_step) if given and integrator.max_step else 0


@cache
def _library() -> SimpleNamespace:
    """It depends on no model; the smallest one stands in its place."""
    nothing = Model(("s",), ("0",), (Sensor("any", ["0"]),), discrete=True)
    return kernels.load(KernelSpec(nothing, Discrete().scheme, ("matrices", "border", "shooting"), 1))


def steps_taken(chain: Chain) -> dict[str, float]:
    """What a result says of a multi-step method."""
    grid = chain.grid_step if isinstance(chain, OrbitChain) else None
    return {} if grid is None else {"grid_step": grid}


class ShootingSolver:
    """First state and constants from all rows, by their derivatives by the first state; all states go with them.

    The prior of the unknowns is never subtracted from what the measurements leave of it, and nothing is inverted but triangles.
    """

    name = "batch"

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        i, problem = chain.inputs, chain.problem
        n, width = problem.model.n, problem.model.width
        self.root, self.inverse, self.start = root_of(problem.covariance), np.empty((n, n)), np.empty(n)
        self.W, self.drift = np.empty((i.epochs, n, n)), np.zeros((i.epochs, n))
        orbit = bundle.Orbit(
            epochs=i.epochs, size=n, width=width, first_row=i.first_row, W=self.W, drift=self.drift, nu=chain.nu, H=chain.H,
            root=self.root, start=self.start, scaling=np.diag(chain.scaling).copy(),
        )  # fmt: skip
        shot = bundle.Shot(
            mean=chain.d_pred, covariance=chain.P_pred, dx=chain.dx, inverse=self.inverse,
            **{name: np.empty((n, n)) for name in ("R", "A", "U")},
            **{name: np.empty(n) for name in ("y", "b", "offset", "row")},
        )  # fmt: skip
        self._shoot: Callable[[float], None] = lambda damping: _library().shoot(orbit, shot, damping)
        if isinstance(chain, OrbitChain):
            self._follow = chain.orbit
        else:
            self.x: Array = np.empty_like(chain.x)
            library = kernels.load(problem.spec("transition", "propagate"))
            self._propagate: Callable[[], None] = library.run_propagation.bind(
                i.epochs, i.t, i.count, problem.given_bundle, self.x
            )
            self._follow = self._propagated

    def _propagated(self, first: Array) -> Array:
        self.x[0] = first
        self._propagate()
        return self.x

    def begin(self, states: Array) -> Array:
        return self._follow(states[0]).copy()

    def moved(self, states: Array, step: Array) -> Array:
        return self._follow(states[0] + step[0]).copy()

    def widest(self) -> float:
        """Nothing is too wide for it."""
        return 0.0

    @np.errstate(all="ignore")
    def solve(self, damping: float) -> None:
        c = self.chain
        self.W[:] = c.by_first() if isinstance(c, OrbitChain) else products(c.Phi[:-1])
        self.start[:] = c.problem.mean - c.x[0]
        self._shoot(float(damping))
        self.drift[:] = 0.0
        c.report[GRADIENT] = c.change(c.dx) ** 2
        c.report[STEP] = c.largest_step(c.P_pred)

    def disturb(self, bits: Array) -> None:
        Phi = self.chain.transitions() if isinstance(self.chain, OrbitChain) else self.chain.Phi
        for k in range(1, len(bits)):
            self.drift[k] = Phi[k - 1] @ self.drift[k - 1] + bits[k]

    def _factors(self) -> Array:
        """W (K, n, n) such that W W^T is the covariance of each state."""
        return self.W @ (self.root.T @ self.inverse)

    def of_constants(self) -> Array:
        c = slice(len(self.chain.problem.model.moving), None)
        own = self.root.T[c] @ self.inverse
        return np.asarray(own @ own.T)

    @np.errstate(all="ignore")
    def marginals(self) -> Array:
        own = self._factors()
        covariance = np.asarray(own @ own.transpose(0, 2, 1))
        self.chain.report[STEP_SMOOTHED] = self.chain.largest_step(covariance)
        return covariance

    def cross(self) -> Array:
        own = self._factors()
        return np.asarray(own[:-1] @ own[1:].transpose(0, 2, 1))
