"""The linearised chain with its first state and its constants beside it: for constants, and for priors of any width."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from piazzi import kernels
from piazzi.estimate.chain import GRADIENT, STEP, STEP_SMOOTHED, WIDEST, Chain, solve_spec
from piazzi.kernels import KernelSpec
from piazzi.problem import Problem
from piazzi.problem.checks import Array


@lru_cache(maxsize=64)
def border_spec(chain: KernelSpec) -> KernelSpec:
    """The kernels of the border around a chain with these; the number of constants is an argument of theirs."""
    return KernelSpec(chain.model, chain.scheme, (*chain.fragments[:-1], "border", "graph_border"), chain.lanes)


def root_of(covariance: Array) -> Array:
    """A matrix whose rows r_j add up to it: sum of r_j r_j^T, (n, n); rows of zeros where it is singular."""
    sigma = np.sqrt(np.diag(covariance))
    unit = np.where(sigma > 0, sigma, 1.0)
    correlation = covariance / np.outer(unit, unit)
    if not np.count_nonzero(correlation - np.diag(np.diag(correlation))):
        return np.diag(sigma)
    values, vectors = np.linalg.eigh(correlation)
    values = np.where(values > 1e-14 * values[-1], values, 0.0)
    return np.ascontiguousarray((unit[:, None] * vectors * np.sqrt(values)).T)


class BorderedSolver:
    """First state and constants by column-scaled QR of the chain's innovations, the states between by the chain.

    Neither is the prior of the unknowns ever subtracted from what the measurements leave of it, nor is anything inverted that
    process noise may make singular; the constants cost columns instead of states.
    """

    name = "bordered"

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        problem, i = chain.problem, chain.inputs
        model = problem.model
        K, J, M, n, nd = i.epochs, len(i.z), model.width, model.n, len(model.moving)
        C = n - nd
        self.nd, self.C, self.size = nd, C, n
        inner = solve_spec(nd, M, problem.noise_varies)
        self.border, self.inner = kernels.load(border_spec(inner)), kernels.load(inner)
        self.root = root_of(problem.covariance[:nd, :nd])
        self.sigma = np.sqrt(np.diag(problem.covariance)[nd:]) if C else np.zeros(1)
        self.Q = np.ascontiguousarray(problem.process_noise.covariance[:nd, :nd])
        self.tether = np.ascontiguousarray(chain.tether[:nd, :nd])
        self.A, self.B = np.empty((K, nd, nd)), np.zeros((K, max(C, 1), nd))
        self.G, self.H = np.zeros((J, M, max(C, 1))), np.empty((J, M, nd))
        self.Q_all = np.empty((len(chain.Q_all), nd, nd))
        self.inverse, self.b = np.empty((n, n)), np.zeros(n)
        self.space = (np.empty((n, n)), np.empty(n), np.empty((n, nd)), np.empty(n), self.inverse, np.empty((n, n)))
        self.own = np.empty((nd, nd))
        rows = i.most_rows * M + nd
        self.d, self.P = np.empty((K, nd)), np.empty((K, nd, nd))
        self.P_last, self.gains = np.empty((nd, nd)), np.empty((rows, nd + 1))
        self.multiplier, self.dx = np.empty((K, nd)), np.empty((K, nd))

    @staticmethod
    def applies(problem: Problem) -> bool:
        """Whether the constants are constant: one that noise or a manoeuvre moves has to stay in the chain."""
        constants = set(problem.model.constants)
        still = all(constants.isdisjoint(m.states) for m in problem.manoeuvres)
        return still and not problem.process_noise.covariance[len(problem.model.moving) :].any()

    def begin(self, states: Array) -> Array:
        """The states with one value of each constant, that of the last epoch."""
        out = states.copy()
        out[:, self.nd :] = out[-1, self.nd :]
        return out

    def moved(self, states: Array, step: Array) -> Array:
        return states + step

    def widest(self) -> float:
        return float(self.chain.report[WIDEST])

    @np.errstate(all="ignore")
    def solve(self, damping: float) -> None:
        c, i, nd = self.chain, self.chain.inputs, self.nd
        self._split()
        offset = np.zeros(1) if not self.C else c.problem.mean[nd:] - c.x[0, nd:]
        defect = np.zeros((i.epochs, nd))
        defect[1:] = c.f[:-1, :nd] - c.x[1:, :nd]
        self.border.border_solve(
            i.epochs, self.C, i.scale, i.first_row, self.Q, self.Q_all, c.problem.mean[:nd] - c.x[0, :nd], self.root, offset,
            self.sigma, defect, self.A, self.B, c.nu, self.H, self.G, float(damping), self.tether, *self.space, self.own,
            self.b, c.d_pred, c.P_pred, c.report,
        )  # fmt: skip
        constants = offset + self.sigma * self.b[nd:] if self.C else offset
        self._solve_chain(c.problem.mean[:nd] + self.b[:nd] @ self.root, constants, damping)
        c.dx[:, :nd], c.multiplier[:, :nd] = self.dx, self.multiplier
        if self.C:
            c.dx[:, nd:], c.multiplier[:, nd:] = constants, 0.0
        c.report[GRADIENT] = c.change(c.dx) ** 2
        c.report[STEP] = c.largest_step(c.P_pred)

    def _split(self) -> None:
        """Derivatives by the states apart from those by the constants."""
        c, nd = self.chain, self.nd
        self.A[:], self.H[:] = c.Phi[:, :nd, :nd], c.H[:, :, :nd]
        if c.problem.noise_varies:
            self.Q_all[:] = c.Q_all[:, :nd, :nd]
        if self.C:
            self.B[:], self.G[:] = c.Phi[:, :nd, nd:].transpose(0, 2, 1), c.H[:, :, nd:]

    def _solve_chain(self, first: Array, constants: Array, damping: float) -> None:
        """Deviations of the states for a given first state and given changes of the constants."""
        c, i, nd = self.chain, self.chain.inputs, self.nd
        f, nu = c.f[:, :nd] + constants @ self.B, c.nu - self.G @ constants
        self.inner.graph_solve(
            i.epochs, i.scale, i.first_row, self.Q, first, np.zeros((nd, nd)), np.ascontiguousarray(c.x[:, :nd]), f, self.A,
            self.Q_all, nu, self.H, self.tether, self.d, self.P, self.P_last, self.gains, self.multiplier, self.dx,
            c.report, float(damping),
        )  # fmt: skip

    def of_constants(self) -> Array:
        root = self.sigma[:, None] * self.inverse[self.nd :, self.nd :]
        return np.asarray(root @ root.T)

    def marginals(self) -> Array:
        covariance, _ = self._covariances(keep_cross=False)
        self.chain.report[STEP_SMOOTHED] = self.chain.largest_step(covariance)
        return covariance

    def cross(self) -> Array:
        _, cross = self._covariances(keep_cross=True)
        return cross

    def factors(self) -> Array:
        """W (K, n, n) such that W W^T is the covariance of states and constants that comes from the border's unknowns."""
        c, i, nd, n = self.chain, self.chain.inputs, self.nd, self.size
        K, J, M = i.epochs, len(i.z), c.problem.model.width
        S = np.empty((n, K, nd))
        self.border.border_sensitivities(
            K, self.C, i.scale, i.first_row, self.Q, self.Q_all, self.root, self.sigma, self.A, self.B, c.nu, self.H, self.G,
            np.zeros((K, nd)), np.empty((K, nd)), np.empty((J, M)), self.tether, np.empty((K, nd)), np.empty((K, nd, nd)),
            self.gains, np.empty((K, nd)), S,
        )  # fmt: skip
        W = np.empty((K, n, n))
        W[:, :nd] = S.transpose(1, 2, 0) @ self.inverse
        if self.C:
            W[:, nd:] = self.sigma[:, None] * self.inverse[nd:]
        return W

    @np.errstate(all="ignore")  # iterations that fail end in what is not finite, which the result tells
    def _covariances(self, keep_cross: bool) -> tuple[Array, Array]:
        """Covariances of all values (K, n, n), and of each state with the next (K - 1, n, n)."""
        c, i, nd = self.chain, self.chain.inputs, self.nd
        P, cross = np.empty((i.epochs, nd, nd)), np.zeros((max(i.epochs - 1, 1), nd, nd))
        self.inner.graph_marginals(
            i.epochs, i.scale, i.first_row, self.Q, self.A, self.Q_all, c.nu, self.H, self.P, self.P_last,
            int(keep_cross), self.dx, P, cross, c.report,
        )  # fmt: skip
        W = self.factors()
        covariance = W @ W.transpose(0, 2, 1)
        covariance[:, :nd, :nd] += P
        between = W[:-1] @ W[1:].transpose(0, 2, 1)
        between[:, :nd, :nd] += cross[: len(between)]
        return 0.5 * (covariance + covariance.transpose(0, 2, 1)), between
