"""How long a window has to be: accuracy, consistency and cost against its length; and what the full graph costs."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.estimate import FactorGraph, SlidingWindow
from piazzi.evaluate.bounds import Bounds
from piazzi.evaluate.comparison import bounds_of, failed
from piazzi.evaluate.grids import as_text
from piazzi.evaluate.quantities import ends, finite
from piazzi.evaluate.rows import Row, evaluate
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

if TYPE_CHECKING:
    import xarray
    from rich.console import Console, ConsoleOptions, RenderResult

SCHEMA = "piazzi.windows/1"
LAGS = (1, 2, 5, 10, 20, 50, 100, 200)
VIEWS = ("realtime", "delayed")
_SIZES = 12  # lengths of run on which the full graph is timed
_SHORTEST = 10
_REPEATS, _LONG = 3, 0.2  # the best of so many timings, of those that take less than so many seconds


@dataclass(frozen=True, eq=False)
class Timing:
    """Seconds of the full graph, warm, on the first so many epochs of the tracking.

    Attributes
    ----------
    epochs : (E,) int
    seconds : (E,), the whole estimation, its start by a filter included; NaN where it did not succeed
    iterations : (E,) int, Gauss-Newton steps
    """

    epochs: Array
    seconds: Array
    iterations: Array

    def to_dict(self) -> dict[str, Any]:
        """The timing as JSON keeps it."""
        seconds = [finite(s) for s in self.seconds.tolist()]
        return {"epochs": self.epochs.tolist(), "seconds": seconds, "iterations": self.iterations.tolist()}


@dataclass(frozen=True, eq=False)
class WindowTrade:
    """Sliding windows of several lengths on the same measurements, beside the full graph.

    Attributes
    ----------
    problem, tracking, source : what was estimated
    lags : (L,) int, states in each window
    iterations : Gauss-Newton steps of a window at each epoch
    realtime, delayed : tuples of L Row, the newest state as known at once, and each state as it left the window
    graph : Row of the full graph, the end that windows tend to; None where it was not wanted
    timing : Timing of the full graph; None where it was not wanted
    """

    problem: Problem
    tracking: Tracking
    source: str
    lags: Array
    iterations: int
    realtime: tuple[Row, ...]
    delayed: tuple[Row, ...]
    graph: Row | None = None
    timing: Timing | None = None

    @property
    def success(self) -> bool:
        """Whether every window, and the graph, succeeded."""
        rows = (*self.realtime, *self.delayed, *([self.graph] if self.graph else []))
        return all(row.success for row in rows)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of states that have errors; none without truth."""
        return tuple(dict.fromkeys(g for row in self.realtime for g, v in row.rmse.items() if v is not None))

    @property
    def microseconds_per_step(self) -> Array:
        """Wall-clock microseconds per epoch, (L,), NaN where a window failed."""
        seconds = np.array([np.nan if row.seconds is None else row.seconds for row in self.realtime])
        return np.asarray(1e6 * seconds / len(self.tracking.times))

    def rows(self, view: str) -> tuple[Row, ...]:
        """The windows' rows of one view, "realtime" or "delayed"."""
        return self.realtime if view == "realtime" else self.delayed

    def rmse(self, group: str, view: str = "realtime", *, last_half: bool = True) -> Array:
        """RMSE of a group of states against window length, (L,), SI units, NaN where it is not known."""
        rows = [(row.rmse_last_half if last_half else row.rmse).get(group) for row in self.rows(view)]
        return np.array([np.nan if v is None else v for v in rows])

    def mean_nees(self, view: str = "realtime", *, last_half: bool = True) -> Array:
        """Mean NEES against window length, (L,), NaN where it is not known; see `ideal_nees`."""
        rows = [row.mean_nees_last_half if last_half else row.mean_nees for row in self.rows(view)]
        return np.array([np.nan if v is None else v for v in rows])

    def ideal_nees(self, *views: str) -> tuple[float, ...]:
        """What mean NEES of the last half should be in these views, the smallest and the largest: one where they agree."""
        return ends(row.nees_ideal_last_half for view in views for row in self.rows(view))

    def crlb(self, group: str, view: str = "realtime", *, last_half: bool = True) -> float | None:
        """Posterior Cramer-Rao bound of the RMSE of a group, the same for all lengths; None where it is not known."""
        row = next((r for r in self.rows(view) if r.crlb), None)
        return None if row is None else (row.crlb_last_half if last_half else row.crlb).get(group)

    def to_dict(self) -> dict[str, Any]:
        """The object of schema piazzi.windows/1."""
        return {
            "schema": SCHEMA,
            "source": self.source,
            "epochs": len(self.tracking.times),
            "prior_time": self.problem.prior_start(self.tracking.times),
            "states": list(self.problem.model.names),
            "iterations": self.iterations,
            "lags": self.lags.tolist(),
            "rows": self.records(),
            "graph": None if self.graph is None else self.graph.to_dict(),
            "timing": None if self.timing is None else self.timing.to_dict(),
        }

    def records(self) -> list[dict[str, Any]]:
        """One flat record for every lag and view, as in piazzi.compare/1 with the lag and the microseconds per step."""
        cost = self.microseconds_per_step
        return [
            {"lag": int(lag), **row.to_dict(), "microseconds_per_step": finite(float(us))}
            for lag, us, *pair in zip(self.lags, cost, self.realtime, self.delayed, strict=True)
            for row in pair
        ]

    def to_json(self, indent: int | None = None) -> str:
        """The object of schema piazzi.windows/1 as strict JSON."""
        return json.dumps(self.to_dict(), allow_nan=False, indent=indent)

    def to_dataset(self) -> xarray.Dataset:
        """Errors, consistency and cost against lag and view, with units."""
        from piazzi.evaluate.dataset import windows_to_dataset

        return windows_to_dataset(self)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from piazzi.evaluate.window_trade_display import render

        return render(self, console, options)

    def _repr_html_(self) -> str:
        from piazzi.evaluate.window_trade_display import html

        return html(self)

    def __str__(self) -> str:
        return as_text(self)


