"""What every estimator takes and gives."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from piazzi.drawn import Drawn
from piazzi.estimate.soundness import defect
from piazzi.kernels import build_seconds
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array, Locked
from piazzi.problem.epochs import epoch_of
from piazzi.problem.lost_root import lost_root
from piazzi.text import listed

if TYPE_CHECKING:
    import xarray

    from piazzi.earth import Epoch
    from piazzi.estimate.forecast import Forecast

View = Literal["realtime", "delayed"]


class Estimator(Protocol):
    """Frozen settings with one verb.

    A class whose states are not (only) those of real time says so in a class variable, ``views = ("delayed",)``.
    """

    def estimate(self, problem: Problem, tracking: Tracking) -> Estimate:
        """Estimate the state at every epoch of the tracking."""


def views_of(estimator: Any) -> tuple[View, ...]:
    """The views of the states that an estimator gives: what its class says, else real time alone."""
    views: tuple[View, ...] = getattr(type(estimator), "views", ("realtime",))
    return views


class Stopwatch:
    """Wall-clock seconds since it was made, without those in which kernels were compiled or loaded."""

    def __init__(self) -> None:
        self._built, self._started = build_seconds(), time.perf_counter()

    def seconds(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._started - (build_seconds() - self._built)


@dataclass(frozen=True, eq=False, init=False)
class Estimate(Locked, Drawn):
    """Result of an estimator.

    Attributes
    ----------
    problem, tracking : what was estimated
    times : (K,), epochs, s
    mean : (K, n), states and estimated constants
    covariance : (K, n, n)
    innovations : (J, m), z - h at the predicted state, NaN where missing, one row for each row of the tracking
    innovation_covariances : (J, m, m)
    iterations : int
    seconds : wall-clock time of the estimation alone
    view : "realtime" (measurements up to each epoch) or "delayed" (later ones too)
    delayed : a window's states as they left it, else None
    details : figures of the particular estimator, such as "cost" or "solver"
    failure : why the estimator gave up, "" where it finished
    success : whether it finished, with finite means and semidefinite covariances
    message : why not; of a success, what should be known about it, "" if there is nothing (``details["remark"]``)
    """

    problem: Problem
    tracking: Tracking
    mean: Array
    covariance: Array
    innovations: Array
    innovation_covariances: Array
    iterations: int
    seconds: float
    view: View
    delayed: Estimate | None
    details: Mapping[str, Any]
    failure: str

    def __init__(
        self,
        problem: Problem,
        tracking: Tracking,
        mean: Array,
        covariance: Array,
        innovations: Array,
        innovation_covariances: Array,
        iterations: int,
        seconds: float,
        view: View = "realtime",
        delayed: Estimate | None = None,
        details: Mapping[str, Any] | None = None,
        failure: str = "",
    ) -> None:
        self.__dict__.update(  # one after the other, as a frozen dataclass sets them, takes three times as long
            problem=problem,
            tracking=tracking,
            mean=mean,
            covariance=covariance,
            innovations=innovations,
            innovation_covariances=innovation_covariances,
            iterations=iterations,
            seconds=seconds,
            view=view,
            delayed=delayed,
            details={} if details is None else details,
            failure=failure,
        )
        for a in (mean, covariance, innovations, innovation_covariances):
            a.setflags(write=False)

    @property
    def times(self) -> Array:
        return self.tracking.times

    @property
    def epoch(self) -> Epoch | None:
        """The instant that `times` are seconds of TT past, where there is one."""
        return epoch_of(self.problem, self.tracking)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of `mean`."""
        return self.problem.model.names

    @property
    def max_step(self) -> float | None:
        """Longest step of the integrator in seconds, as given or as chosen by its tolerance; None where it says otherwise."""
        return self.problem.max_step(self.times)

    @property
    def success(self) -> bool:
        return not self._why_not

    @property
    def message(self) -> str:
        return self._why_not or str(self.details.get("remark", ""))

    @cached_property
    def _why_not(self) -> str:
        found = self.failure or self._defect()
        root = lost_root(self.problem, self.tracking, self.mean) if found else ""
        return f"{found}: {root}" if root and root not in found else found

    def _defect(self) -> str:
        """The first epoch whose result cannot be used, "" if there is none."""
        found = defect(self.mean, self.covariance, self.names, lambda k: f"from epoch {k} (t = {self.times[k]:g} s)")
        return found or self._unpredicted()

    def _unpredicted(self) -> str:
        """The first measurement that is there but has no prediction, "" if there is none."""
        z = self.tracking.values
        m = min(self.innovations.shape[1], z.shape[1])
        rows = np.flatnonzero((np.isnan(self.innovations[:, :m]) & ~np.isnan(z[:, :m])).any(axis=1))
        if not rows.size:
            return ""
        return f"the measurement of row {rows[0]} (t = {self.tracking.row_times[rows[0]]:g} s) has no prediction"

    def predict(self, times: Any) -> Forecast:
        """The last belief propagated, with the process noise and manoeuvres on the way, and how it grows.

        Parameters
        ----------
        times : (P,) or one, s
            At or after the last epoch, not decreasing.  The way there is cut into equal parts no longer than the tracking's
            median interval, so that steps and process noise are those of the estimation; covariances are carried by the
            transition matrices, and what considered parameters add goes on growing.  Between epochs, an estimate comes from a
            row of missing values (NaN) there.

        Raises
        ------
        ValueError
            For a time before the last epoch, times that decrease or are not finite, or a last belief that is not finite.
        """
        from piazzi.estimate.forecast import checked_times, forecast

        at = checked_times(times, float(self.times[-1]))
        last = self.mean[-1], self.covariance[-1]
        if not (all(np.isfinite(a).all() for a in last) and has_considered(self)):
            raise ValueError(f"nothing can be propagated: {self.message}")
        considered = {name: self.details[f"considered_{name}"][-1] for name in self.problem.considered}
        return forecast(self.problem, self.times, last, considered, at)

    def __repr__(self) -> str:
        """In short: of what, over how many times, and whether it succeeded."""
        named = f" of {self.problem.name!r}" if self.problem.name else ""
        said = f": {self.message}" if self.message else ""
        state = "success" if self.success else "no success"
        return f"<Estimate{named}, {self.view}, {len(self.times)} times, {listed(self.names, 12)}; {state}{said}>"

    def to_dataset(self) -> xarray.Dataset:
        """Times, means, covariances and innovations as a labelled dataset with units."""
        import xarray as xr

        from piazzi.estimate.dataset import DETAIL, estimate_variables, instant, label, plain_details

        arrays = ("mean", "covariance", "innovations", "innovation_covariances")
        own = {name: getattr(self, name) for name in arrays}
        variables, coordinates = estimate_variables(self.problem, self.tracking, own)
        for key, value in self.details.items():
            if isinstance(value, np.ndarray):
                variables[DETAIL + key] = (tuple(f"{key}_{i}" for i in range(value.ndim)), value)
        attributes = {
            "view": self.view, "iterations": int(self.iterations), "seconds": float(self.seconds),
            "success": int(self.success), "message": label(self.message), "details": json.dumps(plain_details(self.details)),
            **instant(self.problem, self.tracking),
        }  # fmt: skip
        return xr.Dataset(variables, coordinates, attributes)


def has_considered(estimate: Estimate) -> bool:
    """Whether the estimate tells what each considered parameter does to it: one that failed does not."""
    return all(f"considered_{name}" in estimate.details for name in estimate.problem.considered)
