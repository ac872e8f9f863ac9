"""The graph and the window on linear-Gaussian problems of every size: smoothers and least squares written in the tests."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import LinearCase
from tests.laws.problems import assert_same_estimate, linear, random_covariance, random_stable, sigma
from tests.references import dense, smoother

pytestmark = pytest.mark.usefixtures("uncompiled")

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 9)
SENSORS = st.lists(st.integers(1, 3), min_size=1, max_size=3)


def assert_graph_is(estimate, oracle, tolerance):
    """Means, marginal covariances and those of neighbours."""
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, oracle, tolerance)
    s = sigma(oracle)
    s = np.where(s > 0, s, 1.0)
    unit = s[:-1, :, None] * s[1:, None, :]
    cross = estimate.details["cross_covariances"]
    assert cross.shape == oracle.cross.shape
    assert_allclose(cross / unit, oracle.cross / unit, rtol=0, atol=tolerance)


@given(SIZES, SENSORS, SEEDS)
@settings(max_examples=30)
def test_graph_is_the_rauch_tung_striebel_smoother(n, widths, seed):
    case = LinearCase(n, widths, seed)
    estimate = pz.FactorGraph(cross_covariances=True).estimate(case.problem, case.tracking)
    assert_graph_is(estimate, smoother.rauch_tung_striebel(*case.chain), 1e-7)


@pytest.mark.parametrize("solver", ["chain", "bordered"])
@given(SIZES, SENSORS, st.integers(0, 9), SEEDS)
@settings(max_examples=40)
def test_graph_is_dense_least_squares(solver, n, widths, rank, seed):
    """With full, singular and zero process noise, correlated."""
    case = LinearCase(n, widths, seed, rank=rank if rank < n else None)
    estimate = pz.FactorGraph(cross_covariances=True, solver=solver).estimate(case.problem, case.tracking)
    assert_graph_is(estimate, dense.smooth(*case.chain), 1e-7)
    assert estimate.iterations <= 3


@given(st.integers(1, 5), SENSORS, st.integers(0, 2), SEEDS)
@settings(max_examples=20)
def test_a_state_known_at_the_start(n, widths, rank, seed):
    """Zero prior variance, with and without process noise."""
    case = LinearCase(n, widths, seed, rank=min(rank, n), sure=True)
    estimate = pz.FactorGraph(cross_covariances=True).estimate(case.problem, case.tracking)
    oracle = dense.smooth(*case.chain)
    assert estimate.success, estimate.message
    assert_allclose(estimate.mean, oracle.mean, rtol=0, atol=1e-8)
    assert_allclose(estimate.covariance, oracle.covariance, rtol=0, atol=1e-8)
    assert estimate.mean[0, 0] == case.m[0]


@pytest.mark.parametrize("epochs", [20, 30, 40, 60])
def test_a_system_that_forgets_its_start(epochs):
    """Damped, without process noise, in axes that mix fast and slow: predicted covariances become singular to rounding."""
    c, s = np.cos(0.7), np.sin(0.7)
    V = np.array([[c, -s], [s, c]])
    A, H, P, z = V @ np.diag([0.5, 0.95]) @ V.T, np.array([[1.0, -0.4]]), np.eye(2), np.sin(np.arange(epochs))[:, None]
    problem = linear(A, [H], [np.array([[0.01]])], np.zeros((2, 2)), pz.Gaussian(np.zeros(2), P))
    estimate = pz.FactorGraph(cross_covariances=True).estimate(problem, pz.Tracking(np.arange(float(epochs)), z))
    seen = [dense.Seen(v, H, np.array([[0.01]])) for v in z]
    assert_graph_is(estimate, dense.smooth(np.zeros(2), P, [A] * (epochs - 1), [np.zeros((2, 2))] * (epochs - 1), seen), 1e-10)


@given(SIZES, SENSORS, st.integers(0, 9), SEEDS, st.integers(1, 8))
@settings(max_examples=40)
def test_window_is_the_filter_at_every_step(n, widths, rank, seed, lag):
    """In real time the length of the window makes no difference."""
    case = LinearCase(n, widths, seed, rank=rank if rank < n else None)
    window = pz.SlidingWindow(lag).estimate(case.problem, case.tracking)
    ekf = pz.ExtendedKalmanFilter().estimate(case.problem, case.tracking)
    assert window.success, window.message
    assert_same_estimate(window, ekf, 1e-7)
    assert_allclose(window.innovations, ekf.innovations, rtol=0, atol=1e-7)
    assert_allclose(window.innovation_covariances, ekf.innovation_covariances, rtol=1e-7, atol=1e-9)


@given(SIZES, SENSORS, st.integers(0, 9), SEEDS, st.integers(1, 8), st.integers(1, 3))
@settings(max_examples=30)
def test_delayed_states_are_the_fixed_lag_smoother(n, widths, rank, seed, lag, iterations):
    case = LinearCase(n, widths, seed, rank=rank if rank < n else None)
    estimator = pz.SlidingWindow(lag, iterations)
    delayed = estimator.estimate(case.problem, case.tracking).delayed
    mean, covariance = dense.fixed_lag(*case.chain, [max(k - lag + 1, 0) for k in range(case.epochs)])
    assert_same_estimate(delayed, SimpleNamespace(mean=mean, covariance=covariance), 1e-7)


@given(st.integers(1, 6), SENSORS, SEEDS, st.floats(0.0, 5.0))
@settings(max_examples=30)
def test_window_in_seconds_at_irregular_times(n, widths, seed, lag_seconds):
    """Several states may leave at one epoch, or none: each is then as the last window that held it saw it."""
    case = LinearCase(n, widths, seed, epochs=8)
    rng = np.random.default_rng(seed)
    epoch = np.cumsum(rng.uniform(0.1, 3.0, case.epochs))
    tracking = pz.Tracking(epoch[case.row_epoch], case.values, case.tracking.row_stations)
    estimate = pz.SlidingWindow(lag_seconds=lag_seconds).estimate(case.problem, tracking)
    first = [int(np.flatnonzero(epoch >= t - lag_seconds)[0]) for t in epoch]
    mean, covariance = dense.fixed_lag(*case.chain, first)
    assert_same_estimate(estimate.delayed, SimpleNamespace(mean=mean, covariance=covariance), 1e-7)
    assert_same_estimate(estimate, pz.ExtendedKalmanFilter().estimate(case.problem, tracking), 1e-7)


@pytest.mark.parametrize("epochs", [1, 2, 3])
@pytest.mark.parametrize("prior_time", [None, -0.4])
def test_few_epochs_and_a_prior_before_them(epochs, prior_time):
    """Continuous dynamics with integrated noise; the transition and noise of the oracle come from `predict`."""
    rng = np.random.default_rng(epochs)
    n, H, R = 3, rng.standard_normal((2, 3)), random_covariance(rng, 2)
    A, Q, P = random_stable(rng, n), random_covariance(rng, n, 1), random_covariance(rng, n)
    m, z, times = rng.standard_normal(n), rng.standard_normal((epochs, 2)), np.cumsum(rng.uniform(0.2, 1.0, epochs))
    problem = linear(A, [H], [R], Q, pz.Gaussian(m, P), discrete=False, per="second", prior_time=prior_time)
    tracking = pz.Tracking(times, z)
    nodes = times if prior_time is None else np.append(prior_time, times)
    steps = [pz.predict(problem, problem.prior, t, dt) for t, dt in zip(nodes, np.diff(nodes), strict=False)]
    seen = [None] * (len(nodes) - epochs) + [dense.Seen(v, H, R) for v in z]
    oracle = dense.smooth(m, P, [s.Phi for s in steps], [s.Q for s in steps], seen)
    skip = len(nodes) - epochs
    wanted = dense.Trajectory(oracle.mean[skip:], oracle.joint[skip:, :, skip:])
    estimate = pz.FactorGraph(cross_covariances=True).estimate(problem, tracking)
    assert_graph_is(estimate, wanted, 1e-9)
    window = pz.SlidingWindow(10).estimate(problem, tracking)
    assert_same_estimate(window.delayed, wanted, 1e-9)
    assert_same_estimate(window, pz.ExtendedKalmanFilter().estimate(problem, tracking), 1e-9)


@given(st.integers(1, 5), SEEDS)
@settings(max_examples=15)
def test_noise_per_second_at_irregular_times(n, seed):
    """A time step in the dynamics themselves, x[k+1] = (1 + a dt) x: every interval has its own transition and noise."""
    rng = np.random.default_rng(seed)
    states = [f"x{i}" for i in range(n)]
    A = random_stable(rng, n)
    rows = [f"x{i} + dt*(" + " + ".join(f"{float(A[i, j])!r}*x{j}" for j in range(n)) + ")" for i in range(n)]
    model = pz.Model(states, rows, [pz.Sensor("first", [states[0]])], discrete=True)
    Q, P, m = random_covariance(rng, n), random_covariance(rng, n), rng.standard_normal(n)
    noise = pz.ProcessNoise(Q, "second", "scaled")
    problem = pz.Problem(model, pz.Gaussian(m, P), noise, [pz.Station("here", "first", 0.5)])
    times = np.cumsum(rng.uniform(0.1, 2.0, 7))
    z = rng.standard_normal(7)
    z[3] = np.nan
    dt = np.diff(times)
    seen = [dense.Seen(np.array([v]), np.eye(n)[:1], np.array([[0.5]])) for v in z]
    oracle = dense.smooth(m, P, [np.eye(n) + h * A for h in dt], [Q * h for h in dt], seen)
    assert_graph_is(pz.FactorGraph(cross_covariances=True).estimate(problem, pz.Tracking(times, z)), oracle, 1e-8)
