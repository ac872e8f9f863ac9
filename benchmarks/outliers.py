"""How estimators bear 5 % of bearings replaced by uniform ones over (-pi, pi]: position errors over many seeds.

    .venv/bin/python benchmarks/outliers.py [--seeds 50] [--source satellite-bearing | RECORDING.npz]

A scenario is simulated anew with every seed; of a recording only the replaced bearings change.  The error is
sqrt(mean |position error|^2) over the whole run; the ratio is that of its median to the clean graph's.  A robust graph has to
keep below 1.2.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import piazzi as pz

SHARE = 0.05


def with_outliers(tracking: pz.Tracking, rng: np.random.Generator) -> pz.Tracking:
    """The same tracking with a share of its rows replaced."""
    values = tracking.values.copy()
    wrong = rng.choice(len(values), round(SHARE * len(values)), replace=False)
    values[wrong, 0] = rng.uniform(-np.pi, np.pi, len(wrong))
    return pz.Tracking(tracking.row_times, values, tracking.row_stations, tracking.truth)


def position_error(estimate: pz.Estimate) -> float:
    """Root of the mean squared distance from the truth, m."""
    error = (estimate.mean - estimate.tracking.truth)[:, :2]
    return float(np.sqrt((error**2).sum(axis=1).mean())) if estimate.success else np.inf


def main() -> None:
    """Print a row for each estimator."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--source", default="satellite-bearing")
    options = parser.parse_args()
    losses = ("huber", "cauchy", "tukey")
    rows: dict[str, tuple[bool, Any]] = {
        "graph, clean": (False, pz.FactorGraph()),
        "graph": (True, pz.FactorGraph()),
        **{f"graph:{loss}": (True, pz.FactorGraph(loss=loss)) for loss in losses},
        **{f"graph:{loss}, clean": (False, pz.FactorGraph(loss=loss)) for loss in losses},
        "ekf, clean": (False, pz.ExtendedKalmanFilter()),
        "ekf": (True, pz.ExtendedKalmanFilter()),
        "ekf:gate": (True, pz.ExtendedKalmanFilter(gate=0.999)),
        "window:100, clean": (False, pz.SlidingWindow()),
        "window:100": (True, pz.SlidingWindow()),
        **{f"window:100:{loss}": (True, pz.SlidingWindow(loss=loss)) for loss in losses},
    }
    errors: dict[str, list[float]] = {name: [] for name in rows}
    for seed in range(options.seeds):
        problem, clean = pz.load(options.source, seed=seed)
        bad = with_outliers(clean, np.random.default_rng(1_000_000 + seed))
        for name, (outliers, estimator) in rows.items():
            errors[name].append(position_error(estimator.estimate(problem, bad if outliers else clean)))
    reference = float(np.median(errors["graph, clean"]))
    print(f"{options.source}, {options.seeds} seeds, {100 * SHARE:g} % of the bearings uniform; position error, km")
    print(f"{'':22s}{'median':>14s}{'ratio':>14s}{'mean':>12s}{'largest':>12s}{'failed':>8s}")
    for name, found in errors.items():
        e = np.array(found)
        there = e[np.isfinite(e)]
        figures = (
            f"{np.median(e) / 1e3:14.2f}{np.median(e) / reference:14.3f}{there.mean() / 1e3:12.4g}{there.max() / 1e3:12.4g}"
        )
        print(f"{name:22s}{figures}{len(e) - len(there):8d}")


if __name__ == "__main__":
    main()
