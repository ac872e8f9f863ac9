"""The linearised chain with its first state and its constants beside it: for constants, and for priors of any width."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from piazzi import kernels
from piazzi.estimate.chain import GRADIENT, STEP, STEP_SMOOTHED, WIDEST, Chain, smoothed_covariances, solve_spec
from piazzi.kernels import KernelSpec, bundle
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
        self.sigma = np.sqrt(np.diag(problem.covariance)[nd:]) if C else np.zeros(1)
        self.offset = np.zeros(max(C, 1))
        self.P_last = np.empty((nd, nd))
        Q = np.ascontiguousarray(problem.process_noise.covariance[:nd, :nd])
        self.run = bundle.Run(epochs=K, t_prior=i.t_prior, t=i.t, count=i.count, scale=i.scale, first_row=i.first_row, Q=Q)
        L, A = len(chain.Q_all), i.most_rows * M + nd
        self.states = bundle.Chain.empty(X=K, C=K, N=nd, L=L, B=J, M=M, A=A)
        self.states.scaling[:] = chain.scaling[:nd, :nd]
        self.unknowns = bundle.Border(
            constants=C,
            root=root_of(problem.covariance[:nd, :nd]),
            offset=self.offset,
            sigma=self.sigma,
            A=self.states.Phi,
            B=np.zeros((K, max(C, 1), nd)),
            G=np.zeros((J, M, max(C, 1))),
            R=np.empty((n, n)),
            y=np.empty(n),
            S=np.empty((n, nd)),
            row=np.empty(n),
            inverse=np.empty((n, n)),
            W=np.empty((n, n)),
            own=np.empty((nd, nd)),
        )
        self.b = np.zeros(n)
        self.whole = bundle.Whole(
            mean=chain.d_pred, covariance=chain.P_pred, unknowns=self.b, widest=chain.report[WIDEST : WIDEST + 1]
        )

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
        c, nd, states = self.chain, self.nd, self.states
        self._split()
        if self.C:
            self.offset[:] = c.problem.mean[nd:] - c.x[0, nd:]
        start, defect = c.problem.mean[:nd] - c.x[0, :nd], np.zeros((len(c.x), nd))
        defect[1:] = c.f[:-1, :nd] - c.x[1:, :nd]
        self.border.border_solve(self.run, start, defect, states, self.unknowns, self.whole, float(damping))
        constants = self.offset + self.sigma * self.b[nd:] if self.C else self.offset
        states.x[:] = c.x[:, :nd]
        states.f[:] = c.f[:, :nd] + constants @ self.unknowns.B
        states.nu[:] = c.nu - self.unknowns.G @ constants
        first = bundle.Belief(mean=c.problem.mean[:nd] + self.b[:nd] @ self.unknowns.root, covariance=np.zeros((nd, nd)))
        self.inner.graph_solve(self.run, first, states, self.P_last, c.figures, float(damping))
        c.dx[:, :nd], c.multiplier[:, :nd] = states.dx, states.multiplier
        if self.C:
            c.dx[:, nd:], c.multiplier[:, nd:] = constants, 0.0
        c.report[GRADIENT] = c.change(c.dx) ** 2
        c.report[STEP] = c.largest_step(c.P_pred)

    def _split(self) -> None:
        """Innovations, and derivatives by the states apart from those by the constants."""
        c, nd, states = self.chain, self.nd, self.states
        states.nu[:], states.H[:], states.Phi[:] = c.nu, c.H[:, :, :nd], c.Phi[:, :nd, :nd]
        if c.problem.noise_varies:
            states.Q_all[:] = c.Q_all[:, :nd, :nd]
        if self.C:
            self.unknowns.B[:], self.unknowns.G[:] = c.Phi[:, :nd, nd:].transpose(0, 2, 1), c.H[:, :, nd:]

    def disturb(self, bits: Array) -> None:
        self.chain.f[:-1] += bits[1:]

    def of_constants(self) -> Array:
        root = self.sigma[:, None] * self.unknowns.inverse[self.nd :, self.nd :]
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
        nd, n, states = self.nd, self.size, self.states
        own = ("x", "f", "nu", "d_pred", "P_pred", "gains", "multiplier", "dx")  # the solution stays as it is
        members = dict(zip(states.slots, states.members, strict=True))
        alone = bundle.Chain(**{name: np.zeros_like(a) if name in own else a for name, a in members.items()})
        S = np.empty((n, len(states.x), nd))
        self.border.border_sensitivities(self.run, alone, self.unknowns, states.nu, S)
        W = np.empty((len(states.x), n, n))
        W[:, :nd] = S.transpose(1, 2, 0) @ self.unknowns.inverse
        if self.C:
            W[:, nd:] = self.sigma[:, None] * self.unknowns.inverse[nd:]
        return W

    @np.errstate(all="ignore")  # iterations that fail end in what is not finite, which the result tells
    def _covariances(self, keep_cross: bool) -> tuple[Array, Array]:
        """Covariances of all values (K, n, n), and of each state with the next (K - 1, n, n)."""
        nd = self.nd
        P, cross = smoothed_covariances(self.inner, self.run, self.states, self.P_last, self.chain.figures, keep_cross)
        W = self.factors()
        covariance = W @ W.transpose(0, 2, 1)
        covariance[:, :nd, :nd] += P
        between = W[:-1] @ W[1:].transpose(0, 2, 1)
        if keep_cross:
            between[:, :nd, :nd] += cross
        return 0.5 * (covariance + covariance.transpose(0, 2, 1)), between
