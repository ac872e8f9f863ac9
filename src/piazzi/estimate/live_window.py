"""A sliding window fed one measurement at a time, late ones included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.estimate.live import Clock, checked_measurement
from piazzi.estimate.losses import Loss
from piazzi.estimate.robust_window import row_space, window_fragments
from piazzi.estimate.saved import MOST_STEPS, Saved, check_order, check_steps
from piazzi.kernels.spec import lanes_for
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array


def window_opens(newest: Any, lag_seconds: float) -> Any:
    """Time from which a state is in a window of so many seconds; one that is on the edge up to rounding is in it."""
    return newest - lag_seconds * (1 + 1e-12) - 4 * np.spacing(np.abs(newest))


class LiveWindow:
    """A sliding window in progress, from ``SlidingWindow(...).start(problem)``.

    ``update(station, z, t)`` takes a measurement: of a new time, of the newest epoch, or late but inside the window, where it
    is taken in its place.  One that is older than the window is refused: `update` returns False and `refused` keeps its time
    and station.  In order, the numbers are those of ``estimate`` on the whole run.

    Attributes
    ----------
    time : float or None, the newest epoch, s
    mean, covariance : (n,), (n, n), the newest state as known now; after `predict`, carried to its time
    times, means : (W,), (W, n), the states in the window
    oldest : Gaussian, the first of them given all that the window knows: the delayed estimate, with its covariance
    refused : list of (time, station)
    innovation, innovation_covariance : (m,), (m, m)
        Of the last row taken in; NaN before the first, and after one that came late, of which the window keeps none.
    """

    saved_names = (
        *("m", "P", "t", "count", "scale", "first_row", "z", "station", "x", "x_before"),
        *("nu_lin", "H_lin", "dx", "mean", "covariance", "oldest_covariance", "innovation", "innovation_covariance"),
    )

    def __init__(
        self, problem: Problem, lag: int, lag_seconds: float | None, iterations: int, loss: Loss | None = None
    ) -> None:
        self.problem, self.lag, self.lag_seconds, self.iterations = problem, lag, lag_seconds, iterations
        self._loss = loss
        self._clock = Clock(problem)
        self._stations = {s.name: i for i, s in enumerate(problem.stations)}
        fragments = window_fragments(problem, loss, "window_live", "predict")
        self._library = kernels.load(problem.spec(*fragments, lanes=lanes_for(problem.model.n)))
        n, m = problem.model.n, problem.model.width
        self.mean, self.covariance = problem.mean.copy(), problem.covariance.copy()
        self.refused: list[tuple[float, str]] = []
        self._m, self._P = problem.mean.copy(), problem.covariance.copy()
        self._newest = problem.mean.copy(), problem.covariance.copy()
        self._row = np.full(m, np.nan)
        self.innovation, self.innovation_covariance = np.full(m, np.nan), np.full((m, m), np.nan)
        self._t, self._count, self._scale = np.empty(0), np.empty(0, dtype=np.int64), np.empty(0)
        self._first_row, self._z, self._station = np.zeros(1, dtype=np.int64), np.empty((0, m)), np.empty(0, dtype=np.int64)
        self._x, self._x_before, self._late_covariance = np.empty((0, n)), np.empty((0, n)), np.empty((0, n, n))
        self._space: tuple[Array, ...] = ()
        self._capacity = (0, 0)

    @property
    def time(self) -> float | None:
        return float(self._t[-1]) if len(self._t) else self.problem.prior_time

    @property
    def times(self) -> Array:
        return self._t.copy()

    @property
    def means(self) -> Array:
        return self._x.copy()

    @property
    def oldest(self) -> Gaussian:
        if not len(self._t):
            raise ValueError("there is no state in the window yet")
        return Gaussian(self._x[0].copy(), self._late_covariance[0].copy())

    # ---- measurements --------------------------------------------------------------------------------------------

    def predict(self, t: float) -> None:
        """Carry the newest state's belief to time `t` for reading; the window itself moves at the next update."""
        now = self.time
        dt = 0.0 if now is None else t - now
        if not dt >= 0:
            raise ValueError(f"time {t:g} s is before {now:g} s, where the estimate stands")
        self.mean, self.covariance = (a.copy() for a in self._newest)
        self._pending = t
        if dt > 0:
            count, scale = self._clock.step(dt)
            p, n = self.problem, self.problem.model.n
            self._library.predict_once(
                now,
                dt,
                count,
                scale,
                p.given,
                p.process_noise.covariance,
                self.mean,
                self.covariance,
                np.empty((n, n)),
                np.empty((n, n)),
            )

    def update(self, station: str, z: Any, t: float | None = None) -> bool:
        """Take in a measurement, at `t` or where the last prediction stands; whether it was inside the window.

        Raises
        ------
        ValueError
            For an unknown station, a wrong number of components, an infinite value, or a time that is not finite.
        """
        s = checked_measurement(self.problem, self._stations, station, z, self._row)
        t = self._pending if t is None else t
        if t is None or not np.isfinite(t):
            raise ValueError(f"time is {t}; it must be finite: give update a time, or call predict first")
        if not len(self._t):
            self._begin(t)
        elif t > self._t[-1]:
            self._append(t)
        elif t < self._t[0]:
            self.refused.append((t, station))
            return False
        elif t == self._t[-1]:
            self._x[:] = self._x_before
        else:
            self._insert(t)
        self._add_row(int(np.searchsorted(self._t, t)), s)
        nu, S = self._settle()
        late = t < self._t[-1]  # the innovations that there are belong to the newest epoch
        self.innovation = np.full_like(nu[-1], np.nan) if late else nu[-1].copy()
        self.innovation_covariance = np.full_like(S[-1], np.nan) if late else S[-1].copy()
        return True

    _pending: float | None = None

    def _begin(self, t: float) -> None:
        """First epoch: the prior, carried there."""
        dt = self._clock.interval(t)
        if dt > 0:
            n, p, (count, scale) = self.problem.model.n, self.problem, self._clock.step(dt)
            self._library.predict_once(
                t - dt,
                dt,
                count,
                scale,
                p.given,
                p.process_noise.covariance,
                self._m,
                self._P,
                np.empty((n, n)),
                np.empty((n, n)),
            )
        self._t, self._count, self._scale = np.array([t]), np.ones(1, dtype=np.int64), np.zeros(1)
        self._first_row = np.zeros(2, dtype=np.int64)
        self._x = self._m[None].copy()
        self._x_before, self._late_covariance = self._x.copy(), self._P[None].copy()

    def _append(self, t: float) -> None:
        """A new newest state, predicted; states beyond the lag leave."""
        count, scale = self._clock.step(t - float(self._t[-1]))
        self._t = np.append(self._t, t)
        self._count, self._scale = np.append(self._count, count), np.append(self._scale, scale)
        self._first_row = np.append(self._first_row, self._first_row[-1])
        self._x = np.vstack([self._x, np.empty((1, self._x.shape[1]))])
        self._library.live_append(len(self._t) - 1, self._t, self._count, self.problem.given, self._x)
        leaving = self._leaving()
        for a in range(leaving):
            p = self.problem
            self._library.live_retire(
                a,
                0,
                self._t,
                self._count,
                self._scale,
                self._first_row,
                p.given,
                p.process_noise.covariance,
                self._x,
                self._nu_lin,
                self._H_lin,
                self._dx,
                self._m,
                self._P,
            )
        self._drop(leaving)
        self._x_before = self._x.copy()

    def _leaving(self) -> int:
        if self.lag_seconds is None:
            return max(len(self._t) - self.lag, 0)
        return int(np.searchsorted(self._t, window_opens(self._t[-1], self.lag_seconds)))

    def _drop(self, count: int) -> None:
        rows = int(self._first_row[count])
        self._t, self._count, self._scale, self._x = (
            self._t[count:].copy(),
            self._count[count:],
            self._scale[count:],
            self._x[count:].copy(),
        )
        self._count, self._scale = self._count.copy(), self._scale.copy()
        self._first_row = self._first_row[count:] - rows
        self._z, self._station = self._z[rows:].copy(), self._station[rows:].copy()

    def _insert(self, t: float) -> None:
        """A late epoch between two others: its state is predicted from the one before."""
        if t in self._t:
            return
        k = int(np.searchsorted(self._t, t))
        first, second = self._clock.step(t - float(self._t[k - 1])), self._clock.step(float(self._t[k]) - t)
        self._t = np.insert(self._t, k, t)
        self._count, self._scale = np.insert(self._count, k, first[0]), np.insert(self._scale, k, first[1])
        self._count[k + 1], self._scale[k + 1] = second
        self._first_row = np.insert(self._first_row, k, self._first_row[k])
        self._x = np.insert(self._x, k, 0.0, axis=0)
        self._library.live_append(k, self._t, self._count, self.problem.given, self._x)
        self._x_before = np.insert(self._x_before, k, self._x[k], axis=0)

    def _add_row(self, k: int, s: int) -> None:
        at = int(self._first_row[k + 1])
        self._z = np.insert(self._z, at, self._row, axis=0)
        self._station = np.insert(self._station, at, s)
        self._first_row[k + 1 :] += 1

    # ---- the window ----------------------------------------------------------------------------------------------

    def _settle(self) -> tuple[Array, Array]:
        """Gauss-Newton steps over the window; innovations (J, m) with covariances, those of the newest epoch filled in."""
        p, W, (J, M) = self.problem, len(self._t), self._z.shape
        nu, S = np.empty((J, M)), np.empty((J, M, M))
        space = self._buffers()
        self._x = np.ascontiguousarray(self._x)
        self._library.live_settle(
            0,
            W - 1,
            self.iterations,
            self._t,
            self._count,
            self._scale,
            self._first_row,
            self._z,
            self._station,
            p.station_sensor,
            p.station_numbers,
            p.station_noise,
            p.station_correlated,
            p.given,
            p.process_noise.covariance,
            self._m,
            self._P,
            *space,
            self._x,
            self._late_covariance,
            self.covariance,
            nu,
            S,
            0,
        )
        self.mean = self._x[-1].copy()
        self._newest = self.mean.copy(), self.covariance.copy()
        return nu, S

    def _buffers(self) -> tuple[Array, ...]:
        """Work space of at least the window's size; it keeps the last linearisation for when the oldest state leaves."""
        W, J, n, m = len(self._t), len(self._z), self.problem.model.n, self.problem.model.width
        if self._capacity[0] < W or self._capacity[1] < J:
            big, rows = 2 * W, 2 * J
            self._capacity = (big, rows)
            self._nu_lin, self._H_lin, self._dx = np.empty(rows * m), np.empty((rows * m, n)), np.empty((big, n))
            Q_all = np.empty((big if self.problem.noise_varies else 1, n, n))
            self._space = (
                np.empty((big, n)),
                np.empty((big, n, n)),
                Q_all,
                self._nu_lin,
                self._H_lin,
                np.empty((big, n)),
                np.empty((big, n, n)),
                np.empty((rows * m + n, n + 1)),
                np.empty((big, n)),
                self._dx,
                row_space(self.problem, self._loss, rows),
                np.empty((n, n)),
            )
            self._late_covariance = np.empty((big, n, n))
        return self._space

    def checkpoint(self) -> dict[str, Array]:
        """Everything that the next call depends on, as arrays; `restore` takes it back."""
        out = {name: np.array(getattr(self, "_" + name)) for name in _KEPT}
        W, J, m = len(self._t), len(self._z), self.problem.model.width
        if self._capacity[0]:
            nu = self._nu_lin[: J * m].copy()
            H = np.where(np.isnan(nu)[:, None], 0.0, self._H_lin[: J * m])  # rows of what is missing were never written
            out |= {"nu_lin": nu, "H_lin": H, "dx": self._dx[:W].copy()}
            out["oldest_covariance"] = self._late_covariance[0].copy()
        return out | {
            "mean": self.mean.copy(),
            "covariance": self.covariance.copy(),
            "innovation": self.innovation.copy(),
            "innovation_covariance": self.innovation_covariance.copy(),
            "refused": np.array([len(self.refused)], dtype=float),
        }

    def restore(self, saved: Mapping[str, Array]) -> None:
        """Go on from a checkpoint of the same problem; raises ValueError where it does not fit."""
        n, m = self.problem.model.n, self.problem.model.width
        # checkpoints of earlier versions have none
        saved = {"innovation": np.full(m, np.nan), "innovation_covariance": np.full((m, m), np.nan)} | dict(saved)
        checked = Saved(saved, self.problem)
        W, (z, station) = checked.length("t"), checked.measurements("z", "station")
        J = len(z)
        found = {
            "m": checked.mean("m"),
            "P": checked.covariance("P"),
            "t": checked.array("t", W),
            "count": checked.whole("count", W, 0, MOST_STEPS),
            "scale": checked.array("scale", W),
            "first_row": checked.whole("first_row", W + 1, 0, J),
            "z": z,
            "station": station,
            "x": checked.array("x", W, n),
            "x_before": checked.array("x_before", W, n),
        }
        check_order(found["t"], found["first_row"], J)
        check_steps(found["t"], found["count"], found["scale"], self._clock.step)
        mean, covariance = checked.mean("mean"), checked.covariance("covariance")
        nu = checked.array("innovation", m, missing=True)
        S = checked.array("innovation_covariance", m, m, missing=True)
        if W:
            linear = checked.array("nu_lin", J * m, missing=True), checked.array("H_lin", J * m, n), checked.array("dx", W, n)
            oldest = checked.covariance("oldest_covariance")
        for name in _KEPT:  # from here on, nothing can go wrong
            setattr(self, "_" + name, found[name])
        self.mean, self.covariance = mean, covariance
        self._newest = mean.copy(), covariance.copy()
        self.innovation, self.innovation_covariance = nu, S
        if W:
            self._buffers()
            self._nu_lin[: J * m], self._H_lin[: J * m], self._dx[:W] = linear
            self._late_covariance[0] = oldest


_KEPT = ("m", "P", "t", "count", "scale", "first_row", "z", "station", "x", "x_before")
