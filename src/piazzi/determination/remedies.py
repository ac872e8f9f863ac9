"""What would explain residuals that are larger than their sigmas, or go together: the unknowns that are worth asking for.

Each candidate adds to the linear problem about the solution normal values of zero mean and one common size: accelerations along
R, T and N, constant or as first-order Gauss-Markov processes, a bias of each pass, or more noise.  What the solution may
take up is taken out first, and the size is that of the largest evidence (empirical Bayes), so that a candidate with many
values is not better for having them.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import NamedTuple

import numpy as np

from piazzi.arrays import distinct, median
from piazzi.determination.analysis import Analysis
from piazzi.determination.completeness import carrying
from piazzi.determination.passes import pass_of_rows
from piazzi.determination.setup import Setup, scale_of
from piazzi.earth.force_options import CONSTANT
from piazzi.estimate.chi_square import quantile
from piazzi.orbit import orbit_axes
from piazzi.problem.checks import Array

SURE = 0.999
PARTS = 4  # of the time of a process, in each of which it is constant
MOST = 48  # parts in all
TURNS = (0.25, 1.0, 4.0)  # of the orbit, that processes are tried with
LARGEST = 20_000_000  # numbers of the derivatives by what is tried
SIZES = np.geomspace(1e-3, 1e4, 141)  # of what is tried, in units of its least sigma from the measurements
LOUDEST = 10.0
HOURS = 3600.0
STEADY = f"--estimate '{' '.join(CONSTANT)}'"


class Remedy(NamedTuple):
    """What to ask for, as options have it, and by how much it is more likely: twice the logarithm of the evidence gained."""

    words: str
    gain: float


def remedy(given: Setup, states: Array, analysis: Analysis, keep: Array) -> str:
    """The option that explains the residuals of the rows that are kept best, "" where none does so surely.

    Constant accelerations are named beside processes where they explain something, as an orbit with them stays one arc.
    """
    if not given.problem.is_noise_free or given.measured.about != "earth":
        return ""
    there = np.isfinite(analysis.whitened) & keep[:, None]
    unit = scale_of(given, states[0])
    if int(there.sum()) * (3 * MOST + len(unit)) > LARGEST or not int(there.sum()) > len(unit):
        return ""
    H = np.vstack([analysis.rows[there], analysis.prior]) * unit
    left, _, _ = np.linalg.svd(H, full_matrices=False)
    off = np.concatenate([analysis.whitened[there], analysis.prior_miss])

    def apart(columns: Array) -> Array:
        """What of columns (R, ...) the solution does not take up."""
        return np.asarray(columns - left @ (left.T @ columns))

    rest = apart(off)
    found = [_noise(rest, len(off) - len(unit))]
    blank = np.zeros((len(analysis.prior), 1))
    for words, size, A in _candidates(given, states, analysis, there):
        found.append(_weighed(words, size, apart(np.vstack([A, np.repeat(blank, A.shape[1], axis=1)])), rest))
    sure = {one.words: one.gain for one in found if one.gain > quantile(SURE, 1)}
    best = max(sure, key=lambda words: sure[words], default="")
    return f"{STEADY}, better by {best}" if STEADY in sure and "~" in best else best


def _noise(rest: Array, free: int) -> Remedy:
    """More noise of all measurements; nobody's sigmas are wrong by more than `LOUDEST` times, then it is the model that is."""
    squares = float(rest @ rest)
    share = max(squares / max(free, 1), 1.0)
    if share > LOUDEST**2:
        return Remedy("", 0.0)
    return Remedy(f"--sigma {share**0.5:.2g} times as large", squares * (1.0 - 1.0 / share) - free * float(np.log(share)))


