"""Monte Carlo: the filter over many runs in lanes, and a whole study of 10,000 runs, beside the C floor's vectorised filter.

The study simulates, filters, scores and keeps every run; its CPU seconds are those of all processes, its memory the sum of
their peaks, though libraries that they share count once in each.  The floor filters recorded bearings with noise added, and
keeps the last state only.
"""

from __future__ import annotations

import os
import resource
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from cases import floor, recording
from figures import Figure, UnavailableError

import piazzi as pz

LANE_RUNS, ROUNDS, STUDY_RUNS = 256, 7, 10_000
FILTER_BOUND, STUDY_BOUND, MEMORY_BOUND, CORE_BOUND = 0.7, 0.3, 1.5, 1.7


def figures() -> Iterator[Figure]:
    if not Path("/proc/self/status").exists():
        raise UnavailableError("memory of processes is read from /proc")
    c = _c_runs_per_second()
    yield _filter(c)
    with tempfile.TemporaryDirectory(prefix="piazzi-bench-") as folder:
        one, two = (_study(Path(folder) / f"{workers}.nc", workers) for workers in (1, 2))
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
    yield Figure(
        f"study of {STUDY_RUNS:,} EKF runs", STUDY_RUNS / one["cpu"], "runs/s", "higher",
        ratio=STUDY_RUNS / one["cpu"] / c, to="C filter", bound=STUDY_BOUND, note="per CPU second, all processes",
    )  # fmt: skip
    yield Figure(
        "  memory of all processes, 2 workers", two["memory"], "GB", bound=MEMORY_BOUND, note="sum of the peaks of all"
    )
    yield Figure(
        "  second worker", STUDY_RUNS / two["wall"], "runs/s", "higher", ratio=one["wall"] / two["wall"], to="one worker",
        bound=CORE_BOUND, note=f"wall clock, from start to finished file; {load}",
    )  # fmt: skip


def _c_runs_per_second() -> float:
    """Runs per CPU second of the floor's vectorised filter."""
    rng = np.random.default_rng(0)
    return median(floor().monte_carlo_runs_per_cpu_second(rng, LANE_RUNS) for _ in range(ROUNDS))


def _filter(c: float) -> Figure:
    """The filter of an ensemble with its scores, on as many bearings."""
    from piazzi.study.ensemble import Layout, filter_runs

    problem, tracking = pz.load(recording())
    layout = Layout(problem, tracking.times)
    z = tracking.values[None] + 1e-4 * np.random.default_rng(0).normal(size=(LANE_RUNS, *tracking.values.shape))
    truth = np.zeros((len(z), len(tracking.times), problem.model.n))  # scores are part of it
    filter_runs(layout, z[:8], truth[:8])
    rates = []
    for _ in range(ROUNDS):
        started = time.thread_time()
        filter_runs(layout, z, truth)
        rates.append(LANE_RUNS / (time.thread_time() - started))
    ours = median(rates)
    return Figure(
        "EKF of an ensemble", ours, "runs/s", "higher", ratio=ours / c, to="C filter", bound=FILTER_BOUND, note="per CPU second"
    )


def _study(path: Path, workers: int) -> dict[str, float]:
    """Wall-clock and CPU seconds of a study, and the most memory that it used, GB."""
    study = pz.Study.of("satellite-bearing", estimators=["ekf"], runs=STUDY_RUNS)
    pz.Study.of("satellite-bearing", estimators=["ekf"], runs=8).run(path.with_name(f"warm{workers}.nc"), workers=1)
    memory = _Memory()
    cpu, wall = _cpu(), time.perf_counter()
    study.run(path, workers=workers)
    out = {"wall": time.perf_counter() - wall, "cpu": _cpu() - cpu, "memory": memory.stop()}
    return out


def _cpu() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


class _Memory:
    """The sum of the largest resident sizes that this process and its children had, looked at five times a second."""

    def __init__(self) -> None:
        self._most: dict[int, float] = {}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def stop(self) -> float:
        self._end.set()
        self._thread.join()
        return sum(self._most.values())

    def _look(self) -> None:
        while not self._end.wait(0.2):
            for pid in (os.getpid(), *_children()):
                self._most[pid] = max(self._most.get(pid, 0.0), _peak(pid))


def _children() -> list[int]:
    found: list[Any] = []
    for task in Path("/proc/self/task").iterdir():
        try:
            found += (task / "children").read_text().split()
        except OSError:
            continue
    return [int(pid) for pid in found]


def _peak(pid: int) -> float:
    """Largest resident size so far, GB; 0 where the process is gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(float(line.split()[1]) for line in lines if line.startswith("VmHWM:")) * 1024 / 1e9
