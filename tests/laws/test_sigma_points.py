"""Where the unscented filter puts its points: the default against the cubature filter, and on problems that bend."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz

pytestmark = pytest.mark.usefixtures("uncompiled")

SEEDS = range(10)


def growth_model(seed: int) -> tuple[pz.Problem, pz.Tracking]:
    """The univariate nonstationary growth model (Gordon, Salmond and Smith, IEE Proc. F 140, 1993): two peaks, seen squared."""
    rng = np.random.default_rng(seed)
    model = pz.Model(["x"], ["0.5*x + 25*x/(1 + x**2) + 8*cos(1.2*t)"], [pz.Sensor("s", ["x**2/20"])], discrete=True)
    noise = pz.ProcessNoise([1.0], per="step")
    problem = pz.Problem(model, pz.Gaussian([0.1], [1.0]), noise, [pz.Station("s", "s", 1.0)], prior_time=0.0)
    x, truth = rng.normal(0.1, 1.0), []
    for t in range(100):
        x = 0.5 * x + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * t) + rng.standard_normal()
        truth.append(x)
    z = np.array(truth) ** 2 / 20 + rng.standard_normal(100)
    return problem, pz.Tracking(np.arange(1.0, 101.0), z, truth=np.array(truth)[:, None])


def pendulum(seed: int) -> tuple[pz.Problem, pz.Tracking]:
    """A pendulum that is let go at 1.5 rad and seen by sin(a), begun from an ignorant prior at its lowest point.

    The numbers of steps, noises and gravity are those of Sarkka and Svensson, Bayesian Filtering and Smoothing (2023), 5.1.
    """
    rng, h, g = np.random.default_rng(seed), 0.01, 9.81
    Q = h * np.array([[h**2 / 3, h / 2], [h / 2, 1.0]]) * 0.01
    model = pz.Model(["a", "w"], ["a + 0.01*w", "w - 9.81*sin(a)*0.01"], [pz.Sensor("s", ["sin(a)"])], discrete=True)
    noise = pz.ProcessNoise(Q, per="step")
    problem = pz.Problem(model, pz.Gaussian([0, 0], [1, 1]), noise, [pz.Station("s", "s", 0.1)], prior_time=0.0)
    x, truth, L = np.array([1.5, 0.0]), [], np.linalg.cholesky(Q)
    for _ in range(100):
        x = np.array([x[0] + h * x[1], x[1] - g * h * np.sin(x[0])]) + L @ rng.standard_normal(2)
        truth.append(x)
    z = np.sin(np.array(truth)[:, 0]) + np.sqrt(0.1) * rng.standard_normal(100)
    return problem, pz.Tracking(h * np.arange(1, 101), z, truth=np.array(truth))


def squared(estimator, make) -> float:
    """Mean squared error of the first state, over all seeds."""
    errors = []
    for seed in SEEDS:
        problem, tracking = make(seed)
        estimate = estimator.estimate(problem, tracking)
        assert estimate.success, estimate.message
        errors.append(np.mean((estimate.mean - tracking.truth)[:, 0] ** 2))
    return float(np.mean(errors))


def cubature(problem, tracking, f, h):
    """The cubature Kalman filter as Arasaratnam and Haykin (2009) print it: 2 n points of equal weight."""
    n, x, P = problem.model.n, problem.mean, problem.covariance
    Q, R, out = problem.process_noise.covariance, problem.stations[0].noise, []
    before = problem.prior_time

    def points(x, P):
        S = np.sqrt(n) * np.linalg.cholesky(P)
        return np.vstack([x + S.T, x - S.T])

    for t, z in zip(tracking.times, tracking.values, strict=True):
        X = np.array([f(before, p) for p in points(x, P)])
        x, before = X.mean(axis=0), t
        P = X.T @ X / (2 * n) - np.outer(x, x) + Q
        X = points(x, P)
        Z = np.array([h(p) for p in X])
        S = Z.T @ Z / (2 * n) - np.outer(Z.mean(axis=0), Z.mean(axis=0)) + R
        K = np.linalg.solve(S, (X.T @ Z / (2 * n) - np.outer(x, Z.mean(axis=0))).T).T
        x, P = x + K @ (z - Z.mean(axis=0)), P - K @ S @ K.T
        out.append((x, P))
    return [np.array(values) for values in zip(*out, strict=True)]


@pytest.mark.parametrize(
    ("make", "f", "h"),
    [
        (
            growth_model,
            lambda t, x: 0.5 * x + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * t),
            lambda x: x**2 / 20,
        ),
        (
            pendulum,
            lambda t, x: np.array([x[0] + 0.01 * x[1], x[1] - 0.0981 * np.sin(x[0])]),
            lambda x: np.sin(x[:1]),
        ),
    ],
)
def test_with_beta_zero_it_is_the_cubature_filter(make, f, h):
    problem, tracking = make(0)
    mean, covariance = cubature(problem, tracking, f, h)
    estimate = pz.UnscentedKalmanFilter(beta=0.0).estimate(problem, tracking)
    assert_allclose(estimate.mean, mean, rtol=0, atol=1e-8)
    assert_allclose(estimate.covariance, covariance, rtol=0, atol=1e-8 * np.abs(covariance).max())


@pytest.mark.parametrize(("make", "gain"), [(growth_model, 100), (pendulum, 1.25)])
def test_the_default_is_no_worse_than_the_cubature_filter_and_better_than_small_spreads(make, gain):
    """On the problems of the literature; decision 14 tells where small spreads do as well, or better."""
    default, cubature_like = squared(pz.UnscentedKalmanFilter(), make), squared(pz.UnscentedKalmanFilter(beta=0.0), make)
    assert default <= 1.05 * cubature_like
    for alpha in (1e-3, 0.1):
        assert squared(pz.UnscentedKalmanFilter(alpha), make) > gain * default
    assert default < squared(pz.ExtendedKalmanFilter(), make)
