"""Gaps that visibility leaves in a schedule: a number of substeps that suits its intervals may be far too few there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array

LONG = 10.0  # times the usual interval
FINER = 4
NOTICED = 1.0  # standard deviation of a measurement


def gap_warning(problem: Problem, tracking: Tracking) -> str:
    """A sentence where the steps over the longest gap move what is measured behind it by more than its noise, else ""."""
    integrator, times = problem.integrator, tracking.times
    assert integrator is not None
    if integrator.chooses_steps or integrator.substeps is None or tracking.truth is None or len(times) < 3:
        return ""
    intervals = np.diff(times)
    k, usual = int(np.argmax(intervals)), float(np.median(intervals))
    begin, gap = float(times[k]), float(intervals[k])
    if gap <= LONG * usual:
        return ""
    finer = replace(problem, integrator=replace(integrator, substeps=FINER * integrator.substeps))
    ends = [np.ascontiguousarray(p.step(tracking.truth[k], gap, begin)[0]) for p in (problem, finer)]
    stations = tracking.stations_of(problem)[tracking.first_row[k + 1] : tracking.first_row[k + 2]]
    moved = {problem.stations[s].name: _moved(problem, int(s), float(times[k + 1]), ends) for s in stations}
    station = max(moved, key=lambda name: moved[name])
    if moved[station] <= NOTICED:
        return ""
    count = integrator.substeps
    return (
        f"the gap from t = {begin:g} s to t = {begin + gap:g} s has {count} substep{'s' if count > 1 else ''}, like every "
        f"other: steps of {gap / count:g} s move what {station!r} measures behind it by {moved[station]:.2g} sigma; give the "
        f"integrator max_step={usual / count:g} in place of substeps"
    )


def _moved(problem: Problem, s: int, t: float, ends: list[Array]) -> float:
    """How far two states are apart for a station, in standard deviations; infinite where one has no prediction."""
    station = problem.stations[s]
    one, other = (np.asarray(problem.measure(station.name, x, t)) for x in ends)
    turn = np.where(problem.model.sensor(station.sensor).is_angle, 2.0 * np.pi, np.inf)
    apart = np.abs(one - other)
    off = float((np.minimum(apart, np.abs(turn - apart)) / np.sqrt(np.diagonal(station.noise))).max())
    return off if np.isfinite(off) else np.inf
