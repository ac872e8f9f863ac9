"""A sliding window fed one measurement at a time, late ones included."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isnan
from typing import Any, ClassVar

import numpy as np

from piazzi import kernels
from piazzi.estimate.live import Clock, checked_measurement
from piazzi.estimate.losses import Loss
from piazzi.estimate.robust_window import loss_numbers, window_fragments
from piazzi.estimate.saved import MOST_STEPS, Saved, check_order, check_steps
from piazzi.estimate.session import Session
from piazzi.estimate.stretch import Stretch
from piazzi.estimate.width import too_wide_message
from piazzi.kernels.bundle import Belief, Chain, Innovations, Run, Window
from piazzi.kernels.spec import lanes_for
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array
from piazzi.problem.inputs import measured_by
from piazzi.problem.lost_root import has_roots


def window_opens(newest: Any, lag_seconds: float) -> Any:
    """Time from which a state is in a window of so many seconds; one that is on the edge up to rounding is in it."""
    return newest - lag_seconds * (1 + 1e-12) - 4 * np.spacing(np.abs(newest))


class LiveWindow(Session):
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
    success, message : whether the beliefs of the window and before it are finite with semidefinite covariances, and the prior
        not too wide for them beside the noise; else why not
    """

    _shown: ClassVar[tuple[str, ...]] = ("refused", "widest", "_lost")

    saved_names = (
        *("m", "P", "t", "count", "scale", "first_row", "z", "station", "x", "x_before"),
        *("nu_lin", "H_lin", "dx", "mean", "covariance", "oldest_covariance", "innovation", "innovation_covariance", "pending"),
    )

    def __init__(
        self, problem: Problem, lag: int, lag_seconds: float | None, iterations: int, loss: Loss | None = None
    ) -> None:
        self.problem, self.lag, self.lag_seconds, self.iterations = problem, lag, lag_seconds, iterations
        self._loss, self._settings = loss, (lag, lag_seconds, iterations, loss)
        self._has_roots = has_roots(problem.model)
        self._clock = Clock(problem)
        self._stations = {s.name: i for i, s in enumerate(problem.stations)}
        fragments = window_fragments(problem, loss, "window_live", "predict")
        self._library = kernels.load(problem.spec(*fragments, lanes=lanes_for(problem.model.n)))
        n, m = problem.model.n, problem.model.width
        self.mean, self.covariance = problem.mean.copy(), problem.covariance.copy()
        self.refused: list[tuple[float, str]] = []
        self._m, self._P = problem.mean.copy(), problem.covariance.copy()
        self._newest = problem.mean.copy(), problem.covariance.copy()
        self._row, self._pending = np.full(m, np.nan), None
        self.innovation, self.innovation_covariance = np.full(m, np.nan), np.full((m, m), np.nan)
        self.widest = np.zeros(1)  # largest predicted variance of a measurement so far, in units of its noise
        self._window = Stretch(n, m)
        self._span, self._unread = np.zeros(2, dtype=np.int64), np.zeros((2, n, n))
        self._times, self._count, self._carried = np.zeros(3), np.array([1]), (np.zeros(n), np.zeros((n, n)))
        self._bind()

    _pending: float | None

    @property
    def time(self) -> float | None:
        window = self._window
        return float(window.t[window.stop - 1]) if len(window) else self.problem.prior_time

    @property
    def times(self) -> Array:
        return self._window.t[self._window.first : self._window.stop].copy()

    @property
    def means(self) -> Array:
        return self._window.x[self._window.first : self._window.stop].copy()

    @property
    def oldest(self) -> Gaussian:
        if not len(self._window):
            raise ValueError("there is no state in the window yet")
        first = self._window.first
        return Gaussian(self._window.x[first].copy(), self._oldest_covariance[first].copy())

    # ---- measurements --------------------------------------------------------------------------------------------

    def predict(self, t: float) -> None:
        """Carry the newest state's belief to time `t` for reading; the window itself moves at the next update."""
        now = self.time
        dt = self._clock.interval(t, now)
        self.mean, self.covariance = (a.copy() for a in self._newest)
        self._pending = t
        if now is not None and dt > 0:
            self._predict_belief(now, dt, self.mean, self.covariance)

    def _predict_belief(self, now: float, dt: float, mean: Array, covariance: Array) -> None:
        """Predict a belief in place."""
        self._rebind()
        into, times = self._carried, self._times
        times[0], times[1] = now, dt
        self._count[0], times[2] = self._clock.step(dt)
        into[0][:], into[1][:] = mean, covariance
        self._predict_in_place()
        mean[:], covariance[:] = into

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
        window = self._window
        if not len(window):
            self._begin(t)
        elif t > window.t[window.stop - 1]:
            self._append(t)
        elif t < window.t[window.first]:
            self.refused.append((t, station))
            return False
        elif t == window.t[window.stop - 1]:
            window.x[window.first : window.stop] = window.x_before[window.first : window.stop]
        else:
            self._insert(t)
        k = window.find(t)
        window.add_row(k, self._row, s)
        self._solve_newest(late=k < window.stop - 1)
        if k < window.stop - 1:
            self._record_variance_ratio(k)
        if self._has_roots:
            self._look_for_root(s, t)
        return True

    def _begin(self, t: float) -> None:
        """First epoch: the prior, carried there."""
        dt, window = self._clock.interval(t), self._window
        if dt > 0:
            self._predict_belief(t - dt, dt, self._m, self._P)
        k = window.open_epoch(window.stop, t, 1, 0.0)
        window.x[k] = window.x_before[k] = self._m

    def _append(self, t: float) -> None:
        """A new newest state, predicted; states beyond the lag leave."""
        window = self._window
        dt = self._clock.interval(t, float(window.t[window.stop - 1]))
        self._predict_state(window.open_epoch(window.stop, t, *self._clock.step(dt)))
        oldest = self._oldest_kept()
        if oldest > window.first:
            self._span[:] = window.first, oldest
            self._marginalize()
            window.first = oldest
        window.x_before[oldest : window.stop] = window.x[oldest : window.stop]

    def _oldest_kept(self) -> int:
        """The oldest epoch that is still in the window."""
        window = self._window
        if self.lag_seconds is None:
            return max(window.first, window.stop - self.lag)
        return window.find(window_opens(window.t[window.stop - 1], self.lag_seconds))

    def _insert(self, t: float) -> None:
        """A late epoch between two others: its state is predicted from the one before."""
        window = self._window
        k = window.find(t)
        if window.t[k] == t:
            return
        first, second = self._clock.step(t - float(window.t[k - 1])), self._clock.step(float(window.t[k]) - t)
        k = window.open_epoch(k, t, *first)
        window.count[k + 1], window.scale[k + 1] = second
        self._predict_state(k)
        window.x_before[k] = window.x[k]

    def _predict_state(self, k: int) -> None:
        """The state of epoch `k` from the one before."""
        self._rebind()
        self._span[:] = k - 1, k
        self._predict_once()

    # ---- the window ----------------------------------------------------------------------------------------------

    def _solve_newest(self, late: bool) -> None:
        """Gauss-Newton steps over the window, and what came of them; innovations belong to the newest epoch."""
        self._rebind()
        window = self._window
        self._span[:] = window.first, window.stop - 1
        self._solve()
        self._pending = self.time
        self.mean, self.covariance = window.x[window.stop - 1].copy(), self._newest_covariance.copy()
        self._newest = self.mean.copy(), self.covariance.copy()
        last = int(window.first_row[window.stop]) - 1
        self.innovation, self.innovation_covariance = self._nu[last].copy(), self._S[last].copy()
        if late:
            self.innovation.fill(np.nan)
            self.innovation_covariance.fill(np.nan)

    def _record_variance_ratio(self, k: int) -> None:
        """Keep the largest predicted variance, in units of its noise, of rows of an older epoch: they have no innovations."""
        window, (nu, H, _) = self._window, self._linear
        first = window.first_row[window.first]
        rows = slice(window.first_row[k] - first, window.first_row[k + 1] - first)
        seen = H[rows][~np.isnan(nu[rows])]
        self.widest[0] = np.max(np.sum(seen @ self._P_pred[k - window.first] * seen, axis=1), initial=self.widest[0])

    def _rebind(self) -> None:
        if self._window.room != self._room or self._given is not self.problem.given_bundle:
            before = self._linear
            self._bind()
            for new, old in zip(self._linear, before, strict=True):  # the last linearisation is used as states leave
                new[: len(old)] = old

    def _bind(self) -> None:
        """Work space for all that the window's buffers hold, and the kernels on both."""
        p, w, n, m = self.problem, self._window, self.problem.model.n, self.problem.model.width
        self._room = E, R = w.room
        noisy = E if p.noise_varies else 1
        self._linear = nu, H, dx = np.zeros((R, m)), np.zeros((R, m, n)), np.zeros((E, n))
        self._nu, self._S, self._P_pred = np.zeros((R, m)), np.zeros((R, m, m)), np.zeros((E, n, n))
        self._oldest_covariance, self._newest_covariance = np.zeros((E, n, n)), np.zeros((n, n))
        run = Run(
            epochs=E,
            t_prior=0.0,
            t=w.t,
            count=w.count,
            scale=w.scale,
            first_row=w.first_row,
            Q=p.process_noise.covariance,
        )
        window = Window(
            iterations=self.iterations,
            m=self._m,
            P=self._P,
            delayed=self._oldest_covariance,
            newest=self._newest_covariance,
        )
        chain = Chain(
            x=w.x,
            f=np.zeros((E, n)),
            Phi=np.zeros((E, n, n)),
            Q_all=np.zeros((noisy, n, n)),
            nu=nu,
            H=H,
            d_pred=np.zeros((E, n)),
            P_pred=self._P_pred,
            gains=np.zeros((R * m + n, n + 1)),
            multiplier=np.zeros((E, n)),
            dx=dx,
            scaling=np.zeros((n, n)),
            loss=loss_numbers(p, self._loss),
            weights=np.ones(R),
        )
        self._given = p.given_bundle
        library, span, given = self._library, self._span, self._given
        carried = Belief(mean=self._carried[0], covariance=self._carried[1])
        self._predict_in_place: Callable[[], None] = library.predict_once.bind(
            self._times, self._count, given, p.process_noise.covariance, carried, *self._unread
        )
        innovations = Innovations(nu=self._nu, S=self._S)
        measured = measured_by(p, w.z, w.station)
        self._predict_once: Callable[[], None] = library.live_append.bind(span, run, given, chain)
        self._marginalize: Callable[[], None] = library.live_marginalize.bind(span, window, run, given, chain)
        self._solve: Callable[[], None] = library.live_solve.bind(
            span, window, run, given, measured, chain, innovations, self.widest
        )

    # ---- checkpoints ---------------------------------------------------------------------------------------------

    @property
    def _belief_time(self) -> float | None:
        return self.time if self._pending is None else self._pending

    def _foretold(self, t: float) -> Array:
        states: Array = self._window.x_before
        return np.asarray(states[self._window.find(t)])

    def _beliefs(self) -> list[tuple[Array, Array]]:
        window, found = self._window, [(self.mean, self.covariance), self._newest, (self._m, self._P)]
        if len(window):
            found += [(window.x[window.first], self._oldest_covariance[window.first])]
        return found + [(x, self.covariance) for x in window.x[window.first : window.stop]]

    def _why_unusable(self) -> str:
        return too_wide_message(self.widest)

    def _saved_state(self) -> dict[str, Array]:
        window, out = self._window, {"m": self._m.copy(), "P": self._P.copy(), **self._window.copied()}
        W, J, m = len(window), window.rows, self.problem.model.width
        if W:
            nu, H, dx = self._linear
            H = np.where(np.isnan(nu[:J])[:, :, None], 0.0, H[:J])  # what is missing has none
            out |= {"nu_lin": nu[:J].flatten(), "H_lin": H.reshape(J * m, -1), "dx": dx[:W].copy()}
            out["oldest_covariance"] = self._oldest_covariance[window.first].copy()
        mean, covariance = self._newest
        return out | {
            "mean": mean.copy(),
            "covariance": covariance.copy(),
            "pending": np.array([np.nan if self._pending is None else self._pending]),
            "innovation": self.innovation.copy(),
            "innovation_covariance": self.innovation_covariance.copy(),
            "refused": np.array([len(self.refused)], dtype=float),
        }

    def _checked(self, saved: Mapping[str, Array]) -> dict[str, Array]:
        n, m = self.problem.model.n, self.problem.model.width
        unknown = np.full(m, np.nan), np.full((m, m), np.nan), np.array([np.nan])  # checkpoints of earlier versions
        saved = {**dict(zip(("innovation", "innovation_covariance", "pending"), unknown, strict=True)), **saved}
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
            "mean": checked.mean("mean"),
            "covariance": checked.covariance("covariance"),
            "innovation": checked.array("innovation", m, missing=True),
            "innovation_covariance": checked.array("innovation_covariance", m, m, missing=True),
            "pending": checked.array("pending", 1, missing=True),
        }
        check_order(found["t"], found["first_row"], J)
        check_steps(found["t"], found["count"], found["scale"], self._clock.step)
        newest, (pending,) = float(found["t"][-1]) if W else self.problem.prior_time, found["pending"].tolist()
        if newest is not None and pending < newest:
            raise ValueError(f"the checkpoint's 'pending' is {pending:g} s; the newest epoch is at {newest:g} s")
        if W:
            shapes = {"nu_lin": (J * m,), "H_lin": (J * m, n), "dx": (W, n)}
            found |= {name: checked.array(name, *shape, missing=name == "nu_lin") for name, shape in shapes.items()}
            found["oldest_covariance"] = checked.covariance("oldest_covariance")
        return found

    def _set_state(self, kept: Mapping[str, Array]) -> None:
        self._m, self._P = kept["m"].copy(), kept["P"].copy()
        self._window = Stretch.of(self.problem.model.n, self.problem.model.width, kept)
        self.mean, self.covariance = kept["mean"], kept["covariance"]
        self._newest = self.mean.copy(), self.covariance.copy()
        self.innovation, self.innovation_covariance = kept["innovation"], kept["innovation_covariance"]
        self.widest.fill(0.0)  # there are no checkpoints of what is too wide
        self._bind()
        if len(self._window):
            for values, name in zip(self._linear, ("nu_lin", "H_lin", "dx"), strict=True):
                values.reshape(-1)[: kept[name].size] = kept[name].reshape(-1)
            self._oldest_covariance[0] = kept["oldest_covariance"]
        self._pending = None
        if not isnan(kept["pending"][0]):
            self.predict(float(kept["pending"][0]))
