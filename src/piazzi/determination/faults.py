"""What is wrong with rows that do not fit: below the mask, before a pass settled, another station's, or a clock's.

A pass of which no row fits the others is asked two questions: is it that of another station, or are its times wrong?  Both are
answered by the same kernel that predicts measurements, on the same rows with another place or other times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.holding import on_sky
from piazzi.determination.passes import labels_of, passes
from piazzi.determination.setup import Setup, follow
from piazzi.earth import Epoch, transform
from piazzi.evaluate.information import predicted
from piazzi.evaluate.quantities import number
from piazzi.problem import Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare, wrapped

OUTLIER, STATION, CLOCK, DUPLICATE, CORRELATED = "outlier", "wrong station", "wrong clock", "duplicate", "correlated"
MASK, SETTLING, BEYOND = "below the mask", "before the pass settled", "beyond the gate"
SETTLED = 2  # rows at the beginning of a pass that do not fit, before which it is chance
GOOD = 3.0  # sigma, root mean square, within which a pass fits after all
BETTER = 3.0  # times, by which it has to fit better
STEP, ROUNDS, LATEST = 0.05, 8, 3600.0  # s: half of a difference, steps, and the largest error of a clock that is looked for


@dataclass(frozen=True, eq=False)
class Faults:
    """Reasons (J,) of rows, and a line for each pass whose fault is known."""

    reasons: Array
    said: tuple[str, ...]


def named(given: Setup, states: Array, keep: Array, reasons: Array) -> Faults:
    """The reasons of outliers, looked into.

    Parameters
    ----------
    given, states, keep, reasons : the set-up, the answer's states (K, n), rows that are used, and why the others are not
    """
    reasons, said = reasons.copy(), []
    given = replace(given, problem=replace(given.problem, prior_time=None))  # rows with other times may lie before it
    there = np.isfinite(given.tracking.values).any(axis=1)
    for rows in passes(given, there):
        out = np.isin(reasons[rows], (OUTLIER, STATION))
        if len(rows) > 1 and out.all():
            reason, text = _of_pass(given, states, rows)
            reasons[rows] = reason or reasons[rows]
            said += [text] if text else []
        elif out.any():
            first = int(np.argmin(out))  # the first that fits
            if SETTLED <= first < len(rows) / 2:
                reasons[rows[:first]] = SETTLING
    odd = np.flatnonzero(reasons == OUTLIER)
    low = odd[_below(given, states, odd)] if len(odd) else odd
    reasons[low] = MASK
    return Faults(reasons, tuple(said))


def _of_pass(given: Setup, states: Array, rows: Array) -> tuple[str, str]:
    """The reason of a whole pass and its line; empty where nothing explains it."""
    when = f"{labels_of(given)[rows[0]]} from {given.measured.epoch + float(given.tracking.row_times[rows[0]])}"
    size = _size(_whitened(given, states, rows, 0.0))
    other = _other_station(given, states, rows, size)
    if other:
        return STATION, f"the pass of {when} fits {other}"
    late, left = _clock(given, states, rows)
    if left < min(GOOD, size / BETTER):
        return CLOCK, f"the pass of {when} fits with a clock that is {number(abs(late), 4)} s {'fast' if late > 0 else 'slow'}"
    return "", f"the pass of {when} is {number(size, 2)} sigma off, which no clock and no other station explains"


def _other_station(given: Setup, states: Array, rows: Array, size: float) -> str:
    """The name of another station whose measurements these are, "" for none."""
    problem, names = given.problem, given.tracking.row_stations.copy()
    own = problem.stations[problem.station_index(names[rows[0]])]
    best, found = min(GOOD, size / BETTER), ""
    tried = {given.measured.labels[own.name]}
    for station in problem.stations:
        label = given.measured.labels[station.name]
        if label in tried or station.sensor != own.sensor or station.place is None:
            continue
        tried.add(label)
        left = _size(_whitened(given, states, rows, 0.0, station.name))
        if left < best:
            best, found = left, label
    return found


def _clock(given: Setup, states: Array, rows: Array) -> tuple[float, float]:
    """By how much the times of rows are late (s), by Gauss and Newton, and the root mean square that is left, in sigma."""
    late, left = 0.0, _whitened(given, states, rows, 0.0)
    for _ in range(ROUNDS):
        before, after = (_whitened(given, states, rows, late + h) for h in (-STEP, STEP))
        slope = ((after - before) / (2.0 * STEP)).reshape(-1)
        good = np.isfinite(slope)
        if not slope[good].any():
            return 0.0, np.inf
        step = -float(slope[good] @ left.reshape(-1)[good]) / float(slope[good] @ slope[good])
        late += step
        if not abs(late) <= LATEST:
            return late, np.inf
        left = _whitened(given, states, rows, late)
        if abs(step) < 1e-6:
            break
    return late, _size(left)


def _whitened(given: Setup, states: Array, rows: Array, late: float, station: str | None = None) -> Array:
    """Residuals (R, m) in sigma of rows whose times are late by so much, or that are of another station; all from one orbit."""
    problem, tracking = given.problem, given.tracking
    t = tracking.row_times[rows] - late
    start = float(tracking.times[0])
    names = tracking.row_stations[rows] if station is None else np.full(len(rows), station, dtype=object)
    moved = Tracking(t, tracking.values[rows], names, epoch=tracking.epoch)
    x = _states_at(given, start, states[0], moved.times)
    computed = predicted(problem, prepare(problem, moved), x)
    which = moved.stations_of(problem)
    z = tracking.values[rows]
    off = wrapped(problem, which, z - computed)
    for s in distinct(which):
        own = which == s
        m = len(problem.stations[s].noise)
        off[own, :m] *= on_sky(problem, int(s), computed[own][:, :m])
    sigma = np.sqrt(np.diagonal(problem.station_noise, axis1=1, axis2=2))[tracking.stations_of(problem)[rows]]
    return np.asarray(off / sigma)


def _states_at(given: Setup, start: float, first: Array, times: Array) -> Array:
    """States (K, n) at increasing times of the orbit that begins at `first`."""
    step = given.chosen.max_step
    if times[0] < start:  # a clock that is late at the first rows of all
        count = max(int(np.ceil((start - times[0]) / step)), 1) + 1
        first = follow(given.problem, np.linspace(start, float(times[0]), count), first, step)[0][-1]
        start = float(times[0])
    nodes = times if times[0] == start else np.concatenate([[start], times])
    return follow(given.problem, nodes, first, step)[0][len(nodes) - len(times) :]


def _size(whitened: Array) -> float:
    good = whitened[np.isfinite(whitened)]
    return float(np.sqrt(np.mean(good**2))) if good.size else np.inf


def _below(given: Setup, states: Array, rows: Array) -> Array:
    """(R,) whether the object is below the mask of the station, as far as that is known."""
    tracking, out = given.tracking, np.zeros(len(rows), dtype=bool)
    which = tracking.stations_of(given.problem)[rows]
    k = np.searchsorted(tracking.times, tracking.row_times[rows])
    for s in distinct(which):
        site: Any = getattr(given.problem.stations[s].place, "station", None)
        if site is None or given.measured.about != "earth":
            continue
        own = np.flatnonzero(which == s)
        epochs: list[Epoch] = [given.measured.epoch + float(t) for t in tracking.row_times[rows[own]]]
        place = transform(states[k[own], :3], None, "GCRF", "ITRF", epochs)[0]
        out[own] = site.look(place, epochs)[1] < site.mask
    return out
