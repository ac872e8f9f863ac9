"""Many runs of one problem together, an ensemble: simulation, the extended Kalman filter, and what its errors are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from piazzi import kernels
from piazzi.kernels.bundle import Accuracy, Drawn, Ends, Given, Run, Samples, Stations
from piazzi.kernels.spec import machine_lanes
from piazzi.problem import Problem
from piazzi.problem.checks import Array


@dataclass(frozen=True, eq=False)
class Layout:
    """What all runs of a simulated study share: epochs, and which station measures in which row.

    Shapes: `times` (K,); `first_row` (K + 1,); `station` (J,), with every station at every epoch.
    """

    problem: Problem
    times: Array

    @cached_property
    def first_row(self) -> Array:
        return np.arange(len(self.times) + 1, dtype=np.int64) * len(self.problem.stations)

    @cached_property
    def station(self) -> Array:
        return np.tile(np.arange(len(self.problem.stations), dtype=np.int64), len(self.times))

    @cached_property
    def width(self) -> Array:
        """Components of each station, (S,)."""
        return np.array([len(s.noise) for s in self.problem.stations], dtype=np.int64)

    @cached_property
    def angle(self) -> Array:
        """Marks of components that are angles, (S, M)."""
        out = np.zeros((len(self.problem.stations), self.problem.model.width), dtype=np.int64)
        for s, station in enumerate(self.problem.stations):
            out[s, : self.width[s]] = self.problem.model.sensor(station.sensor).is_angle
        return out

    @cached_property
    def root(self) -> Array:
        """Lower Cholesky factor of R of each station, (S, M, M)."""
        return np.linalg.cholesky(self.problem.station_noise)

    @cached_property
    def whitening(self) -> Array:
        """Inverse of those factors, by forward substitution."""
        L = self.root
        out = np.zeros_like(L)
        for i in range(L.shape[1]):
            row = -np.einsum("sj,sjk->sk", L[:, i, :i], out[:, :i, :])
            row[:, i] += 1.0
            out[:, i, :] = row / L[:, i, i, None]
        return out

    @cached_property
    def member(self) -> Array:
        """Which states each group of states has, (G, n)."""
        model = self.problem.model
        groups = model.group_indices or {name: (i,) for i, name in enumerate(model.names)}
        out = np.zeros((len(groups), model.n), dtype=np.int64)
        for g, columns in enumerate(groups.values()):
            out[g, list(columns)] = 1
        return out

    def bundles(self, moving: Problem) -> tuple[Run, Given, Stations]:
        """Epochs, model and stations as kernels take them, for runs that move as `moving` says."""
        start, count, scale = moving.intervals(self.times)
        run = Run(
            epochs=len(self.times),
            t_prior=start,
            t=self.times,
            count=count,
            scale=scale,
            first_row=self.first_row,
            Q=moving.process_noise.covariance,
        )
        return run, moving.given_over(start, float(self.times[-1])), self._stations(moving)

    def _stations(self, moving: Problem) -> Stations:
        return Stations(
            station=self.station,
            sensor=moving.station_sensor,
            width=self.width,
            angle=self.angle,
            numbers=moving.station_numbers,
            R=self.problem.station_noise,
            W=self.whitening,
            correlated=self.problem.station_correlated,
        )


@dataclass(frozen=True, eq=False)
class Scores:
    """Errors of M runs at every epoch.

    Attributes
    ----------
    squared : (M, G, K), squared length of the error in each group of states
    spread : (M, G, K), the variance that the covariance gives it
    nees : (M, K)
    nis : (M, J), of each row of measurements at its prediction
    lowest : (M,), smallest pivot of a correlation matrix on the way: what is not far above rounding needs another look
    """

    squared: Array
    spread: Array
    nees: Array
    nis: Array
    lowest: Array


def lane_count() -> int:
    """Runs that advance together: eight, so that where registers hold four, one waits for its roots while another works."""
    if not kernels.is_compiled():
        return 1
    return max(machine_lanes(), 8) if machine_lanes() > 1 else 1


def simulate_runs(layout: Layout, actual: Problem, first: Array, w: Array, v: Array, noisy: bool = True) -> tuple[Array, Array]:
    """True states (M, K, n) and measurements (M, J, m) of M runs, from their first states and unit normal draws.

    Parameters
    ----------
    layout : Layout of the problem as the sensors are
    actual : Problem as it moves
    first : (M, n), true states at the time of the prior
    w, v : (M, K, n) and (M, J, m), standard normal
    noisy : whether the sensors have errors
    """
    M = len(w)
    first, w, v = _padded(first, w, v)
    R_root = layout.root if noisy else np.zeros_like(layout.root)
    drawn = Drawn(first=first, w=w, v=v, Q_root=semidefinite_root(actual.process_noise.covariance), R_root=R_root)
    samples = Samples(many=len(w), rows=v.shape[1], truth=np.empty(w.shape), z=np.full(v.shape, np.nan))
    run, p, stations = layout.bundles(actual)
    library(actual).simulate_lanes(run, p, stations, drawn, samples)
    return samples.truth[:M], samples.z[:M]


def filter_runs(layout: Layout, z: Array, truth: Array, *, at_truth: bool = False) -> tuple[Array, Array, Scores]:
    """The extended Kalman filter on M runs at once, measurements (M, J, m) of true states (M, K, n).

    Returns
    -------
    mean, covariance : (M, n) and (M, n, n), at the last epoch
    scores : Scores

    With `at_truth`, everything is linearised at the truth and the mean stays there: the covariances are then the Cramer-Rao
    bound of each run.
    """
    problem, M = layout.problem, len(z)
    z, truth = _padded(z, truth)
    (runs, J, _), (_, K, n), member = z.shape, truth.shape, layout.member
    G = len(member)
    samples, ends = Samples(many=runs, rows=J, truth=truth, z=z), Ends.empty(runs=runs, N=n)
    squared, spread = np.empty((2, runs, G, K))
    nees, nis, lowest = np.empty((runs, K)), np.empty((runs, J)), np.empty(runs)
    accuracy = Accuracy(groups=G, member=member, squared=squared, spread=spread, nees=nees, nis=nis, lowest=lowest)
    run, p, stations = layout.bundles(problem)
    library(problem).filter_lanes(run, p, stations, problem.prior_bundle, samples, int(at_truth), ends, accuracy)
    return ends.mean[:M], ends.covariance[:M], Scores(squared[:M], spread[:M], nees[:M], nis[:M], lowest[:M])


def semidefinite_root(Q: Array) -> Array:
    """Lower Cholesky factor of a semidefinite matrix: a direction without noise has a zero column."""
    L = np.array(Q, dtype=float)
    for j in range(len(L)):
        pivot = L[j, j] - (L[j, :j] ** 2).sum()
        root = np.sqrt(pivot) if pivot > 1e-13 * Q[j, j] else 0.0
        L[j + 1 :, j] = (L[j + 1 :, j] - (L[j + 1 :, :j] * L[j, :j]).sum(axis=1)) / root if root else 0.0
        L[j, j], L[j, j + 1 :] = root, 0.0
    return L


def library(problem: Problem) -> SimpleNamespace:
    """The kernels of an ensemble, built where they are new."""
    fragments = ("transition", "step_lanes", "score_lanes", "simulate_lanes", "filter_lanes")
    return kernels.load(problem.spec(*fragments, lanes=lane_count()))


def _padded(*arrays: Array) -> tuple[Array, ...]:
    """Arrays of runs, the last run repeated where there are fewer than lanes."""
    missing = lane_count() - len(arrays[0])
    if missing > 0:
        arrays = tuple(np.concatenate([a, np.repeat(a[-1:], missing, axis=0)]) for a in arrays)
    return tuple(np.ascontiguousarray(a) for a in arrays)