def _weighed(words: str, size: float, A: Array, rest: Array) -> Remedy:
    """Of columns that the solution takes nothing up of: the evidence at the size that makes it largest."""
    U, singular, _ = np.linalg.svd(A, full_matrices=False)
    if not singular[0] > 0.0:
        return Remedy("", 0.0)
    share = (U.T @ rest) ** 2
    sizes = SIZES / singular[0]
    grown = np.square(sizes[:, None] * singular)
    gain = np.sum(share * grown / (1.0 + grown) - np.log1p(grown), axis=1)
    best = int(np.argmax(gain))
    return Remedy(words.format(f"{sizes[best] * size:.0e}".replace("e-0", "e-")), float(gain[best]))


def _candidates(given: Setup, states: Array, analysis: Analysis, there: Array) -> Iterator[tuple[str, float, Array]]:
    """Words, the unit of a size in them, and derivatives (R, k) of whitened values by numbers of unit variance."""
    yield from _accelerations(given, states, analysis, there)
    yield from _biases(given, analysis, there)


def _accelerations(given: Setup, states: Array, analysis: Analysis, there: Array) -> Iterator[tuple[str, float, Array]]:
    t, path, back = carrying(given, states)
    if not t[-1] > t[0]:
        return
    axes = orbit_axes(path[:, :3], path[:, 3:6])
    rate = back @ np.swapaxes(axes, 1, 2)  # (K, 6, 3), of the first state by an acceleration along R, T and N
    total = np.concatenate([np.zeros((1, 6, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, None, None], axis=0)])
    flat, span = total.reshape(len(t), -1), float(t[-1] - t[0])
    which = np.nonzero(there)[0]
    rows, when = analysis.rows[there][:, :6], given.tracking.row_times[which]

    def moved(start: float, end: float) -> Array:
        """Whitened values (R, 3) by an acceleration between two times."""
        inside = np.clip(when, start, end)
        change = np.stack([np.interp(inside, t, one) - np.interp(start, t, one) for one in flat.T], axis=1)
        return np.asarray(np.einsum("ri,rij->rj", rows, change.reshape(-1, 6, 3)))

    yield STEADY, 1.0, moved(float(t[0]), float(t[-1]))
    turn = 2.0 * np.pi / given.measured.centre.turning(states[0, :3], states[0, 3:6])
    for time in (turn * share for share in TURNS):
        count = ceil(PARTS * span / time)
        if not PARTS <= count <= MOST:
            continue
        edges = np.linspace(t[0], t[-1], count + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        root = np.linalg.cholesky(np.exp(-np.abs(middle[:, None] - middle) / time) + 1e-12 * np.eye(count))
        parts = np.stack([moved(a, b) for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)], axis=2)
        said = _time(time)
        yield f"--estimate '{' '.join(f'{a}~{said}={{0}}m/s^2' for a in CONSTANT)}'", 1.0, (parts @ root).reshape(len(rows), -1)


def _biases(given: Setup, analysis: Analysis, there: Array) -> Iterator[tuple[str, float, Array]]:
    """A bias of each pass, of one kind of measurement after the other."""
    row, column = np.nonzero(there)
    passes = pass_of_rows(given.measured, given.tracking, given.rows)[row]
    stations = given.tracking.stations_of(given.problem)[row]
    sensors = {s.name: s for s in given.problem.model.sensors}
    kinds = np.array([
        sensors[given.problem.stations[s].sensor].components[c] for s, c in zip(stations.tolist(), column.tolist(), strict=True)
    ])  # fmt: skip
    for kind in dict.fromkeys(kinds.tolist()):
        if not any(f"{kind}_bias" in dict(getattr(s, "defaults", ())) for s in sensors.values()):
            continue
        own = kinds == kind
        every = distinct(passes[own])
        if len(every) > MOST:
            continue
        size = median(np.abs(analysis.residual[there][own] / analysis.whitened[there][own]))
        unit = next(dict(s.units).get(kind, "") for s in sensors.values() if kind in s.components)
        yield f"--estimate bias.{kind}/pass={{0}}{unit}", size, (passes[:, None] == every) * own[:, None].astype(float)


def _time(seconds: float) -> str:
    """As options take it."""
    return f"{seconds / HOURS:.2g}h" if seconds >= HOURS else f"{seconds / 60.0:.2g}min"
