"""One measurement at a time from Python: ``predict(t)`` and ``update(station, z)`` of the founding problems."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator
from typing import Any

from figures import Figure

import piazzi as pz

LEAST = 1500  # measurements for each figure
BOUND = 20.0


def figures() -> Iterator[Figure]:
    for name in ("satellite-bearing", "b612-range"):
        yield _figure(name, "ekf", pz.ExtendedKalmanFilter(), BOUND)
    yield _figure("satellite-bearing", "window:10", pz.SlidingWindow(10), None)
    yield _figure("satellite-bearing", "window:100", pz.SlidingWindow(100), None)


def _figure(name: str, what: str, estimator: Any, bound: float | None) -> Figure:
    problem, tracking = pz.load(name)
    whole, station = estimator.estimate(problem, tracking), problem.stations[0].name
    rows = list(zip(tracking.times.tolist(), tracking.values[:, 0].tolist(), strict=True))
    seconds: list[float] = []
    same = True
    while len(seconds) < LEAST:
        session = estimator.start(problem)
        for k, (t, z) in enumerate(rows):
            started = time.perf_counter()
            session.predict(t)
            session.update(station, z)
            seconds.append(time.perf_counter() - started)
            same &= bool((session.mean == whole.mean[k]).all())
    late = sorted(seconds)[int(0.99 * len(seconds))]
    agrees = "bit for bit the whole run" if same else "NOT the whole run"
    note = f"wall clock, median; 99 of 100 within {late * 1e6:.0f} us; {agrees}"
    return Figure(f"{name}, {what}, one measurement", statistics.median(seconds) * 1e6, "us", bound=bound, note=note)
