"""An estimate in progress whose stations and kinds of measurement may become more, and what it made of every row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from piazzi.determination.faults import BEYOND
from piazzi.determination.fit import kept
from piazzi.determination.sensing import Measured
from piazzi.determination.setup import Setup, at_last_used, follow, renewed
from piazzi.earth import Epoch
from piazzi.estimate.estimator import Estimate
from piazzi.orbit import state_axes
from piazzi.problem import Problem
from piazzi.problem.checks import Array

LATE = "older than what the estimate still holds"
OPENED = f"{BEYOND}, which is open"
MOST, RECENT = 64, 32  # stations of a problem, of which those that measured last are kept when they become more
AXES = ("R", "T", "N")


@dataclass(frozen=True)
class Taken:
    """What became of a row.

    Attributes
    ----------
    time, station : when and where it was measured
    residuals : by component what was measured less what was predicted, in sigma of that; None where nothing was predicted
    used, reason : whether it was taken in; why not, or what should be known of it
    sigma : (3,) m, of the position along R, T and N after it
    """

    time: Epoch
    station: str
    residuals: Mapping[str, float | None]
    used: bool
    reason: str
    sigma: tuple[float, float, float]

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "time": str(self.time), "station": self.station, "residuals": dict(self.residuals), "used": self.used,
            "reason": self.reason, "sigma": dict(zip(AXES, self.sigma, strict=True)),
        }  # fmt: skip

    def __str__(self) -> str:
        told = " ".join(f"{name} {'-' if value is None else f'{value:+.2f}'}" for name, value in self.residuals.items())
        sigma = " ".join(f"{axis} {value:.3g}" for axis, value in zip(AXES, self.sigma, strict=True))
        state = f"{'used' if self.used else 'rejected'}{f' ({self.reason})' if self.reason else ''}"
        return f"{self.time}  {self.station}  {told} sigma  {state}  {sigma} m"


class _Record(NamedTuple):
    """Of a row: the belief after it, its innovation with covariance, and why it was not used."""

    mean: Array | None
    covariance: Array | None
    nu: Array
    S: Array
    reason: str


class Live:
    """The estimate in progress of a set-up, from `estimator.start`."""

    def __init__(self, given: Setup, estimator: Any) -> None:
        self.given, self.estimator, self.problem = given, estimator, given.problem
        self.session = estimator.start(given.problem)
        first = given.measured
        self._sensors = {sensor.name: sensor for sensor in first.sensors}
        self._flags = {
            (first.labels[s.name], s.sensor): {n: v for n, v in s.numbers.items() if n.startswith("is_")}
            for s in first.stations
        }  # fmt: skip
        self._names = {_key(first, s): s.name for s in first.stations}
        self._functions, self._parameters = dict(first.functions), dict(first.parameters)
        self._last = {s.name: 0 for s in first.stations}
        self._records: dict[int, _Record] = {}
        self._taken = self._rows = 0

    # ---- stations ------------------------------------------------------------------------------------------------

    def with_constants(self, seen: Measured) -> Measured:
        """Rows with the constants of instruments that the estimate began with, at the stations that have them."""
        first = self.given.measured
        stations = tuple(
            replace(s, numbers={**s.numbers, **self._flags.get((seen.labels[s.name], s.sensor), {})}) for s in seen.stations
        )
        own = {name: first.parameters[name] for name in first.labels_of_constants if name in first.parameters}
        return replace(
            seen, sensors=tuple(self._sensors.get(s.name, s) for s in seen.sensors), stations=stations,
            parameters={**seen.parameters, **own}, labels_of_constants=first.labels_of_constants,
        )  # fmt: skip

    def widen(self, seen: Measured) -> None:
        """Make the problem know the stations of these rows; the estimate goes on where it stands.

        Raises
        ------
        ValueError
            Where they bring unknowns that the estimate has not.
        """
        new = [s for s in seen.stations if _key(seen, s) not in self._names]
        if not new:
            return
        saved = self.session.checkpoint()
        where = "station" if "station" in saved else "epoch_stations"
        old = self._held(saved.get(where, np.zeros(0)))
        for s in new:
            self._sensors.setdefault(s.sensor, next(one for one in seen.sensors if one.name == s.sensor))
        names = {s.name for s in old}
        added = []
        for s in new:
            name, k = seen.labels[s.name], 1
            while name in names:
                name, k = f"{seen.labels[s.name]} ({k + 1})", k + 1
            names.add(name)
            added.append(replace(s, name=name))
            self._names[_key(seen, s)] = name
            self._last[name] = self._taken
        self._functions |= seen.functions
        self._parameters |= seen.parameters
        before = self.problem
        index = {s.name: i for i, s in enumerate(old)}
        stations = np.array([index.get(s.name, 0) for s in before.stations])
        self.problem = self._posed(replace(
            self.given.measured, sensors=tuple(self._sensors.values()), stations=(*old, *added),
            functions=self._functions, parameters=self._parameters,
        ))  # fmt: skip
        if self.problem.model.names != before.model.names:
            more = ", ".join(n for n in self.problem.model.names if n not in before.model.names)
            raise ValueError(f"measurements of a kind that was not among the first ones bring unknowns ({more}): begin anew")
        if where in saved and len(saved[where]):
            saved[where] = stations[np.asarray(saved[where], dtype=np.int64)]
        self.session = self.estimator.start(self.problem)
        self.session.restore(_wider(saved, before.model.width, self.problem.model.width, self.problem.model.n))

    def _held(self, rows: Array) -> list[Any]:
        """Stations that stay in the problem: all, or of too many those of rows still held and those that measured last."""
        stations = list(self.problem.stations)
        if len(stations) <= MOST:
            return stations
        held = {stations[int(i)].name for i in np.asarray(rows).tolist()}
        held |= {*sorted(self._last, key=lambda name: -self._last[name])[:RECENT]}
        self._names = {key: name for key, name in self._names.items() if name in held}
        self._last = {name: when for name, when in self._last.items() if name in held}
        return [s for s in stations if s.name in held]

    def _posed(self, seen: Measured) -> Problem:
        """The problem of other rows, with the prior, the noise and the constants that this one began with."""
        return renewed(self.given, seen, self.given.chosen).problem

    # ---- rows ----------------------------------------------------------------------------------------------------

    def take(self, seen: Measured, keep: Array | None = None, reasons: Array | None = None) -> list[Taken]:
        """Rows in order of time; those that are not to be kept (J,) are told of and left.

        Raises
        ------
        ValueError
            Where the estimate cannot be used any more, with the row.
        """
        tracking, out = seen.tracking, []
        by_name = {s.name: s for s in seen.stations}
        components = {s.name: s.components for s in seen.sensors}
        for j, (t, row) in enumerate(zip(tracking.row_times.tolist(), seen.rows, strict=True)):
            if not (row >= 0).any() or np.isnan(tracking.values[j]).all():
                continue
            station = by_name[str(tracking.row_stations[j])]
            label, parts = seen.labels[station.name], components[station.sensor]
            why = "" if keep is None or keep[j] or reasons is None else str(reasons[j])
            record = self._record(self._names[_key(seen, station)], tracking.values[j, : len(parts)], t, why)
            for index in row[row >= 0].tolist():
                self._records[self._rows + index] = record
            when = seen.epoch + t
            if not isfinite(float(self.session.mean[0])):
                raise ValueError(f"with {label} at {when}: {self.session.message}")
            scale = np.sqrt(np.diagonal(record.S))[: len(parts)]
            told = {
                name: float(e / s) if isfinite(e) and s > 0 else None
                for name, e, s in zip(parts, record.nu.tolist(), scale.tolist(), strict=False)
            }
            out.append(Taken(when, label, told, not record.reason or record.reason == OPENED, record.reason, self._sigma()))
        self._rows += len(seen.observations)
        if not self.session.success:
            last = f"after {out[-1].station} at {out[-1].time}: " if out else ""
            raise ValueError(f"{last}{self.session.message}")
        return out

    def _record(self, name: str, z: Array, t: float, why: str) -> _Record:
        """Take in a row, unless there is a reason against it."""
        session, m = self.session, self.problem.model.width
        nothing = _Record(None, None, np.full(m, np.nan), np.full((m, m), np.nan), why or LATE)
        if why or (session.time is not None and t < session.time and not hasattr(session, "lag")):
            return nothing
        if session.update(name, z, t) is False:
            return nothing
        self._taken += 1
        self._last[name] = self._taken
        opened = getattr(session, "reopened", False)
        reason = BEYOND if getattr(session, "rejected", False) else OPENED if opened else ""
        late = t < session.time
        mean, P = (None, None) if late else (session.mean.copy(), session.covariance.copy())
        return _Record(mean, P, session.innovation.copy(), session.innovation_covariance.copy(), reason)

    def _sigma(self) -> tuple[float, float, float]:
        """Of the position along R, T and N."""
        mean, P = self.session.mean, self.session.covariance
        axes = state_axes(mean[:3], mean[3:6])[:3, :3]
        r, t, n = np.sqrt(np.maximum(np.diag(axes @ P[:3, :3] @ axes.T), 0.0)).tolist()
        return r, t, n

    # ---- all of it -----------------------------------------------------------------------------------------------

    def whole(self, seen: Measured, seconds: float) -> tuple[Setup, Estimate, Array, Array]:
        """All rows so far as one set-up with one estimate, which of them were used, and why not the others."""
        given, problem, tracking = self.given, self._posed(seen), seen.tracking
        n, m, J = problem.model.n, problem.model.width, len(tracking.values)
        records = [self._records.get(int(row[row >= 0][0])) if (row >= 0).any() else None for row in seen.rows]
        reasons = np.array([r.reason if r is not None and r.reason != OPENED else "" for r in records], dtype=object)
        keep = reasons == ""
        states = self._orbit(problem, tracking.times)
        mean, P = states.copy(), np.broadcast_to(self.session.covariance, (len(states), n, n)).copy()
        nu, S = np.full((J, m), np.nan), np.full((J, m, m), np.nan)
        epochs = np.searchsorted(tracking.times, tracking.row_times)
        for j, record in enumerate(records):
            if record is None:
                continue
            w = len(record.nu)
            nu[j, : min(w, m)], S[j, : min(w, m), : min(w, m)] = record.nu[:m], record.S[:m, :m]
            if record.mean is not None and record.covariance is not None:
                mean[epochs[j]], P[epochs[j]] = record.mean, record.covariance
        gate = np.array([r is not None and r.reason == BEYOND for r in records])
        details = {"rejected": gate, "rejected_count": int(gate.sum())}
        estimate = Estimate(
            problem, kept(tracking, keep), mean, P, nu, S, len(mean), seconds, "realtime", None, details, self.session.message
        )
        found = replace(
            given, measured=seen, problem=problem, tracking=tracking, rows=seen.rows, states=states, solution=len(mean) - 1
        )
        return at_last_used(found, keep), estimate, keep, reasons

    def _orbit(self, problem: Problem, times: Array) -> Array:
        """States (K, n) of one orbit without process noise that is the newest belief at its time."""
        last, step = float(self.session.time), self.given.chosen.max_step
        count = max(int(np.ceil(abs(last - float(times[0])) / step)), 1) + 1
        back = np.linspace(last, float(times[0]), count) if last > float(times[0]) else np.array([last])
        first = follow(problem, back, self.session.mean, step)[0][-1]
        return follow(problem, times, first, step)[0]


def _key(seen: Measured, station: Any) -> tuple[Any, ...]:
    """What makes two stations of problems the same: who and where it is, with which sensor, noise and numbers."""
    numbers = tuple(sorted((name, repr(value)) for name, value in station.numbers.items()))
    return seen.labels[station.name], station.sensor, np.asarray(station.noise).tobytes(), numbers


def _wider(saved: Mapping[str, Array], before: int, now: int, n: int) -> dict[str, Array]:
    """A checkpoint of measurements of up to `before` components as one of up to `now`: the others are missing."""
    if now == before:
        return dict(saved)
    out = dict(saved)
    more = now - before
    for name in ("z", "epoch_values"):
        if name in out:
            out[name] = np.pad(out[name], ((0, 0), (0, more)), constant_values=np.nan)
    if "innovation" in out:
        out["innovation"] = np.pad(out["innovation"], (0, more), constant_values=np.nan)
        out["innovation_covariance"] = np.pad(out["innovation_covariance"], ((0, more), (0, more)), constant_values=np.nan)
    if "nu_lin" in out:
        rows = np.pad(out["nu_lin"].reshape(-1, before), ((0, 0), (0, more)), constant_values=np.nan)
        H = np.pad(out["H_lin"].reshape(-1, before, n), ((0, 0), (0, more), (0, 0)))
        out["nu_lin"], out["H_lin"] = rows.reshape(-1), H.reshape(-1, n)
    return out
