"""The same filters run with filterpy: its classes, and the physics in Python as its users write it."""

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
    ours, _ = interleaved(calls(pz.UnscentedKalmanFilter(), cases), lambda: 1.0)
    theirs = min(cpu_seconds(lambda case=case: run_unscented(*case)) for case in cases[:2])
    same = apart(run_unscented(problem, tracking), pz.UnscentedKalmanFilter().estimate(problem, tracking))
    yield Figure("UKF, whole run", ours * 1e3, "ms")
    yield Figure("  filterpy", theirs * 1e3, "ms", "higher", theirs / ours, "ours", note=f"dynamics in plain Python; {same}")


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


def run_unscented(problem: pz.Problem, tracking: pz.Tracking) -> np.ndarray:
    """Means (K, 4) of filterpy's UnscentedKalmanFilter with our weights; bearings are averaged about the central point's."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    dt, ours = float(tracking.times[1] - tracking.times[0]), pz.UnscentedKalmanFilter()
    substeps = int(problem.integrator.counts(np.array([dt]))[0])

    def mean_bearing(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return values[0] + weights @ bearing_residual(values, values[0])

    points = MerweScaledSigmaPoints(4, ours.alpha, ours.beta, ours.kappa)
    ukf = UnscentedKalmanFilter(
        4,
        1,
        dt,
        bearing,
        lambda x, dt: step(x, dt, substeps)[0],
        points,
        z_mean_fn=mean_bearing,
        residual_z=bearing_residual,
    )
    ukf.x, ukf.P = np.array(problem.mean), np.array(problem.covariance)
    ukf.Q, ukf.R = problem.process_noise.covariance * dt, np.array(problem.stations[0].noise)
    out = np.empty((len(tracking.times), 4))
    for k, z in enumerate(tracking.values):
        if k:
            ukf.predict()
        else:
            ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
        ukf.update(z)
        out[k] = ukf.x
    return out
