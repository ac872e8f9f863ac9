"""Sliding windows of several lengths, and the full graph on ever longer parts of a tracking: run and timed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from piazzi.estimate.factor_graph import FactorGraph
from piazzi.estimate.sliding_window import SlidingWindow
from piazzi.evaluate.bounds import Bounds
from piazzi.evaluate.comparison import bounds_of, failed
from piazzi.evaluate.rows import Row, evaluate
from piazzi.evaluate.window_trade import Timing, WindowTrade
from piazzi.problem import Problem, Tracking
from piazzi.problem.inputs import prepare

LAGS = (1, 2, 5, 10, 20, 50, 100, 200)
_SIZES = 12  # lengths of run on which the full graph is timed
_SHORTEST = 10
_REPEATS, _LONG = 3, 0.2  # the best of so many timings, of those that take less than so many seconds


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
