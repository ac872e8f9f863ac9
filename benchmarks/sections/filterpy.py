"""The same filter run with filterpy: its class, and the physics in Python as its users write it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from by_hand import bearing, bearing_jacobian, bearing_residual, step
from cases import apart, calls, recording, variants
from figures import Figure, cpu_seconds, interleaved

import piazzi as pz


def figures() -> Iterator[Figure]:
    cases = variants(11)
    ours, _ = interleaved(calls(pz.ExtendedKalmanFilter(), cases), lambda: 1.0)
    theirs = min(cpu_seconds(lambda case=case: run(*case)) for case in cases[:3])
    problem, tracking = pz.load(recording())
    note = f"dynamics in plain Python; {apart(run(problem, tracking), pz.ExtendedKalmanFilter().estimate(problem, tracking))}"
    yield Figure("EKF, whole run", ours * 1e3, "ms")
    yield Figure("  filterpy", theirs * 1e3, "ms", "higher", theirs / ours, "ours", note=note)


def run(problem: pz.Problem, tracking: pz.Tracking) -> np.ndarray:
    """Means (K, 4) of filterpy's ExtendedKalmanFilter."""
    from filterpy.kalman import ExtendedKalmanFilter

    dt = float(tracking.times[1] - tracking.times[0])
    substeps = int(problem.integrator.counts(np.array([dt]))[0])

    class Satellite(ExtendedKalmanFilter):
        def predict_x(self, u: float = 0.0) -> None:
            x, self.F = step(self.x, dt, substeps)
            self.x = x

    ekf = Satellite(dim_x=4, dim_z=1)
    ekf.x, ekf.P = np.array(problem.mean), np.array(problem.covariance)
    ekf.Q, ekf.R = problem.process_noise.covariance * dt, np.array(problem.stations[0].noise)
    out = np.empty((len(tracking.times), 4))
    for k, z in enumerate(tracking.values):
        if k:
            ekf.predict()
        ekf.update(z, bearing_jacobian, bearing, residual=bearing_residual)
        out[k] = ekf.x
    return out
