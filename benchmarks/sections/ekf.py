"""The extended Kalman filter through ``estimate``, measurements new at every call."""

from __future__ import annotations

import statistics
from collections.abc import Iterator
from dataclasses import replace

from cases import Case, apart, calls, floor, recording, variants
from figures import Figure, interleaved

import piazzi as pz

REPEATS = 40
BOUND = 1.25


def figures() -> Iterator[Figure]:
    yield from _beside("Taylor, 15 substeps", "ekf", variants(REPEATS + 1))
    yield from _beside("RK4, 10 substeps", "ekf_rk4", variants(REPEATS + 1, integrator=pz.RungeKutta4(10)))


def _recorded(case: Case) -> Case:
    """The recording itself with the settings of a variant of it."""
    problem, tracking = pz.load(recording())
    return replace(problem, integrator=case[0].integrator), tracking


def _beside(what: str, workload: str, cases: list[Case]) -> Iterator[Figure]:
    estimator = pz.ExtendedKalmanFilter()
    inside: list[float] = []  # seconds, and not the estimates: what keeps those pays for their memory too

    def run(case: Case) -> None:
        inside.append(estimator.estimate(*case).seconds)

    def c() -> float:
        return floor().seconds(workload, 3)

    seconds, ratio = interleaved([lambda case=case: run(case) for case in cases], c)
    theirs = floor().ekf(rk4=workload == "ekf_rk4")[0]
    note = f"problem and tracking new at every call; {apart(theirs, estimator.estimate(*_recorded(cases[0])))}"
    yield Figure(f"EKF, {what}", seconds * 1e3, "ms", ratio=ratio, to="C floor", bound=BOUND, note=note)
    again, ratio = interleaved(calls(estimator, [(cases[0][0], pz.Tracking(t.row_times, t.values)) for _, t in cases]), c)
    yield Figure("  tracking made in memory for every call", again * 1e3, "ms", ratio=ratio, to="C floor")
    kernel = statistics.median(inside[1:])
    note = "wall clock, as in Estimate.seconds"
    yield Figure("  of it the compiled run", kernel * 1e3, "ms", ratio=kernel / c(), to="C floor", note=note)