def windows(
    problem: Problem,
    tracking: Tracking,
    lags: Sequence[int] = LAGS,
    *,
    iterations: int = 1,
    graph: bool = True,
    source: str = "",
    announce: Callable[[str], None] | None = None,
) -> WindowTrade:
    """Run a sliding window of each length, and the full graph on ever longer parts of the tracking.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    lags : numbers of states; each is tried once, in rising order
    iterations : Gauss-Newton steps of a window at each epoch
    graph : whether to run and time the full graph too
    source : where the measurements came from, for the record
    announce : called with what is about to run

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem, or for a lag that is not a whole number of 1 or more.
    """
    prepare(problem, tracking)
    if not len(lags):
        raise ValueError("there are no window lengths to try")
    sizes = {lag: SlidingWindow(lag, iterations) for lag in sorted(set(lags))}
    say = announce or (lambda _: None)
    bounds = bounds_of(problem, tracking)
    pairs = []
    for lag, window in sizes.items():
        say(f"window:{lag}")
        pairs.append(_window(window, problem, tracking, bounds))
    row, timing = None, None
    if graph:
        say("graph")
        row = _graph(problem, tracking, bounds)
        timing = graph_timing(problem, tracking, say)
        row = replace(row, seconds=float(timing.seconds[-1]) if row.success else row.seconds)
    realtime, delayed = (tuple(pair[i] for pair in pairs) for i in range(2))
    return WindowTrade(problem, tracking, source, np.array(list(sizes)), iterations, realtime, delayed, row, timing)


def steps_of(lags: Sequence[int], tracking: Tracking, *, graph: bool = True) -> int:
    """How often `windows` announces something."""
    return len(set(lags)) + (1 + len(timed_sizes(len(tracking.times))) if graph else 0)


def _window(window: SlidingWindow, problem: Problem, tracking: Tracking, bounds: Bounds | None) -> tuple[Row, Row]:
    """Real-time and delayed row of one window; one that raises has rows that say why."""
    name = f"window:{window.lag}" + (f"x{window.iterations}" if window.iterations > 1 else "")
    try:
        estimate = window.estimate(problem, tracking)
        assert estimate.delayed is not None
        rows = [evaluate(name, e, bounds) for e in (estimate, estimate.delayed)]
        best = estimate.seconds
        for _ in range(_REPEATS - 1 if best < _LONG else 0):
            best = min(best, window.estimate(problem, tracking).seconds)
    except Exception as error:
        rows, best = failed(name, window, error), None
    realtime, delayed = (replace(row, seconds=best) for row in rows)
    return realtime, delayed


def _graph(problem: Problem, tracking: Tracking, bounds: Bounds | None) -> Row:
    try:
        return evaluate("graph", FactorGraph().estimate(problem, tracking), bounds)
    except Exception as error:
        return failed("graph", FactorGraph(), error)[0]


def timed_sizes(K: int) -> list[int]:
    """Numbers of epochs to time the graph on, from a few to all, evenly on a logarithmic scale."""
    if K <= _SHORTEST:
        return [K]
    return sorted({round(k) for k in np.geomspace(_SHORTEST, K, _SIZES).tolist()})


def graph_timing(problem: Problem, tracking: Tracking, announce: Callable[[str], None] = lambda _: None) -> Timing:
    """Seconds of the full graph on the first 10 ... K epochs: the best of three runs where they are short."""
    sizes = timed_sizes(len(tracking.times))
    seconds, steps = [], []
    for size in sizes:
        announce(f"graph of {size} epochs")
        best, count = _timed(problem, head(tracking, size))
        seconds.append(best)
        steps.append(count)
    return Timing(np.array(sizes), np.array(seconds), np.array(steps))


def _timed(problem: Problem, tracking: Tracking) -> tuple[float, int]:
    best, count = np.inf, 0
    for _ in range(_REPEATS):
        try:
            estimate = FactorGraph().estimate(problem, tracking)
        except ValueError:
            return np.nan, 0
        if not estimate.success:
            return np.nan, int(estimate.iterations)
        best, count = min(best, estimate.seconds), int(estimate.iterations)
        if estimate.seconds > _LONG:
            break
    return best, count


def head(tracking: Tracking, epochs: int) -> Tracking:
    """The first so many epochs of a tracking."""
    rows = int(tracking.first_row[epochs])
    stations = None if tracking.row_stations is None else tracking.row_stations[:rows]
    truth = None if tracking.truth is None else tracking.truth[:epochs]
    return Tracking(tracking.row_times[:rows], tracking.values[:rows], stations, truth, tracking.epoch)
