"""When a scenario is measured."""

from __future__ import annotations

from math import floor

import numpy as np

from piazzi.problem.checks import Array, check_span
from piazzi.scenarios.faults import shown
from piazzi.scenarios.table import Table
from piazzi.units import Units

MAX_EPOCHS = 10**7


def read_times(table: Table, units: Units) -> Array | None:
    """Epochs in seconds, from start, step and count or stop, or from a list."""
    if "list" in table:
        value = table.raw("list")
        if not isinstance(value, list):
            table.fault("list", f"must be a list of times, not {shown(value)}")
            return None
        times = table.vector("list", [f"time {i}" for i in range(len(value))])
        table.finish()
        return None if times is None else _increasing(table, times, units)
    start = table.number("start")
    step = table.number("step", positive=True)
    count, stop = table.whole("count"), table.number("stop")
    table.finish(("list",))
    if "step" not in table or ("count" in table) == ("stop" in table):
        table.fault("", "needs a step and either count or stop, or a list of times")
        return None
    if step is None or (count is None and stop is None):
        return None
    first = start or 0.0
    if count is None and stop is not None:
        if stop < first:
            table.fault("stop", f"is {stop:g}, before the start at {first:g}")
            return None
        # a stop that is a whole number of steps away, up to rounding, is the last epoch
        slack = min(4e-16 * (abs(first) + abs(stop)) / step, 0.5)
        count = floor(min((stop - first) / step * (1 + 1e-12) + slack, 1e300)) + 1
    assert count is not None
    if count > MAX_EPOCHS:
        table.fault("", f"makes {count:g} epochs; at most {MAX_EPOCHS:g} are allowed")
        return None
    with np.errstate(over="ignore"):
        return _increasing(table, first + np.arange(count) * step, units)


def _increasing(table: Table, times: Array, units: Units) -> Array | None:
    """The times in seconds; None, with a fault noted, unless they increase and none is out of the range of numbers."""
    if not times.size:
        table.fault("list", "is empty")
        return None
    with np.errstate(over="ignore"):
        times = times * units.time()
    lost = np.flatnonzero(~np.isfinite(times))
    if lost.size:
        table.fault("", f"time {lost[0]} is {times[lost[0]]:g} s; it must be finite")
        return None
    wrong = np.flatnonzero(~(times[1:] > times[:-1]))
    if wrong.size:
        i = int(wrong[0]) + 1
        table.fault("", f"must increase: time {i} is {times[i]:g} s, after {times[i - 1]:g} s")
        return None
    try:
        check_span(times[0], times[-1], f"time {len(times) - 1}")
    except ValueError as error:
        table.fault("", str(error))
        return None
    times.setflags(write=False)
    return times
