"""What an estimate says of the orbit at any date: from the epoch that is nearest before it, with the forces of the problem."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.density import departure
from piazzi.determination.setup import Setup, follow
from piazzi.earth import Epoch
from piazzi.estimate.estimator import Estimate
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.dense import products, within_kinks

ROUNDED = 1e-6  # s: dates that are an epoch but for rounding


def beliefs(given: Setup, estimate: Estimate, epochs: Sequence[Epoch]) -> tuple[Array, Array]:
    """States (K, 6) of the GCRF and covariances (K, 6, 6).

    Raises
    ------
    ValueError
        Where the orbit ends on the way.
    """
    t = np.array([epoch - given.measured.epoch for epoch in epochs])
    mean, P = np.empty((len(t), given.problem.model.n)), np.empty((len(t), *estimate.covariance.shape[1:]))
    nodes = estimate.times
    base = np.clip(np.searchsorted(nodes, t + ROUNDED, side="right") - 1, 0, len(nodes) - 1)
    one_orbit = given.problem.is_noise_free and estimate.view == "delayed" and len(t) > 1
    later = one_orbit & (t >= nodes[0])
    if later.any():
        mean[later], P[later] = _along(given, estimate, base[later], t[later])
    alone = np.flatnonzero(~later)
    for k in distinct(base[alone]):
        own = alone[base[alone] == k]
        mean[own], P[own] = _from(given, estimate, int(k), t[own])
    return mean[:, :6], P[:, :6, :6] + departure(given, estimate, t)


def _along(given: Setup, estimate: Estimate, base: Array, t: Array) -> tuple[Array, Array]:
    """Beliefs at times of one orbit, in one run from the first of their epochs.

    What the fit says at each epoch is kept: what its own steps and these make of a shadow differs by millimetres.
    """
    first = int(base.min())
    own = estimate.times[first : int(base.max()) + 1]
    nodes = distinct(np.concatenate([own, t]))
    x, Phi = follow(given.problem, nodes, estimate.mean[first], within_kinks(given.problem.model, given.chosen.max_step))
    W, at, epoch = products(Phi), np.searchsorted(nodes, t), np.searchsorted(nodes, own)[base - first]
    off = np.linalg.solve(W[epoch], (estimate.mean[base] - x[epoch])[..., None])
    return x[at] + (W[at] @ off)[..., 0], W[at] @ estimate.covariance[first] @ np.swapaxes(W[at], 1, 2)


def _from(given: Setup, estimate: Estimate, k: int, t: Array) -> tuple[Array, Array]:
    """Beliefs at times, from that at epoch k; process noise counts behind the last one."""
    start, x, P = float(estimate.times[k]), estimate.mean[k], estimate.covariance[k]
    if not given.problem.is_noise_free and k == len(estimate.times) - 1 and (t > start).all():
        order = np.argsort(t, kind="stable")
        found = estimate.predict(t[order])
        back = np.argsort(order, kind="stable")
        return found.mean[back], found.covariance[back]
    out, cov = np.empty((len(t), len(x))), np.empty((len(t), *P.shape))
    for side in (t >= start, t < start):
        if side.any():
            out[side], cov[side] = carried_to(given.problem, given.chosen.max_step, start, x, P, t[side])
    return out, cov


def carried_to(problem: Problem, step: float, start: float, x: Array, P: Array, t: Array) -> tuple[Array, Array]:
    """States (K, n) and covariances at times that are all after `start`, or all before, by steps of at most `step`."""
    step = within_kinks(problem.model, step)
    order = distinct(t) if t[0] >= start else distinct(t)[::-1]
    nodes, marks = [start], []
    for when in order.tolist():
        if when != nodes[-1]:
            parts = 1 if when > nodes[-1] else ceil((nodes[-1] - when) / step)
            nodes += np.linspace(nodes[-1], when, parts + 1)[1:].tolist()
        marks.append(len(nodes) - 1)
    states, Phi = follow(problem, np.array(nodes), x, step)
    where = np.searchsorted(order if t[0] >= start else -order, t if t[0] >= start else -t)
    at = [marks[i] for i in where]
    W = products(Phi)[at]
    return states[at], W @ P @ np.swapaxes(W, 1, 2)
