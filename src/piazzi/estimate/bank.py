"""A bank of starts: where measurements leave several solutions, or the prior is far off, begin in many places and compare."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from piazzi.estimate.chain import Chain, Solver
from piazzi.estimate.gauss_newton import Outcome
from piazzi.estimate.kalman import filter_run
from piazzi.estimate.robust import RobustChain, gated_run, minimize, solve_at
from piazzi.estimate.width import TOO_WIDE
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import Inputs

SAME = 0.1  # solutions closer than this many standard deviations, everywhere, are one
NEGLIGIBLE = 1e-9  # modes less probable than this are not reported
STEPS = 30  # iterations that a member may take


@dataclass(frozen=True)
class Bank:
    """Starts spread over the prior, each followed by a filter and then by the graph.

    Parameters
    ----------
    members : int
        Starts beside the graph's own.
    spread : float
        Width of the belief that each member's filter begins with, as a share of the prior's.

    Notes
    -----
    The members are the prior's mean and pairs of points on opposite sides of it, the same in every run: Halton's sequence
    (Numerische Mathematik 2, 1960) through the quantiles of the normal distribution.  All solutions are weighed by Laplace's
    approximation of their evidence, exp(-cost) / sqrt(det(I + information / prior)), and near-identical ones are merged.
    ``details["modes"]`` lists them, the most probable first, with "probability", "cost", "log_evidence" (up to a constant),
    "members" that led there and the first "state"; ``details["mode_states"]`` (modes, K, n) has their states; both are empty
    where no start led anywhere.  ``details["start"]`` is "bank" where the graph's own start did not lead to the first of them.
    The probabilities are among the modes found: a bank does not prove that there are no others.  With Tukey's or Cauchy's loss
    each member is followed both from where Huber's leads and from itself, and its cheaper solution counts.
    """

    members: int = 16
    spread: float = 0.5

    def __post_init__(self) -> None:
        if self.members != int(self.members) or not 1 <= self.members <= 10_000:
            raise ValueError(f"members is {self.members}; it must be a whole number from 1 to 10000")
        if not (np.isfinite(self.spread) and self.spread > 0):
            raise ValueError(f"spread is {self.spread}; it must be positive and finite")

    def points(self, problem: Problem) -> Array:
        """Where the members begin, (members, n): the prior's mean, then pairs of points on opposite sides of it."""
        n = len(problem.mean)
        quantile = NormalDist().inv_cdf
        side = np.array([[quantile(u) for u in halton(i, n)] for i in range(1, self.members // 2 + 1)]).reshape(-1, n)
        away = np.stack([side, -side], axis=1).reshape(-1, n)[: self.members - 1]
        return np.vstack([problem.mean, problem.mean + away @ root(problem.covariance).T])

    def starts(self, chain: Chain, inputs: Inputs) -> Iterator[Array]:
        """States at all nodes of the chain, of each member."""
        for point in self.points(chain.problem):
            yield member_start(self, chain, inputs, point)


@dataclass(frozen=True, eq=False)
class Paths:
    """Starts that are whole paths: states (K, n) at the epochs of a tracking; the graph itself begins at the first."""

    states: tuple[Array, ...]

    def starts(self, chain: Chain, inputs: Inputs) -> Iterator[Array]:
        """States at all nodes of the chain, of the other paths."""
        for path in self.states[1:]:
            yield with_first(chain, path)


@dataclass(frozen=True, eq=False)
class Mode:
    """A solution.

    States (K, n), their standard deviations, log evidence up to a constant, figures of the run that found it, how often it was
    found, and whether the graph's own start led there.
    """

    states: Array
    sigma: Array
    log_evidence: float
    details: dict[str, Any]
    members: int
    usual: bool

    @property
    def cost(self) -> float:
        return float(self.details["cost"])


def halton(i: int, n: int) -> list[float]:
    """Point `i` of Halton's sequence in n dimensions: the digits of i in prime bases, mirrored at the point; in (0, 1)."""
    out: list[float] = []
    base = 1
    while len(out) < n:
        base += 1
        if any(base % d == 0 for d in range(2, int(base**0.5) + 1)):
            continue
        rest, share, value = i, 1.0, 0.0
        while rest:
            share /= base
            value += share * (rest % base)
            rest //= base
        out.append(value)
    return out


def root(covariance: Array) -> Array:
    """A with A A^T = covariance, which may be singular."""
    sigma = np.sqrt(np.diag(covariance))
    unit = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def with_prior(problem: Problem, mean: Array, covariance: Array) -> Problem:
    """The problem as the kernels would see it with this prior of all values; only they should see it."""
    other = copy.copy(problem)
    other.__dict__.update(mean=mean, covariance=np.ascontiguousarray(covariance))
    return other


def with_first(chain: Chain, states: Array) -> Array:
    """States at all nodes of the chain: before those of the epochs, the prior mean where the chain begins earlier."""
    before = chain.inputs.epochs - len(states)
    return np.vstack([chain.problem.mean] * before + [states]) if before else states


def search(bank: Bank | Paths, chain: Chain, solver: Solver, inputs: Inputs, first: Outcome, tolerance: float) -> Outcome:
    """The most probable solution among `first`, at which the chain stands, and those of the bank; the chain is left there."""
    modes: list[Mode] = []
    iterations, states_first = first.iterations, chain.x.copy()
    if not first.failure:
        modes = merged(modes, found(chain, first, usual=True))
    # where the prior is too wide for the solver, no member does better
    for states in bank.starts(chain, inputs) if not first.failure.startswith(TOO_WIDE) else ():
        if not np.isfinite(states).all():
            continue
        outcome = minimize(chain, solver, states, STEPS, tolerance, direct=True)
        iterations += outcome.iterations
        if not outcome.failure:
            modes = merged(modes, found(chain, outcome))
    modes.sort(key=lambda mode: -mode.log_evidence)
    solve_at(chain, solver, modes[0].states if modes else states_first)
    details = mode_details(modes, chain, inputs)
    if not modes:
        return replace(first, iterations=iterations, details=first.details | details)
    won = {} if modes[0].usual else {"start": "bank"}
    return Outcome(solver.marginals(), iterations, "", modes[0].details | details | won)


def member_start(bank: Bank, chain: Chain, inputs: Inputs, point: Array) -> Array:
    """States at all nodes of the chain, filtered from a belief about `point`."""
    problem = with_prior(chain.problem, np.ascontiguousarray(point), bank.spread**2 * chain.problem.covariance)
    try:
        states = gated_run(problem, inputs) if isinstance(chain, RobustChain) else filter_run(problem, inputs)[0]
    except ValueError:  # no derivative at this very point
        return np.full((chain.inputs.epochs, len(point)), np.nan)
    return np.vstack([point] * (chain.inputs.epochs - len(states)) + [states])


def found(chain: Chain, outcome: Outcome, usual: bool = False) -> Mode:
    """The solution at which the chain stands."""
    evidence = -float(outcome.details["cost"]) - 0.5 * log_determinant(chain)
    sigma = np.sqrt(np.maximum(np.diagonal(outcome.covariance, axis1=1, axis2=2), 0.0))
    return Mode(chain.x.copy(), sigma, evidence, outcome.details, 1, usual)


def merged(modes: list[Mode], new: Mode) -> list[Mode]:
    """The modes with another one; the better of two that are the same stays."""
    for i, mode in enumerate(modes):
        near = np.abs(new.states - mode.states) <= SAME * np.maximum(mode.sigma, new.sigma) + 1e-9 * np.abs(mode.states)
        if near.all():
            better = new if new.cost < mode.cost else mode
            both = replace(better, members=mode.members + new.members, usual=mode.usual or new.usual)
            return [*modes[:i], both, *modes[i + 1 :]]
    return [*modes, new]


def log_determinant(chain: Chain) -> float:
    """Sum of the logarithms of all predicted variances of the whitened measurements, after an undamped solve.

    That is log det(I + H P H^T) for the joint prior covariance P of all states, with no inverse of P: each measurement's
    variance given all those before it, taken in one at a time in every epoch at once.
    """
    M, N = chain.problem.model.width, chain.problem.model.n
    rows = np.diff(chain.inputs.first_row)
    P, total = chain.P_pred.copy(), 0.0
    nu, H = chain.nu.reshape(-1), chain.H.reshape(-1, N)
    for slot in range(int(rows.max(initial=0)) * M):
        epochs = np.flatnonzero(rows * M > slot)
        at = chain.inputs.first_row[epochs] * M + slot
        there = ~np.isnan(nu[at])
        epochs, h = epochs[there], H[at[there]]
        Ph = np.einsum("kij,kj->ki", P[epochs], h)
        S = 1.0 + np.einsum("ki,ki->k", h, Ph)
        total += float(np.log(np.maximum(S, 1.0)).sum())
        P[epochs] -= Ph[:, :, None] * Ph[:, None, :] / S[:, None, None]
    return total


def mode_details(modes: list[Mode], chain: Chain, inputs: Inputs) -> dict[str, object]:
    """The modes as details of an estimate; those with hardly any probability are left out."""
    share = np.exp(np.array([mode.log_evidence - modes[0].log_evidence for mode in modes]))
    share /= share.sum()
    skip = chain.inputs.epochs - inputs.epochs
    kept = [(mode, float(p)) for mode, p in zip(modes, share, strict=True) if p >= NEGLIGIBLE]
    table = [
        {
            "probability": p,
            "cost": mode.cost,
            "log_evidence": mode.log_evidence,
            "members": mode.members,
            "state": mode.states[skip].tolist(),
        }
        for mode, p in kept
    ]
    states = np.array([mode.states[skip:] for mode, _ in kept])
    return {"modes": table, "mode_states": states.reshape(-1, *chain.x[skip:].shape)}
