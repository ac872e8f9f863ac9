"""A filter that propagates a square root of its covariance, fed one measurement at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from piazzi.estimate.guarded import checked_streak
from piazzi.estimate.live import Clock, checked_measurement, clock_times
from piazzi.estimate.root import Results, Root, RootKernel
from piazzi.estimate.saved import Saved
from piazzi.estimate.session import Session
from piazzi.kernels.bundle import Run
from piazzi.problem import Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import measured_by
from piazzi.problem.lost_root import has_roots


class _Epoch:
    """An epoch of so many rows, whose arrays are written in place and whose results are read before the next one."""

    def __init__(self, kernel: RootKernel, rows: int) -> None:
        problem = kernel.problem
        self.t, self.count, self.scale = np.empty(1), np.empty(1, dtype=np.int64), np.empty(1)
        self._first_row, self._Q = np.array([0, rows]), problem.process_noise.covariance
        self.measured = measured_by(problem, np.empty((rows, problem.model.width)), np.empty(rows, dtype=np.int64))
        self.results = kernel.results(1, rows)

    def run(self, before: float) -> Run:
        """The run over this epoch from a belief at the time `before`."""
        times = {"t_prior": before, "t": self.t, "count": self.count, "scale": self.scale}
        return Run(epochs=1, first_row=self._first_row, Q=self._Q, **times)


KEPT = 16  # rows of epochs whose arrays are used again


class LiveRootFilter(Session):
    """An unscented or square-root filter in progress, from its ``start(problem)``.

    ``predict(t)`` moves to a time, ``update(station, z)`` takes a measurement there; several updates at one time are one epoch,
    taken at the prediction.  Every call runs the last epoch anew, by the code of the whole run: so the numbers are the same.

    Attributes
    ----------
    time : float or None
        Seconds; None before the first call of a problem without `prior_time`.
    mean, covariance : (n,), (n, n)
        The current belief: predicted, or updated.
    innovation, innovation_covariance : (m,), (m, m), of the last update
    rejected, reopened : whether the gate rejected the last measurement, or took it though beyond, being open
    success, message : whether the belief is finite with a semidefinite covariance; else why not
    """

    _shown: ClassVar[tuple[str, ...]] = (*Session._shown, "rejected", "reopened")
    _arrays: ClassVar[tuple[str, ...]] = ("base_mean", "base_root", "root", "mean", "covariance")
    saved_names: ClassVar[tuple[str, ...]] = (*_arrays, "epoch_values", "epoch_stations", "streak", "clock")

    def __init__(self, problem: Problem, root: Root) -> None:
        self.problem, self._settings = problem, (root,)
        self._has_roots = has_roots(problem.model)
        self._kernel, self._clock = root.kernel(problem), Clock(problem)
        self._stations = {s.name: i for i, s in enumerate(problem.stations)}
        m = problem.model.width
        self.mean, self.covariance = problem.mean.copy(), problem.covariance.copy()
        self.innovation, self.innovation_covariance = np.full(m, np.nan), np.full((m, m), np.nan)
        self.rejected = self.reopened = False
        self._streak = np.zeros(2, dtype=np.int64)  # rows rejected in a row, before this epoch and now
        self.base_mean, self.root = problem.mean.copy(), self._kernel.prior_root()
        self.base_root = self.root.copy()
        self._row, self._values, self._rows_of = np.full(m, np.nan), np.empty((0, m)), np.empty(0, dtype=np.int64)
        self.time, self._epochs = problem.prior_time, dict[int, _Epoch]()

    def predict(self, t: float) -> None:
        """Carry the belief to time `t`, from the last epoch that had a measurement; raises ValueError where `t` is earlier."""
        if self._move(t):
            self._run()

    def _move(self, t: float) -> bool:
        """Close the epoch that stands, unless `t` belongs to it; whether a new one began."""
        measured = len(self._values) > 0
        if measured and t == self.time:
            return False
        self._clock.interval(t, self.time if measured else None)  # a time that is refused changes nothing
        if measured:
            self._clock.time, self.base_mean, self.base_root = self.time, self.mean, self.root
            self._values, self._rows_of = self._values[:0], self._rows_of[:0]
            self._streak[0] = self._streak[1]
        self.time = t
        return True

    def update(self, station: str, z: Any, t: float | None = None) -> None:
        """Take in a measurement of a station, at `t` or where the last prediction stands; NaN where a component is missing.

        Raises
        ------
        ValueError
            For an unknown station, a wrong number of components, an infinite value, or a time that has passed.
        """
        s = checked_measurement(self.problem, self._stations, station, z, self._row)
        if t is not None:
            self._move(t)
        elif self.time is None:
            raise ValueError(
                "the time of the first measurement is not known: call predict(t) first, or give the problem a prior_time"
            )
        self._values = np.concatenate([self._values, self._row[None]])
        self._rows_of = np.concatenate([self._rows_of, [s]])
        gate, _, innovations = self._run()
        self.innovation, self.innovation_covariance = innovations.nu[-1].copy(), innovations.S[-1].copy()
        self.rejected, self.reopened = bool(gate.rejected[-1] == 1), bool(gate.rejected[-1] == 2)
        if self._has_roots and self.time is not None:
            self._look_for_root(s, self.time)

    def _run(self) -> Results:
        """The epoch at `time`, with the rows that it has so far, from the belief before it."""
        assert self.time is not None
        t, rows = self.time, len(self._values)
        epoch, dt = self._epochs.get(rows) or _Epoch(self._kernel, rows), self._clock.interval(t)
        if rows <= KEPT:
            self._epochs[rows] = epoch
        epoch.t[0] = t
        epoch.count[0], epoch.scale[0] = self._clock.step(dt) if dt > 0 else (1, 0.0)
        epoch.measured.z[:], epoch.measured.station[:] = self._values, self._rows_of
        run = epoch.run(t if self._clock.time is None else self._clock.time)
        streak = epoch.results[0].streak
        streak[0] = self._streak[0]
        self.root = self._kernel.run(run, epoch.measured, self.base_mean, self.base_root, epoch.results).copy()
        self._streak[1] = streak[0]
        beliefs = epoch.results[1]
        self.mean, self.covariance = beliefs.mean[0].copy(), beliefs.covariance[0].copy()
        return epoch.results

    # ---- what it stands on ---------------------------------------------------------------------------------------

    @property
    def _belief_time(self) -> float | None:
        return self.time

    def _foretold(self, t: float) -> Array:
        since = t if self._clock.time is None else self._clock.time
        return self.problem.step(self.base_mean, t - since, since)[0] if t > since else self.base_mean

    def _beliefs(self) -> list[tuple[Array, Array]]:
        return [(self.mean, self.covariance), (self.base_mean, self.covariance)]  # roots are of semidefinite ones

    def _saved_state(self) -> dict[str, Array]:
        clock = [np.nan if v is None else v for v in (self._clock.time, self.time)]
        rows = {
            "epoch_values": self._values.copy(),
            "epoch_stations": self._rows_of.copy(),
            "streak": self._streak.astype(float),
        }
        return {name: getattr(self, name).copy() for name in self._arrays} | rows | {"clock": np.array(clock)}

    def _checked(self, saved: Mapping[str, Array]) -> dict[str, Array]:
        checked, n = Saved(saved, self.problem), self.problem.model.n
        found = {name: checked.mean(name) for name in ("base_mean", "mean")}
        found |= {name: checked.array(name, n, n) for name in ("base_root", "root")}
        values, rows_of = checked.measurements("epoch_values", "epoch_stations")
        rows = {"epoch_values": values, "epoch_stations": rows_of, "streak": checked_streak(saved, self.problem)}
        return found | rows | {"covariance": checked.covariance("covariance"), "clock": checked.clock("clock", 2)}

    def _set_state(self, kept: Mapping[str, Array]) -> None:
        for name in self._arrays:
            setattr(self, name, kept[name])
        self._values, self._rows_of = kept["epoch_values"], kept["epoch_stations"]
        self._streak[:] = kept["streak"]
        self._clock.time, self.time = clock_times(kept["clock"])
