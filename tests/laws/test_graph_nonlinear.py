"""The graph and the window on nonlinear problems: what they are equal to, and what holds at the solution."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import passes, spacecraft
from tests.laws.problems import MU_EARTH, assert_same_estimate, b612, satellite
from tests.references import dense_cost, textbook

NO_NOISE = (0.0, 0.0, 0.0, 0.0)


def bearings(epochs=150, seed=5, **changes):
    problem = satellite(**changes)
    tracking = pz.simulate(problem, np.arange(epochs) * 15.0, np.random.default_rng(seed))
    values = tracking.values.copy()
    values[epochs // 3 : epochs // 3 + 5] = np.nan  # a gap
    return problem, pz.Tracking(tracking.row_times, values, truth=tracking.truth)


def ranges(Q=(0.0, 0.0, 0.01, 0.01), seed=1, epochs=100):
    problem = b612(Q)
    return problem, pz.simulate(problem, np.arange(epochs) * 0.1, np.random.default_rng(seed))


def radar(epochs=12, **changes):
    problem = spacecraft(**changes)
    return problem, passes(problem, epochs)


def radar_before():
    return radar(prior_time=-20.0)


def ranges_without_noise():
    return ranges(NO_NOISE)


CASES = {"satellite": bearings, "b612": ranges, "b612, Q = 0": ranges_without_noise}
# the problem with three stations runs uncompiled in the fast tests, on few epochs: it costs most to compile
UNCOMPILED = {"three stations": radar, "prior before the first epoch": radar_before}


@pytest.fixture(params=CASES | UNCOMPILED)
def case(request, monkeypatch):
    """Problem and tracking by name."""
    if request.param in UNCOMPILED:
        monkeypatch.setenv("PIAZZI_JIT", "0")
    return (CASES | UNCOMPILED)[request.param]()


def test_window_of_one_state_and_one_iteration_is_the_filter(case):
    """At every step; several rows an epoch, missing components, correlated R and an estimated constant among the cases."""
    problem, tracking = case
    window = pz.SlidingWindow(lag=1, iterations=1).estimate(problem, tracking)
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert window.success, window.message
    assert_same_estimate(window, ekf, 1e-8)
    assert_same_estimate(window.delayed, ekf, 1e-8)
    assert_allclose(window.innovations, ekf.innovations, rtol=1e-7, atol=1e-10)
    assert_allclose(window.innovation_covariances, ekf.innovation_covariances, rtol=1e-8)


def test_window_of_all_states_iterated_is_the_graph(case):
    """The newest state of the last window, and every state of it."""
    problem, tracking = case
    window = pz.SlidingWindow(lag=len(tracking.times), iterations=6).estimate(problem, tracking)
    graph = pz.FactorGraph(tolerance=1e-9).estimate(problem, tracking)
    assert graph.success, graph.message
    # a prior before the first epoch is carried to it once, where the graph keeps relinearising it
    tolerance = 1e-6 if problem.prior_time is None else 1e-3
    assert_same_estimate(window.delayed, graph, tolerance)
    assert (window.mean[-1] == window.delayed.mean[-1]).all()


@pytest.mark.parametrize("start", ["ekf", "prior", "window"])
def test_cost_never_rises_after_the_first_step(case, start):
    """Up to rounding.  Where noise is singular, what does not rise is the cost with the price of the defect."""
    problem, tracking = case
    estimate = pz.FactorGraph(start).estimate(problem, tracking)
    assert estimate.success, estimate.message
    costs = np.array(estimate.details["costs"])
    if np.linalg.matrix_rank(problem.process_noise.covariance) == problem.model.n:
        assert (np.diff(costs[1:]) <= 1e-9 * costs[2:]).all(), costs
        assert costs[-1] < costs[0]
    assert estimate.details["cost"] == costs[-1]
    assert estimate.details["defect"] <= 1e-9
    assert estimate.details["gradient_norm"] <= 1e-4


def test_gradient_is_zero_at_the_solution():
    """With a cost in plain NumPy, its derivative by differences; at the filter's estimate it is not."""
    problem, tracking = bearings(epochs=40)
    estimate = pz.FactorGraph(tolerance=1e-10).estimate(problem, tracking)
    assert estimate.success, estimate.message
    step, R = textbook.taylor(MU_EARTH, 15), problem.stations[0].noise
    Q = np.diag([0.01, 0.01, 0.0025, 0.0025]) * 15.0

    def measured(x, k):
        nu, _, _ = textbook.stack(x, [textbook.bearing(tracking.values[k], R)])
        return nu[~np.isnan(nu)] / np.sqrt(R[0, 0])

    def residuals(flat):
        return dense_cost.trajectory_residuals(
            flat.reshape(-1, 4), problem.mean, problem.covariance, lambda x, k: step(x, 0.0, 15.0)[0], lambda k: Q, measured
        )

    steps = np.tile([1.0, 1.0, 0.5, 0.5], 40)
    r = residuals(estimate.mean.ravel())
    assert_allclose(0.5 * r @ r, estimate.details["cost"], rtol=1e-7)
    assert np.abs(dense_cost.scaled_gradient(residuals, estimate.mean.ravel(), steps)).max() < 1e-6
    ekf = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert np.abs(dense_cost.scaled_gradient(residuals, ekf.mean.ravel(), steps)).max() > 1.0


