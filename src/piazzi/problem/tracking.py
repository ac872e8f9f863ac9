"""Measurements: one flat, time-sorted table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.drawn import Drawn, later
from piazzi.problem.checks import Array, backwards, check_span, frozen, lock, numeric
from piazzi.problem.epochs import check_near, check_same, epoch_given, shifted
from piazzi.text import listed

if TYPE_CHECKING:
    import os

    import xarray

    from piazzi.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Tracking(Drawn):
    """Rows of measurements in order of time; rows of one time form an epoch.

    Parameters
    ----------
    row_times : (J,), seconds, not decreasing: of TT after `epoch` where there is one
    values : (J, m) or (J,)
        Up to the widest sensor's components; NaN where a value is missing.
    row_stations : (J,) names, optional
        Not needed where the problem has one station.
    truth : (K, n), optional
        True state at each epoch.
    epoch : Epoch, or what one is made of, optional
        The instant of time zero.  Where the problem has one too, they must be the same: see `with_epoch`.

    Attributes
    ----------
    times : (K,), the epochs, strictly increasing
    first_row : (K + 1,), rows of epoch k are first_row[k] to first_row[k + 1]

    Raises
    ------
    ValueError
        For no measurements, times that are not finite or decrease, infinite values, wrong shapes, an epoch that is no date,
        or times that are 1e8 s or more from it.
    """

    row_times: Any
    values: Any
    row_stations: Any = None
    truth: Any = None
    epoch: Any = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "epoch", epoch_given(self.epoch))
        put(self, "row_times", self._checked_times())
        put(self, "values", self._checked_values())
        if self.row_stations is not None:
            names = np.asarray(self.row_stations, dtype=np.str_).reshape(-1)
            if len(names) != len(self.row_times):
                raise ValueError(f"row_stations has {len(names)} names for {len(self.row_times)} rows")
            names.setflags(write=False)
            put(self, "row_stations", names)
        _ = self.times  # made now, with the rows of each epoch, so that no estimator has to
        if self.truth is not None:
            put(self, "truth", self._checked_truth())

    def __repr__(self) -> str:
        """In short: how many rows, when, by whom."""
        names = [] if self.row_stations is None else list(dict.fromkeys(self.row_stations.tolist()))
        by = f" by {listed(names)}" if names else ""
        since = "" if self.epoch is None else f" past {self.epoch}"
        span = f"{self.row_times[0]:g} to {self.row_times[-1]:g} s{since}"
        return f"<Tracking: {len(self.row_times)} rows{by}, {span}{', with truth' if self.truth is not None else ''}>"

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Nothing can be written into a copy either, so that what `prepare` keeps of it stays right."""
        self.__dict__.update(state)
        lock(state)

    def _checked_times(self) -> Array:
        times = numeric(self.row_times, "times").reshape(-1)
        if not times.size:
            raise ValueError("there are no measurements")
        if not np.isfinite(times).all():
            k = int(np.flatnonzero(~np.isfinite(times))[0])
            raise ValueError(f"time of row {k} is {times[k]}; it must be finite")
        down = backwards(times)
        if down is not None:
            raise ValueError(f"times must increase: row {down} is at {times[down]:g} s, after {times[down - 1]:g} s")
        check_span(times[0], times[-1], f"row {len(times) - 1}")
        check_near(times[[0, -1]], self.epoch, "time")
        return frozen(times)

    def _checked_values(self) -> Array:
        values = numeric(self.values, "measurements")
        values = values.reshape(-1, 1) if values.ndim < 2 else values
        if values.ndim != 2 or len(values) != len(self.row_times):
            raise ValueError(f"measurements have shape {np.shape(self.values)} for {len(self.row_times)} times")
        bad = np.argwhere(np.isinf(values))
        if bad.size:
            k, i = bad[0]
            raise ValueError(
                f"measurement of row {k} (t = {self.row_times[k]:g} s), component {i}, is {values[k, i]}; "
                "write NaN for a missing one"
            )
        if np.isnan(values).all():
            raise ValueError("there are no measurements: every value is missing")
        return frozen(values)

    def _checked_truth(self) -> Array:
        truth = numeric(self.truth, "truth")
        if truth.ndim != 2 or len(truth) != len(self.times):
            raise ValueError(f"truth has shape {truth.shape} for {len(self.times)} epochs")
        if np.isinf(truth).any():
            k, i = np.argwhere(np.isinf(truth))[0]
            raise ValueError(f"truth of epoch {k}, state {i}, is {truth[k, i]}; it must be finite")
        return frozen(truth)

    @cached_property
    def first_row(self) -> Array:
        new = np.ones(len(self.row_times) + 1, dtype=bool)  # the end counts as the first row of an epoch after the last
        np.greater(self.row_times[1:], self.row_times[:-1], out=new[1:-1])
        first = np.flatnonzero(new).astype(np.int64, copy=False)
        first.setflags(write=False)
        return first

    @cached_property
    def times(self) -> Array:
        out: Array = self.row_times[self.first_row[:-1]]
        out.setflags(write=False)
        return out

    def stations_of(self, problem: Problem) -> Array:
        """Index into the problem's stations for every row, (J,) int64.

        Raises
        ------
        ValueError
            For an unknown station (with the nearest name), more values than its sensor has components, or an epoch that is
            not the problem's.
        """
        check_same(problem, self)
        if not problem.stations:
            raise ValueError("the problem has no stations, so nothing can be measured")
        if self.row_stations is None:
            if len(problem.stations) > 1:
                names = ", ".join(s.name for s in problem.stations)
                raise ValueError(f"the tracking does not say which station measured; the problem has {names}")
            index = np.zeros(len(self.row_times), dtype=np.int64)
        else:
            unique, inverse = np.unique(np.asarray(self.row_stations), return_inverse=True)
            index = np.array([problem.station_index(str(name)) for name in unique], dtype=np.int64)[inverse]
        self._check_widths(problem, index)
        return index

    def with_epoch(self, epoch: Any) -> Tracking:
        """The same measurements with times past another instant: each later by the exact difference, rounded once.

        Raises
        ------
        ValueError
            Where the tracking has no epoch, `epoch` is no date, or a time would be 1e8 s or more from it.
        """
        target = epoch_given(epoch)
        if self.epoch is None or target is None:
            raise ValueError("the tracking has no epoch to move from; replace(tracking, epoch=...) gives it one")
        if target == self.epoch:
            return self
        times = shifted(self.row_times, self.epoch.since(target))
        return Tracking(times, self.values, self.row_stations, self.truth, target)

    def with_factor(self, problem: Problem, station: str, times: Any = None) -> Tracking:
        """The same tracking with a factor of the user's own: rows in which `station` measures zero.

        The equations of the station's sensor are the residual, its noise is the residual's covariance.  Together with
        ``Model(memory=...)`` a residual may connect two neighbouring states.

        Parameters
        ----------
        problem : Problem
        station : str
        times : epochs at which the factor holds; default all but the first

        Raises
        ------
        ValueError
            For an unknown station, or times that are not epochs.
        """
        own = problem.stations[problem.station_index(station)]
        at = self.times[1:] if times is None else numeric(times, "times").reshape(-1)
        for t in at[~np.isin(at, self.times)]:
            raise ValueError(f"factor {station!r} is wanted at t = {t:g} s, which is not an epoch")
        width = max(self.values.shape[1], len(own.noise))
        zeros = np.full((len(at), width), np.nan)
        zeros[:, : len(own.noise)] = 0.0
        names = self.row_stations
        if names is None:
            others = [s.name for s in problem.stations if s.name != station]
            if len(others) != 1:
                raise ValueError(
                    f"the tracking does not say which station measured; beside {station!r} the problem has {others}"
                )
            names = np.full(len(self.row_times), others[0])
        row_times = np.concatenate([self.row_times, at])
        order = np.argsort(row_times, kind="stable")
        values = np.concatenate([self.padded(width), zeros])[order]
        stations = np.concatenate([names, np.full(len(at), station)])[order]
        return Tracking(row_times[order], values, stations, self.truth, self.epoch)

    def to_dataset(self, problem: Problem) -> xarray.Dataset:
        """Measurements, and the truth where it is known, with the problem's names and units."""
        found: xarray.Dataset = later("estimate.dataset", "tracking_to_dataset")(problem, self)
        return found

    def to_csv(self, path: str | os.PathLike[str], problem: Problem) -> None:
        """Write a table that `load` reads back with its scenario, bit for bit; raises OSError where it cannot be written."""
        later("io.csv", "write_csv")(path, problem, self)

    def _check_widths(self, problem: Problem, index: Array) -> None:
        columns = self.values.shape[1]
        if columns <= problem.narrowest:
            return
        widths = np.array([len(s.noise) for s in problem.stations])
        beyond = np.arange(columns)[None, :] >= widths[index][:, None]
        bad = np.argwhere(beyond & ~np.isnan(self.values))
        if bad.size:
            k = int(bad[0, 0])
            station = problem.stations[index[k]]
            raise ValueError(
                f"row {k} (t = {self.row_times[k]:g} s) has more values than the {widths[index[k]]} components "
                f"of station {station.name!r}"
            )

    def padded(self, width: int) -> Array:
        """Values with exactly `width` columns, NaN where there were fewer."""
        columns = self.values.shape[1]
        if columns == width:
            values: Array = self.values
            return values
        out = np.full((len(self.values), width), np.nan)
        out[:, : min(columns, width)] = self.values[:, :width]
        return out
