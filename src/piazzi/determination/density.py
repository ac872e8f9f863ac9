"""How far the density of the air departs from that of a fit once nothing is measured any more.

A coefficient of drag takes up what the density is off by over the measurements.  Behind them it goes on to vary with the Sun
and the geomagnetic field, so that a prediction is worse than the fit alone says.  The departure is a first-order Gauss-Markov
process, whose effect is carried along the orbit by the derivatives of the state by the coefficient.
"""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np

from piazzi.determination.setup import Setup, follow
from piazzi.estimate.estimator import Estimate
from piazzi.problem.checks import Array

NODES = 20.0  # parts of the process's time, in each of which it is constant


class Column(NamedTuple):
    """Where the constant that drag goes by at the end stands, and its value."""

    place: int
    value: float


def departure(given: Setup, estimate: Estimate, t: Array) -> Array:
    """Covariance (K, 6, 6) that the departure adds at times, zero up to the last measurement."""
    out = np.zeros((len(t), 6, 6))
    air, column = given.chosen.air_varies, _column(given, estimate)
    measured = np.isfinite(given.tracking.values).any(axis=1)
    last = float(given.tracking.row_times[measured][-1]) if measured.any() else np.inf
    late = np.flatnonzero(t > last)
    if air is None or column is None or not len(late) or not given.problem.is_noise_free:
        return out
    start = float(estimate.times[-1])
    nodes = np.unique(np.concatenate([[start], np.arange(start, t.max(), air.time / NODES), t[t > start]]))
    _, Phi = follow(given.problem, nodes, estimate.mean[-1], given.chosen.max_step)
    S = np.zeros((7, 7))
    S[6, 6] = air.sigma**2
    found = {start: S[:6, :6].copy()}
    A = np.zeros((7, 7))
    for when, dt, one in zip(nodes[1:].tolist(), np.diff(nodes).tolist(), Phi, strict=True):
        left = exp(-dt / air.time)
        A[:6, :6], A[:6, 6], A[6, 6] = one[:6, :6], one[:6, column.place] * column.value, left
        S = A @ S @ A.T
        S[6, 6] += air.sigma**2 * (1.0 - left**2)
        found[when] = S[:6, :6].copy()
    for k in late.tolist():
        out[k] = found.get(float(t[k]), out[k])
    return out


def _column(given: Setup, estimate: Estimate) -> Column | None:
    """The coefficient of drag, or its value for the last part of the time; None where it is not estimated."""
    names = [n for n in given.problem.model.constants if n == "cd_a_m" or n.startswith("cd_a_m_")]
    if not names:
        return None
    place = given.problem.model.names.index(names[-1])
    return Column(place, float(estimate.mean[-1, place]))
