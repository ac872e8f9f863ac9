"""The filter equals an independent one written in plain NumPy with derivatives by hand, on the founding problems."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.problems import MU_EARTH, assert_same_estimate, b612, satellite, sigma
from tests.references import textbook

Q_SATELLITE = np.diag([0.01, 0.01, 0.0025, 0.0025])


def oracle(problem, tracking, step, row, Q):
    rows = [[row(z)] for z in tracking.values]
    return textbook.extended_kalman_filter(problem.mean, problem.covariance, tracking.times, rows, step, Q)


def satellite_oracle(problem, tracking, step):
    R = problem.stations[0].noise
    return oracle(problem, tracking, step, lambda z: textbook.bearing(z, R), lambda t, dt: Q_SATELLITE * dt)


def same_innovations(estimate, run, tolerance):
    nu, S = np.array(run.innovations), np.array(run.innovation_covariances)
    assert_allclose(estimate.innovation_covariances, S, rtol=tolerance)
    assert_allclose(estimate.innovations / np.sqrt(S[:, :, 0]), nu / np.sqrt(S[:, :, 0]), rtol=0, atol=tolerance)


INTEGRATORS = {
    "taylor": (pz.Taylor(15), textbook.taylor(MU_EARTH, 15)),
    "rk4": (pz.RungeKutta4(2), textbook.runge_kutta(lambda t, x: textbook.gravity(x, MU_EARTH), 2)),
}


@pytest.mark.parametrize("update", ["joint", "components"])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_satellite_from_bearings(integrator, update):
    ours, step = INTEGRATORS[integrator]
    problem = satellite(ours)
    tracking = pz.simulate(problem, np.arange(300) * 15.0, np.random.default_rng(5))
    estimate = pz.ExtendedKalmanFilter(update).estimate(problem, tracking)
    run = satellite_oracle(problem, tracking, step)
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, run, 1e-6, unit=sigma(estimate))
    same_innovations(estimate, run, 1e-6)


def test_satellite_on_the_founding_recording(data_dir):
    recording = np.load(data_dir / "satellite" / "slide_example.npz", allow_pickle=False)
    noise = pz.ProcessNoise(recording["Q"], "second", "scaled")
    problem = satellite(
        prior=pz.Gaussian(recording["x0"], recording["P0"]),
        process_noise=noise,
        stations=[pz.Station("earth", "bearing", recording["R"])],
    )
    tracking = pz.Tracking(
        np.arange(len(recording["meas"])) * float(recording["dt"]), recording["meas"], truth=recording["truth"]
    )
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    run = satellite_oracle(problem, tracking, textbook.taylor(MU_EARTH, 15))
    assert_same_estimate(estimate, run, 1e-5, unit=sigma(estimate))
    # the design's figures, which an independent C program and a quad-precision solve agree on
    errors = estimate.mean - tracking.truth
    half = len(errors) // 2
    rmse = [np.sqrt((errors[a:, s] ** 2).sum(axis=1).mean()) for a in (0, half) for s in (slice(0, 2), slice(2, 4))]
    assert_allclose(rmse, [616655.46, 142.2416, 13985.43, 6.72672], rtol=1e-6)


@pytest.mark.parametrize("update", ["joint", "components"])
@pytest.mark.parametrize("Q", [(0.0, 0.0, 0.01, 0.01), (0.0, 0.0, 0.0, 0.0)], ids=["singular Q", "zero Q"])
def test_b612_from_ranges(Q, update):
    problem = b612(Q)
    tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(0))
    estimate = pz.ExtendedKalmanFilter(update).estimate(problem, tracking)
    step = textbook.runge_kutta(lambda t, x: textbook.gravity(x, 1000.0), 10)
    run = oracle(
        problem,
        tracking,
        step,
        lambda z: textbook.range_from([10.0, 0.0], z, problem.stations[0].noise),
        lambda t, dt: np.diag(Q),
    )
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, run, 1e-6, unit=sigma(estimate))
    same_innovations(estimate, run, 1e-6)


def test_founding_step_equals_the_printed_one():
    """The Taylor step and its derivative are the ones printed in the founding text."""
    problem = satellite(pz.Taylor(1))
    x = np.array([1.3e7, 1.9e7, 3400.0, -2100.0])
    nxt, Phi = textbook.founding_step(x, 15.0, MU_EARTH)
    ours, ours_Phi = problem.step(x, 15.0)
    assert_allclose(ours, nxt, rtol=1e-15)
    assert_allclose(ours_Phi, Phi, rtol=1e-13, atol=1e-16)