@pytest.mark.parametrize("q", [0.01, 0.0], ids=["singular Q", "zero Q"])
def test_gradient_of_the_lagrangian_is_zero_at_the_solution(q):
    """Where there is no noise the dynamics hold, and no change of what drives the trajectory lowers the cost."""
    Q = np.diag([0.0, 0.0, q, q])
    problem, tracking = ranges(tuple(np.diag(Q)))
    estimate = pz.FactorGraph(tolerance=1e-10).estimate(problem, tracking)
    assert estimate.success, estimate.message

    def step(x, k):
        h = 0.01
        for _ in range(10):
            k1 = rates(x)
            k2 = rates(x + h / 2 * k1)
            k3 = rates(x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rates(x + h * k3))
        return x

    def measured(x, k):
        return (tracking.values[k] - np.hypot(x[:, 0] - 10.0, x[:, 1])[:, None]) / 0.1

    noises = [Q] * 99
    residuals, unknowns = dense_cost.driven_residuals(problem.mean, problem.covariance, step, noises, measured)
    u = dense_cost.driving_noise(estimate.mean, problem.mean, problem.covariance, step, noises)
    x = estimate.mean[0]
    for k in range(99):
        x = step(estimate.mean[k][None], k)[0]
        assert_allclose(estimate.mean[k + 1][:2], x[:2], rtol=0, atol=1e-11)
    r = residuals(u)[0]
    assert_allclose(0.5 * r @ r, estimate.details["cost"], rtol=1e-7)
    h = 1e-5
    both = residuals(np.concatenate([u + h * np.eye(unknowns), u - h * np.eye(unknowns)]))
    J = (both[:unknowns] - both[unknowns:]) / (2 * h)
    assert np.abs(J @ r / np.linalg.norm(J, axis=1)).max() < 1e-6


def rates(x):
    """Gravity of the toy planet, for many states at once."""
    r3 = np.hypot(x[:, 0], x[:, 1]) ** 3
    return np.stack([x[:, 2], x[:, 3], -1000.0 * x[:, 0] / r3, -1000.0 * x[:, 1] / r3], axis=1)


def assert_relative(a, b, tolerance):
    """Means as a fraction of the largest value of each state."""
    assert (np.abs(a.mean - b.mean) / np.abs(b.mean).max(axis=0)).max() <= tolerance


@pytest.mark.parametrize("problem", [bearings, ranges, pytest.param(radar, marks=pytest.mark.slow)])
def test_uncompiled_equals_compiled(problem, monkeypatch):
    problem, tracking = problem(epochs=25)
    estimators = [pz.FactorGraph(tolerance=1e-9), pz.SlidingWindow(5, 2)]
    compiled = [e.estimate(problem, tracking) for e in estimators]
    monkeypatch.setenv("PIAZZI_JIT", "0")
    for estimator, one in zip(estimators, compiled, strict=True):
        plain = estimator.estimate(problem, tracking)
        assert_same_estimate(plain, one, 1e-7)
        assert_relative(plain, one, 1e-10)
