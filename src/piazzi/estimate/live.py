"""A filter fed one measurement at a time: the numbers of the whole-run kernel, a few microseconds a call."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.saved import Saved
from piazzi.estimate.session import Session
from piazzi.estimate.width import too_wide_message
from piazzi.kernels.bundle import Belief, Innovations
from piazzi.problem import Problem
from piazzi.problem.checks import Array, check_span
from piazzi.problem.inputs import measured_by, unresolved
from piazzi.problem.lost_root import has_roots
from piazzi.problem.manoeuvres import check_after


class Clock:
    """Where a session stands between epochs: checks that time goes forward, and the length of each step."""

    def __init__(self, problem: Problem) -> None:
        for name in problem.considered:
            raise ValueError(
                f"parameter {name!r} is considered, which needs the whole run: make it fixed or estimated to go measurement by "
                "measurement"
            )
        self.problem = problem
        self.time = problem.prior_time
        if self.time is not None:
            check_after(problem.manoeuvres, self.time)
        self._steps: dict[float, tuple[int, float]] = {}

    def interval(self, t: float, since: float | None = None) -> float:
        """Seconds to `t` from `since`, or else from the last epoch; ValueError where `t` is earlier. Changes nothing."""
        if not np.isfinite(t):
            raise ValueError(f"time is {t}; it must be finite")
        since = self.time if since is None else since
        if since is None:
            check_after(self.problem.manoeuvres, t)
            self.problem.cover(t, t)
            return 0.0
        dt = float(t) - float(since)
        if dt == inf:
            check_span(since, t, "the time")
        if dt < 0:
            raise ValueError(f"time {t:g} s is before {since:g} s, where the estimate stands")
        self.problem.cover(since, t)
        return dt

    def step(self, dt: float) -> tuple[int, float]:
        """Substeps and noise scale of an interval; intervals that recur are remembered."""
        found = self._steps.get(dt)
        if found is None:
            assert self.problem.integrator is not None
            interval = np.array([dt])
            found = int(self.problem.integrator.counts(interval)[0]), float(self.problem.process_noise.scale(interval)[0])
            if len(self._steps) < 1000:
                self._steps[dt] = found
        return found


def checked_measurement(problem: Problem, stations: Mapping[str, int], station: str, z: Any, row: Array) -> int:
    """Write a measurement into `row`, NaN where a component is missing; the station's index.

    Raises
    ------
    ValueError
        For an unknown station, a wrong number of components, or a value that is infinite or rounded by more than its noise.
    """
    s = stations.get(station)
    s = problem.station_index(station) if s is None else s
    values = (z,) if isinstance(z, (int, float)) else tuple(np.asarray(z, dtype=float).reshape(-1))
    if len(values) != len(problem.stations[s].noise):
        raise ValueError(
            f"station {station!r} measured {z!r}; it must be {len(problem.stations[s].noise)} numbers, NaN where missing"
        )
    row.fill(np.nan)
    limits = problem.station_limits[s]
    for i, value in enumerate(values):
        if value in (np.inf, -np.inf):
            raise ValueError(f"station {station!r} measured {z!r}; write NaN for a missing value")
        if abs(value) > limits[i]:
            raise ValueError(unresolved(problem, s, i, float(value)))
        row[i] = value
    return s


def clock_times(clock: Array) -> tuple[float | None, float | None]:
    """The first two numbers of a checkpoint's clock, None for NaN."""
    before, now = (None if np.isnan(v) else float(v) for v in clock[:2])
    return before, now


