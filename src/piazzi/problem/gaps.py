"""When each station measured: rows without a long gap between them are a pass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piazzi.arrays import median
from piazzi.problem.problem import Problem
from piazzi.problem.tracking import Tracking

USUAL = 2.5  # a gap is this many times the usual interval


class Pass(NamedTuple):
    """Measurements of one station from `start` to `stop`, s."""

    station: str
    start: float
    stop: float
    measurements: int


def passes(problem: Problem, tracking: Tracking, gap: float | None = None) -> list[Pass]:
    """The passes of every station, in the order of their beginnings.

    Parameters
    ----------
    problem : Problem
    tracking : Tracking
    gap : seconds, optional
        The longest interval within a pass; default 2.5 times the median interval between measurements of the station.
        With six hours, passes of a night are one.

    Raises
    ------
    ValueError
        Where the tracking does not fit the problem, or the gap is not positive.
    """
    if gap is not None and not gap > 0:
        raise ValueError(f"gap is {gap}; it must be positive")
    index = tracking.stations_of(problem)
    measured = ~np.isnan(tracking.values).all(axis=1)
    out: list[Pass] = []
    for s, station in enumerate(problem.stations):
        t = tracking.row_times[(index == s) & measured]
        if not t.size:
            continue
        steps = np.diff(t)
        usual = USUAL * median(steps[steps > 0]) if (steps > 0).any() else np.inf
        ends = np.flatnonzero(steps > (usual if gap is None else gap))
        first, last = np.append(0, ends + 1), np.append(ends, len(t) - 1)
        out += [Pass(station.name, float(t[a]), float(t[b]), int(b - a + 1)) for a, b in zip(first, last, strict=True)]
    return sorted(out, key=lambda found: (found.start, found.station))


def in_passes(problem: Problem, tracking: Tracking) -> list[Pass]:
    """The passes where there are some to tell apart: any station has more than one; else none."""
    found = passes(problem, tracking) if problem.stations else []
    return found if len(found) > len({one.station for one in found}) else []


def is_restricted(problem: Problem) -> bool:
    """Whether any station does not measure at every epoch of a simulation: by rules of its sensor, or its schedule."""
    return any(s.schedule is not None or problem.model.sensor(s.sensor).visible for s in problem.stations)
