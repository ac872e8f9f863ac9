"""The extended Kalman filter with iterated updates and an innovation gate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.chi_square import quantile
from piazzi.estimate.live import LiveFilter, checked_measurement
from piazzi.estimate.saved import Saved
from piazzi.kernels import KernelSpec
from piazzi.kernels.bundle import Beliefs, Gate, Innovations
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array, frozen
from piazzi.problem.inputs import Inputs, epoch_alone, measured_by

REOPENED = "five rows in a row were beyond the gate, which was opened"


def check_gate(gate: float | None) -> None:
    """Raise ValueError for a gate that is no probability."""
    if gate is not None and not 0 < gate < 1:
        raise ValueError(f"gate is {gate}; it must be a probability between 0 and 1, such as 0.999")


@dataclass(frozen=True)
class Guard:
    """How an epoch is taken in: so many Gauss-Newton steps, and the share of good measurements that the gate lets through."""

    iterations: int
    gate: float | None

    def thresholds(self, width: int) -> Array:
        """Largest nu^T S^-1 nu of a row with 0, 1, ..., `width` components, (width + 1,)."""
        return _thresholds(self.gate, width)

    def bundle(self, rows: int, width: int) -> Gate:
        """The same for kernels, with nothing rejected so far."""
        return gate_bundle(self.iterations, self.thresholds(width), rows)


def gate_bundle(iterations: int, limits: Array, rows: int, streak: int = 0) -> Gate:
    """A gate that has rejected the last `streak` rows, and none of the `rows` to come."""
    before, rejected = np.array([streak], dtype=np.int64), np.zeros(rows, dtype=np.int64)
    return Gate(iterations=iterations, limits=limits, streak=before, rejected=rejected)


def gate_details(gate: Gate, tracking: Tracking) -> dict[str, Any]:
    """What a run's gate did: rows rejected, and where it was opened because as many as five in a row were beyond it."""
    out, opened = gate.rejected == 1, gate.rejected == 2
    out.setflags(write=False)
    details: dict[str, Any] = {"rejected": out, "rejected_count": int(out.sum())}
    if opened.any():
        opened.setflags(write=False)
        first = np.flatnonzero(opened & ~np.append(False, opened[:-1]))
        again = f" and {len(first) - 1} times later" if len(first) > 1 else ""
        details["reopened"] = opened
        details["remark"] = (
            f"{REOPENED} at t = {tracking.row_times[first[0]]:g} s{again}: {int(opened.sum()):,} rows were taken so"
        )
    return details


@lru_cache(maxsize=100)
def _thresholds(gate: float | None, width: int) -> Array:
    return frozen([np.inf, *(np.inf if gate is None else quantile(gate, m) for m in range(1, width + 1))])


def guarded_run(problem: Problem, inputs: Inputs, fragments: tuple[str, ...], guard: Guard) -> tuple[Any, ...]:
    """Means (K, n), covariances (K, n, n), innovations (J, m) with theirs (J, m, m), and the gate as the run left it."""
    library = kernels.load(guarded_spec(problem, fragments))
    K, n, (J, m) = inputs.epochs, problem.model.n, inputs.z.shape
    beliefs, innovations = Beliefs.empty(K=K, N=n), Innovations.empty(J=J, M=m)
    gate = guard.bundle(J, m)
    library.run_guarded_filter(*inputs.bundles(problem), gate, beliefs, innovations)
    return (*beliefs.members, *innovations.members, gate)


def guarded_spec(problem: Problem, fragments: tuple[str, ...]) -> KernelSpec:
    """The module of a problem's guarded filter, with these fragments of the update."""
    return problem.spec("transition", problem.noise_fragment, *fragments, "epoch_guarded", "filter_guarded")


class GuardedLiveFilter(LiveFilter):
    """A filter in progress with iterated updates and a gate: the measurements of an epoch so far are taken together.

    Attributes
    ----------
    rejected, reopened : bool
        Whether the gate rejected the last measurement; or took one beyond it, because it had rejected five in a row.
    """

    _shown: ClassVar[tuple[str, ...]] = (*LiveFilter._shown, "rejected", "reopened")
    saved_names: ClassVar[tuple[str, ...]] = (*LiveFilter.saved_names, "epoch_values", "epoch_stations", "streak")

    def __init__(self, problem: Problem, fragments: tuple[str, ...], guard: Guard) -> None:
        super().__init__(problem, fragments)
        m = problem.model.width
        parts = ("transition", problem.noise_fragment, *fragments, "epoch_guarded", "filter_live_guarded")
        self._library = kernels.load(problem.spec(*parts))
        self._settings, self._guard = (fragments, guard), guard
        self._values, self._rows_of = np.empty((0, m)), np.empty(0, dtype=np.int64)
        self.rejected = self.reopened = False
        self._streak = np.zeros(2, dtype=np.int64)  # rows rejected in a row, before this epoch and now

    def predict(self, t: float) -> None:
        before = self._predicted_to
        super().predict(t)
        if t != before:
            self._values, self._rows_of = self._values[:0], self._rows_of[:0]
            self._streak[0] = self._streak[1]

    def update(self, station: str, z: Any, t: float | None = None) -> None:
        s = checked_measurement(self.problem, self._stations, station, z, self._row[0])
        if t is not None:
            self.predict(t)
        elif self._predicted_to is None:
            raise ValueError(
                "the time of the first measurement is not known: call predict(t) first, or give the problem a prior_time"
            )
        self._values = np.vstack([self._values, self._row])
        self._rows_of = np.append(self._rows_of, np.int64(s))
        rows, m = self._values.shape
        gate = gate_bundle(self._guard.iterations, self._guard.thresholds(m), rows, int(self._streak[0]))
        innovations = Innovations.empty(J=rows, M=m)
        self._library.live_update_guarded(
            epoch_alone(self.problem, float(self._times[3]), rows),
            self.problem.given_bundle,
            measured_by(self.problem, self._values, self._rows_of),
            gate,
            self._predicted,
            self._now,
            innovations,
            self.widest,
        )
        self.innovation[:], self.innovation_covariance[:] = innovations.nu[-1], innovations.S[-1]
        self._streak[1], self._measured = gate.streak[0], True
        self.rejected, self.reopened = bool(gate.rejected[-1] == 1), bool(gate.rejected[-1] == 2)
        if self._has_roots:
            self._look_for_root(s, float(self._times[3]))

    def _saved_state(self) -> dict[str, Array]:
        own = {
            "epoch_values": self._values.copy(),
            "epoch_stations": self._rows_of.copy(),
            "streak": self._streak.astype(float),
        }
        return super()._saved_state() | own

    def _checked(self, saved: Mapping[str, Array]) -> dict[str, Array]:
        values, rows_of = Saved(saved, self.problem).measurements("epoch_values", "epoch_stations")
        rows = {"epoch_values": values, "epoch_stations": rows_of, "streak": checked_streak(saved, self.problem)}
        return super()._checked(saved) | rows

    def _set_state(self, kept: Mapping[str, Array]) -> None:
        super()._set_state(kept)
        self._values, self._rows_of = kept["epoch_values"], kept["epoch_stations"]
        self._streak[:] = kept["streak"]


def checked_streak(saved: Mapping[str, Array], problem: Problem) -> Array:
    """Rows that a gate rejected in a row, before an epoch and with it, of a checkpoint: none in those of earlier versions."""
    return Saved({"streak": np.zeros(2), **saved}, problem).whole("streak", 2, 0, 2**31)
