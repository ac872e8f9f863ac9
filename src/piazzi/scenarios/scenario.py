"""What a scenario file says besides its problem: when it is measured, what pictures show, what a study does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import floor
from typing import Any

import numpy as np

from piazzi.problem import Problem
from piazzi.problem.checks import Array, check_span
from piazzi.scenarios.table import Table, number
from piazzi.text import shown
from piazzi.units import Units

MAX_EPOCHS = 10**7
ANSWERS = ("range", "angles", "tag", "corrections", "interval_reference", "repair", "debias")  # of files, as text


@dataclass(frozen=True)
class Picture:
    """What pictures of a scenario show besides states: radius of the planet at the origin, m, or None for no planet."""

    planet_radius: float | None = None


@dataclass(frozen=True)
class Plan:
    """What a study of a scenario does unless told otherwise.

    Attributes
    ----------
    runs : int, or None
    estimators : as the command line writes them
    vary : what is varied, and the values it takes, as text
    """

    runs: int | None = None
    estimators: tuple[str, ...] = ()
    vary: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Recording:
    """How recordings are to be read.

    Attributes
    ----------
    columns : names of columns of CSV by ours
    scale : the time scale of dates in CSV that name none
    chosen : the object, in files of tracking of several
    sigma : standard deviations that such files do not say, as ``range.BER=10m``
    stations : files of stations for them
    participants : other satellites that took part, as ``NAME=FILE`` or files of their orbits
    frame : axes of fixes that do not say theirs
    answers : whatever else such files leave open, by the names that `read_tracking` takes
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    scale: str | None = None
    chosen: str | None = None
    sigma: tuple[str, ...] = ()
    stations: tuple[str, ...] = ()
    frame: str | None = None
    participants: tuple[str, ...] = ()
    answers: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Scenario:
    """A problem with the times at which it is measured.

    Attributes
    ----------
    name, title : str
    problem : Problem, with its `truth` half
    times : (K,) seconds, increasing
    picture : Picture
    study : Plan
    recording : Recording
    """

    name: str
    title: str
    problem: Problem
    times: Array
    picture: Picture = field(default_factory=Picture)
    study: Plan = field(default_factory=Plan)
    recording: Recording = field(default_factory=Recording)


def read_recording(table: Table) -> Recording:
    """The section [recording]: names of columns, and the scale of dates."""
    inner = table.table("columns")
    columns = {ours: theirs for ours in inner.data if (theirs := inner.text(ours))}
    scale, chosen, frame = table.text("scale"), table.text("object"), table.text("frame")
    sigma, stations = table.texts("sigma"), table.texts("stations")
    participants = table.texts("participant")
    answers: dict[str, Any] = {name: table.text(name) for name in ANSWERS}
    answers |= {"interval": table.number("interval", positive=True), "time": table.texts("time")}
    answers["range_unit"] = table.texts("range_unit")
    table.finish()
    return Recording(columns, scale, chosen, sigma, stations, frame, participants, {k: v for k, v in answers.items() if v})


def read_plan(table: Table) -> Plan:
    """The section [study]: runs, estimators, and what is varied."""
    runs, estimators = table.whole("runs"), table.texts("estimators")
    inner = table.table("vary")
    vary = {name: _values(inner, name) for name in inner.data}
    table.finish()
    return Plan(runs, estimators, {name: values for name, values in vary.items() if values})


def _values(table: Table, key: str) -> tuple[str, ...]:
    """A list of numbers or texts, as text."""
    value = table.raw(key)
    items = value if isinstance(value, list) else [value]
    if not items or any(number(item) is None and not isinstance(item, str) for item in items):
        table.fault(key, f"must be a list of numbers or texts, not {shown(value)}")
        return ()
    return tuple(item if isinstance(item, str) else repr(item) for item in items)


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
