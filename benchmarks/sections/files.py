"""Files of a million measurements: written, read back, and the same bit for bit."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figure, cpu_seconds

import piazzi as pz

J = 10**6
BOUND = 2.0
SCENARIO = "satellite-bearing"


def figures() -> Iterator[Figure]:
    from piazzi.io import save

    problem, few = pz.load(SCENARIO)
    simulated = pz.simulate(problem, np.arange(J) * 15.0, np.random.default_rng(0))
    bare = pz.Tracking(simulated.row_times, simulated.values)
    with tempfile.TemporaryDirectory(prefix="piazzi-bench-") as name:
        folder = Path(name)
        for ending, tracking in (("nc", simulated), ("npz", simulated), ("csv", bare), ("csv", simulated)):
            for some in (few, tracking):  # first what is imported once
                path = folder / f"a.{ending}"
                save(path, problem, some)
                found: list[Any] = []
                seconds = cpu_seconds(lambda path=path, found=found: found.append(_load(path)))
            truth = "" if tracking.truth is None else ", with the truth"
            size, exact = path.stat().st_size / 2**20, "bit for bit" if _same(found[0], tracking) else "NOT the same"
            yield Figure(f".{ending}{truth}", seconds, "s CPU", bound=BOUND, note=f"{size:.0f} MiB; {exact}")


def _load(path: Path) -> pz.Tracking:
    return pz.load(path, **({"scenario": SCENARIO} if path.suffix == ".csv" else {}))[1]


def _same(a: pz.Tracking, b: pz.Tracking) -> bool:
    truths = [np.zeros(0) if t.truth is None else t.truth for t in (a, b)]
    return all(np.array_equal(x, y) for x, y in ((a.row_times, b.row_times), (a.values, b.values), truths))
