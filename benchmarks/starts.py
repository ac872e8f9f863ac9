"""How often the satellite is found from its prior alone, and how honestly: with and without a bank of starts.

    .venv/bin/python benchmarks/starts.py [--truths 200]

Truths are drawn from the prior of satellite-bearing with its process noise, seeds 0, 1, 2, ...  Radius rule: the whole true
trajectory of six hours stays above the Earth's radius, 6.378e6 m; other draws are thrown away and counted.

A run ends consistent where it succeeds and its NEES at five epochs (0, 1/4, 1/2, 3/4 of the run, and the end) is below the
chi-square quantile of 4 degrees of freedom at 1 - 0.01/5 (16.92): a matched linear estimator passes in at least 99 % of runs,
however its errors are correlated in time.  The share by the final state alone (99 % quantile, 13.28) stands beside it.
Then the same for B612 with a prior that allows both directions round: how often the true one is the mode called most probable.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import piazzi as pz
from piazzi.estimate.chi_square import quantile
from piazzi.scenarios import load_scenario

EARTH, LEVEL, CHECKS = 6.378e6, 0.01, 5


def drawn(problem: pz.Problem, times: Any, radius: float, count: int) -> Iterator[tuple[int, pz.Tracking | None]]:
    """Seeds and trackings, None where the truth comes too close, until so many are kept."""
    seed = kept = 0
    while kept < count:
        try:
            tracking = pz.simulate(problem, times, np.random.default_rng(seed))
            assert tracking.truth is not None
            fine = bool(np.hypot(tracking.truth[:, 0], tracking.truth[:, 1]).min() >= radius)
        except ValueError:  # through the centre
            tracking, fine = None, False
        yield seed, tracking if fine else None
        kept, seed = kept + fine, seed + 1


def nees(estimate: pz.Estimate) -> np.ndarray:
    """At the fixed epochs, infinite where the estimator failed, (CHECKS,)."""
    if not estimate.success:
        return np.full(CHECKS, np.inf)
    at = np.linspace(0, len(estimate.times) - 1, CHECKS).round().astype(int)
    error = (estimate.mean - estimate.tracking.truth)[at]
    return np.einsum("ki,ki->k", error, np.linalg.solve(estimate.covariance[at], error[:, :, None])[:, :, 0])


def satellite(count: int) -> None:
    """The founding prior."""
    scenario = load_scenario("satellite-bearing")
    estimators: dict[str, Any] = {
        "ekf": pz.ExtendedKalmanFilter(),
        "window:100": pz.SlidingWindow(),
        "graph": pz.FactorGraph(),
        "graph:bank": pz.FactorGraph(start="bank"),
    }
    all_limit, end_limit = quantile(1 - LEVEL / CHECKS, 4), quantile(1 - LEVEL, 4)
    found: dict[str, list[np.ndarray]] = {name: [] for name in estimators}
    rejected, seeds, cheaper, several = 0, [], 0, 0
    for seed, tracking in drawn(scenario.problem, scenario.times, EARTH, count):
        if tracking is None:
            rejected += 1
            continue
        seeds.append(seed)
        estimates = {name: e.estimate(scenario.problem, tracking) for name, e in estimators.items()}
        for name, estimate in estimates.items():
            found[name].append(nees(estimate))
        graph, bank = estimates["graph"], estimates["graph:bank"]
        cheaper += not graph.success or bank.details["cost"] < graph.details["cost"] - 1e-3
        several += sum(mode["probability"] > 1e-3 for mode in bank.details["modes"]) > 1
    share = 100 * rejected / (rejected + count)
    print(
        f"satellite-bearing, {count} truths from the prior above {EARTH:g} m; {rejected} rejected ({share:.1f} % of the draws)"
    )
    print(f"{'':14s}{'five epochs':>14s}{'final state':>14s}{'failed':>9s}")
    for name, values in found.items():
        q = np.array(values)
        five, end = (q < all_limit).all(axis=1).mean(), (q[:, -1] < end_limit).mean()
        print(f"{name:14s}{100 * five:12.1f} %{100 * end:12.1f} %{int(np.isinf(q[:, 0]).sum()):9d}")
    print(f"the bank found a lower cost in {cheaper} runs, and more than one mode of over 0.1 % in {several}")
    for i, values in enumerate(found["graph:bank"]):
        if not (values < all_limit).all():
            print(f"  left: seed {seeds[i]}, NEES {', '.join(f'{v:.1f}' for v in values)}")
    print(f"  of {count} matched linear runs, chance alone leaves up to {LEVEL * count:.0f} outside")


def twins(count: int) -> None:
    """B612 without process noise, its first state as uncertain as which way round it goes."""
    scenario = load_scenario("b612-range-q0")
    prior = pz.Gaussian.from_sigma([12, 0, 0, 5], [1, 1, 1, 6])
    problem = replace(scenario.problem, prior=prior, truth=pz.Truth())
    right = dict.fromkeys(("graph", "graph:bank"), 0)
    promised, rejected = 0.0, 0
    for _, tracking in drawn(problem, scenario.times, 10.0, count):
        if tracking is None:
            rejected += 1
            continue
        assert tracking.truth is not None
        mirror = np.array([1, -1, 1, -1])
        for name, estimator in {"graph": pz.FactorGraph(), "graph:bank": pz.FactorGraph(start="bank")}.items():
            estimate = estimator.estimate(problem, tracking)
            near, far = (np.abs(estimate.mean * m - tracking.truth).max() for m in (np.ones(4), mirror))
            right[name] += bool(estimate.success and near < far)
            if name == "graph:bank":
                promised += estimate.details["modes"][0]["probability"]
    print(f"\nb612-range-q0, prior mean (12, 0, 0, 5), sigma (1, 1, 1, 6): {count} truths above 10 m, {rejected} rejected")
    print(f"the right one of two twins: graph {right['graph']}, graph:bank {right['graph:bank']} of {count}")
    print(f"the bank's mean probability of the mode it calls best: {100 * promised / count:.1f} %")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--truths", type=int, default=200)
    options = parser.parse_args()
    satellite(options.truths)
    twins(options.truths)


if __name__ == "__main__":
    main()
