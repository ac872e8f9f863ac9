"""Whether memory stays flat: `python tests/fuzz/memory.py [--epochs 1000000] [--seconds 60]`.

Estimates a long run four times, and feeds live sessions in six parts, with the resident memory of the process after each.
Ends with 1 where it grows by more than a megabyte after the second: what one run frees is kept for the next.
"""

import argparse
import gc
import itertools
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":
    os.environ.setdefault("PIAZZI_CACHE", str(ROOT / ".cache" / "tests"))

import piazzi as pz  # noqa: E402

BATCH = (("ekf", pz.ExtendedKalmanFilter()), ("window:20", pz.SlidingWindow(20)))
LIVE = (("ekf", pz.ExtendedKalmanFilter()), ("srekf", pz.SquareRootKalmanFilter()), ("window:5", pz.SlidingWindow(5)))
STEP = 1000  # updates between two looks at the clock
GROWTH = 1.0  # MB: a double kept for every epoch or update is more


def resident() -> float:
    """Megabytes of memory that the process has, after everything unreachable is gone."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6


def line() -> pz.Problem:
    """Position and velocity on a line, seen by range."""
    model = pz.Model(["x", "v"], {"x": "v", "v": "-x"}, [pz.Sensor("range", ["x"])])
    return pz.Problem(
        model, pz.Gaussian([1.0, 0.0], np.eye(2)), pz.ProcessNoise(1e-6 * np.eye(2)), [pz.Station("s", "range", [[0.01]])]
    )


def estimates(estimator: object, epochs: int, times: int) -> list[float]:
    """Memory after each of several estimates of the same long run."""
    problem = line()
    tracking = pz.simulate(problem, np.arange(epochs) * 0.01, np.random.default_rng(0))
    out = []
    for _ in range(times):
        estimator.estimate(problem, tracking)  # type: ignore[attr-defined]
        out.append(resident())
    return out


def updates(estimator: object, parts: int, enough: Callable[[int, float], bool]) -> tuple[list[float], int]:
    """Memory after each of several parts of one live session, a part until `enough(updates, seconds)`; how many updates."""
    session = estimator.start(line())  # type: ignore[attr-defined]
    out, total, clock = [], 0, itertools.count()
    for _ in range(parts):
        count, began = 0, time.monotonic()
        while not enough(count, time.monotonic() - began):
            for _ in range(STEP):
                t = next(clock) * 0.01
                session.update("s", np.cos(t), t)
            count += STEP
        out.append(resident())
        total += count
    return out, total


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--epochs", type=int, default=1_000_000)
    parser.add_argument("--seconds", type=float, default=60.0, help="for each live session")
    parser.add_argument("--updates", type=int, help="for each live session, in place of seconds")
    options = parser.parse_args()
    growth = []
    for name, estimator in BATCH:
        began = time.process_time()
        found = estimates(estimator, options.epochs, 4)
        print(f"{name}: {options.epochs:,} epochs, 4 times in {time.process_time() - began:.1f} s CPU: {shown(found)}")
        growth.append(max(found) - found[1])

    def enough(count: int, seconds: float) -> bool:
        return seconds >= options.seconds / 6 if options.updates is None else count >= options.updates / 6

    for name, estimator in LIVE:
        began = time.monotonic()
        found, total = updates(estimator, 6, enough)
        print(f"{name} live: {total:,} updates in {time.monotonic() - began:.0f} s: {shown(found)}")
        growth.append(max(found) - found[1])
    return 1 if max(growth) > GROWTH else 0


def shown(megabytes: list[float]) -> str:
    return ", ".join(f"{number:.1f}" for number in megabytes) + " MB"


if __name__ == "__main__":
    sys.exit(main())
