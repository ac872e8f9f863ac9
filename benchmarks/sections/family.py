"""The family beside the extended Kalman filter: time through ``estimate``, and operations counted in the same kernels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np
from cases import Case, apart, calls, recording, variants
from counting import operations_per_epoch
from figures import Figure, cpu_seconds, interleaved

import piazzi as pz

REPEATS = 20
BOUND = 2.0
EKF = pz.ExtendedKalmanFilter()
FAMILY = {
    "square-root EKF": (pz.SquareRootKalmanFilter(), ""),
    "UKF": (pz.UnscentedKalmanFilter(), "9 sigma points; the central one's unused Jacobian is counted"),
    "smoother": (pz.Smoother(), ""),
}


def figures() -> Iterator[Figure]:
    cases = variants(REPEATS + 1)
    for name, (estimator, note) in FAMILY.items():
        yield from _beside(name, note, estimator, cases)
    problem, tracking = pz.load(recording())
    root, ekf = (e.estimate(problem, tracking) for e in (pz.SquareRootKalmanFilter(), EKF))
    yield Figure("square-root EKF, time alone", root.seconds * 1e3, "ms", note=f"the EKF: {apart(root.mean, ekf)}")
    gain = _last_half(pz.UnscentedKalmanFilter()) / _last_half(EKF)
    yield Figure("UKF's position RMSE, last half", gain, "x", note="of the EKF's")
    yield from _batch()


def _batch() -> Iterator[Figure]:
    """Batch least squares on an orbit without process noise, started from the truth."""
    problem, recorded = pz.load(recording())
    calm = replace(problem, process_noise=pz.ProcessNoise(np.zeros(4), "second", "scaled"))
    rng = np.random.default_rng(0)
    cases = [(calm, pz.simulate(calm, recorded.times, rng)) for _ in range(4)]
    batch = pz.BatchLeastSquares(start=cases[0][1].truth[0])
    cases = [(calm, pz.Tracking(t.row_times, cases[0][1].values + 1e-6 * rng.normal(size=t.values.shape))) for _, t in cases]
    rounds, others = batch.estimate(*cases[0]).iterations, cycle(cases)
    seconds, ratio = interleaved(calls(batch, cases), lambda: cpu_seconds(lambda: EKF.estimate(*next(others))))
    note = f"{rounds} iterations; each propagates, linearises and rotates; EKF of the same rows"
    yield Figure("batch, per epoch", seconds / len(recorded.times) * 1e6, "us", ratio=ratio, to="EKF", note=note)
    yield Figure("  per iteration", seconds / rounds * 1e3, "ms", ratio=ratio / rounds, to="EKF")


def _beside(name: str, note: str, estimator: Any, cases: list[Case]) -> Iterator[Figure]:
    """Time in multiples of the EKF's, measured in turn, and that over the multiple of its operations."""
    others = cycle(cases)

    def ekf_seconds() -> float:
        case = next(others)
        return cpu_seconds(lambda: EKF.estimate(*case))

    seconds, ratio = interleaved(calls(estimator, cases), ekf_seconds)
    yield Figure(f"{name}, per epoch", seconds / len(cases[0][1].times) * 1e6, "us", ratio=ratio, to="EKF", note=note)
    ours, theirs = (operations_per_epoch(e, cases[0]) for e in (estimator, EKF))
    note = f"{ours:.0f} operations an epoch, the EKF {theirs:.0f}: {ours / theirs:.2f}x"
    yield Figure("  time over operations, as multiples", ratio * theirs / ours, "", bound=BOUND, note=note)


def _last_half(estimator: Any) -> float:
    (row,) = pz.compare(*pz.load(recording()), {"one": estimator}).rows
    return float(row.rmse_last_half["position"])