class LiveFilter(Session):
    """An extended Kalman filter in progress, from ``ExtendedKalmanFilter().start(problem)``.

    ``predict(t)`` moves to a time, ``update(station, z)`` takes a measurement there; several updates at one time are one epoch,
    linearised at the prediction.  The numbers of ``estimate`` on the whole run, bit for bit.

    Attributes
    ----------
    time : float or None
        Seconds; None before the first call of a problem without `prior_time`.
    mean, covariance : (n,), (n, n)
        The current belief: predicted, or updated.  The arrays are reused: copy what you keep.
    innovation, innovation_covariance : (m,), (m, m), of the last update
    success, message : whether the belief is finite with a semidefinite covariance, and the prior not too wide for one beside
        the noise; else why not
    """

    _shown: ClassVar[tuple[str, ...]] = (*Session._shown, "widest")
    saved_names: ClassVar[tuple[str, ...]] = (
        "base_mean",
        "base_covariance",
        "x_pred",
        "P_pred",
        "d",
        "P",
        "times",
        "mean",
        "covariance",
        "clock",
    )

    def __init__(self, problem: Problem, fragments: tuple[str, ...]) -> None:
        self.problem, self._settings = problem, (fragments,)
        self._has_roots = has_roots(problem.model)
        self._clock = Clock(problem)
        self._stations = {s.name: i for i, s in enumerate(problem.stations)}
        n, m = problem.model.n, problem.model.width
        self._base_mean, self._base_covariance = problem.mean.copy(), problem.covariance.copy()
        self.mean, self.covariance = problem.mean.copy(), problem.covariance.copy()
        self._x_pred, self._P_pred = problem.mean.copy(), problem.covariance.copy()
        self._d, self._P = np.zeros(n), problem.covariance.copy()
        self.innovation, self.innovation_covariance = np.full(m, np.nan), np.full((m, m), np.nan)
        self.widest = np.zeros(1)  # largest predicted variance of a measurement so far, in units of its noise
        self._times, self._count, self._which = np.zeros(4), np.array([1]), np.array([0])
        self._times[3] = problem.prior_time or 0.0  # measurements before any prediction are at the time of the prior
        self._row, self._predicted_to, self._measured = np.full((1, m), np.nan), problem.prior_time, False
        self._bind()

    def _bind(self) -> None:
        """The kernels on the arrays of this session."""
        problem, self._given = self.problem, self.problem.given_bundle
        library = kernels.load(problem.spec("transition", problem.noise_fragment, *self._settings[0], "filter_live"))
        base = Belief(mean=self._base_mean, covariance=self._base_covariance)
        self._predicted = Belief(mean=self._x_pred, covariance=self._P_pred)
        correction = Belief(mean=self._d, covariance=self._P)
        self._now = Belief(mean=self.mean, covariance=self.covariance)
        Q, innovations = (
            problem.process_noise.covariance,
            Innovations(nu=self.innovation[None], S=self.innovation_covariance[None]),
        )
        self._predict = library.live_predict.bind(self._times, self._count, self._given, Q, base, self._predicted)
        self._update = library.live_update.bind(
            self._times,
            self._given,
            measured_by(problem, self._row, self._which),
            self._predicted,
            correction,
            self._now,
            innovations,
            self.widest,
        )

    @property
    def time(self) -> float | None:
        return self._predicted_to

    def predict(self, t: float) -> None:
        """Carry the belief to time `t`, from the last epoch that had a measurement; raises ValueError where `t` is earlier."""
        if self._measured and t == self._predicted_to:
            return
        dt = self._clock.interval(t, self._predicted_to if self._measured else None)  # a time that is refused changes nothing
        if self.problem.given_bundle is not self._given:
            self._bind()
        if self._measured:
            self._base_mean[:], self._base_covariance[:] = self.mean, self.covariance
            self._clock.time, self._measured = self._predicted_to, False
        self._times[0], self._times[1], self._times[3] = t if self._clock.time is None else self._clock.time, dt, t
        if dt > 0:
            self._count[0], self._times[2] = self._clock.step(dt)
            self._predict()
        else:
            self._x_pred[:], self._P_pred[:] = self._base_mean, self._base_covariance
        self._predicted_to = t
        self.mean[:] = self._x_pred
        np.add(self._P_pred, self._P_pred.T, out=self.covariance)
        self.covariance *= 0.5
        self._d.fill(0.0)
        self._P[:] = self._P_pred

    def update(self, station: str, z: Any, t: float | None = None) -> None:
        """Take in a measurement of a station, at `t` or where the last prediction stands; NaN where a component is missing.

        Raises
        ------
        ValueError
            For an unknown station, a wrong number of components, an infinite value, or a time that has passed.
        """
        s = checked_measurement(self.problem, self._stations, station, z, self._row[0])
        if t is not None:
            self.predict(t)
        elif self._predicted_to is None:
            raise ValueError(
                "the time of the first measurement is not known: call predict(t) first, or give the problem a prior_time"
            )
        self._which[0] = s
        self._update()
        self._measured = True
        if self._has_roots:
            self._look_for_root(s, float(self._times[3]))

    # ---- what it stands on ---------------------------------------------------------------------------------------

    @property
    def _belief_time(self) -> float | None:
        return self.time

    def _foretold(self, t: float) -> Array:
        return self._x_pred

    def _beliefs(self) -> list[tuple[Array, Array]]:
        predicted = (self._base_mean, self._base_covariance), (self._x_pred, self._P_pred)
        return [(self.mean, self.covariance), *predicted, (self._d, self._P)]

    def _why_unusable(self) -> str:
        return too_wide_message(self.widest)

    def _saved_state(self) -> dict[str, Array]:
        clock = [np.nan if v is None else v for v in (self._clock.time, self._predicted_to)]
        return {name: getattr(self, "_" + name).copy() for name in _KEPT} | {
            "mean": self.mean.copy(),
            "covariance": self.covariance.copy(),
            "clock": np.array([*clock, float(self._measured)]),
        }

    def _checked(self, saved: Mapping[str, Array]) -> dict[str, Array]:
        checked = Saved(saved, self.problem)
        vectors, matrices = ("base_mean", "x_pred", "d", "mean"), ("base_covariance", "P_pred", "P", "covariance")
        found = {name: checked.mean(name) for name in vectors} | {name: checked.covariance(name) for name in matrices}
        return found | {"times": checked.array("times", 4), "clock": checked.clock("clock", 3)}

    def _set_state(self, kept: Mapping[str, Array]) -> None:
        for name in (*_KEPT, "mean", "covariance"):
            getattr(self, name if name in ("mean", "covariance") else "_" + name)[...] = kept[name]
        self._clock.time, self._predicted_to = clock_times(kept["clock"])
        self.widest.fill(0.0)  # there are no checkpoints of what is too wide
        self._measured = bool(kept["clock"][2])


_KEPT = ("base_mean", "base_covariance", "x_pred", "P_pred", "d", "P", "times")
