"""The sliding window: the founding figures, how its length is said, and what happens where there is no answer."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.estimate.test_factor_graph import recording, rmse
from tests.laws.problems import assert_same_estimate, b612, linear, satellite
from tests.references import dense


@pytest.mark.parametrize(
    ("lag", "view", "figures"),
    [
        (1, "realtime", [13985.43, 6.72672]),
        (10, "realtime", [13915.0, None]),
        (100, "realtime", [13686.24, 5.554]),
        (100, "delayed", [15680.72, 4.868]),
    ],
)
def test_founding_recording(data_dir, lag, view, figures):
    """Errors of the last half of the run, from an independent program; a window of one is the filter."""
    problem, tracking = recording(data_dir)
    estimate = pz.SlidingWindow(lag).estimate(problem, tracking)
    assert estimate.success, estimate.message
    assert estimate.view == "realtime"
    assert estimate.delayed.view == "delayed"
    found = rmse(estimate if view == "realtime" else estimate.delayed, tracking, first=len(tracking.times) // 2)
    for value, wanted in zip(found, figures, strict=True):
        assert wanted is None or abs(value - wanted) <= 1e-3 * wanted


def test_length_in_seconds_is_length_in_states_at_regular_times():
    """Also where times and seconds are not numbers of the binary system, late in a long run."""
    problem, count = b612(), 40
    for offset in (0.0, 1e5):
        tracking = pz.simulate(problem, offset + np.arange(count) * 0.1, np.random.default_rng(4))
        states, seconds = pz.SlidingWindow(8), pz.SlidingWindow(lag_seconds=0.7)
        assert (states.first_states(tracking.times) == seconds.first_states(tracking.times)).all()
        assert_same_estimate(seconds.estimate(problem, tracking), states.estimate(problem, tracking), 1e-12)


def test_window_of_no_seconds_is_the_filter():
    problem = b612()
    tracking = pz.simulate(problem, np.arange(30) * 0.1, np.random.default_rng(4))
    window = pz.SlidingWindow(lag_seconds=0.0).estimate(problem, tracking)
    assert_same_estimate(window, pz.ExtendedKalmanFilter().estimate(problem, tracking), 1e-9)


@pytest.mark.parametrize("iterations", [1, 3])
def test_window_longer_than_the_run_is_one_of_all_states(iterations):
    problem = b612()
    tracking = pz.simulate(problem, np.arange(25) * 0.1, np.random.default_rng(4))
    exact, longer = (pz.SlidingWindow(lag, iterations).estimate(problem, tracking) for lag in (25, 1000))
    assert (exact.mean == longer.mean).all()
    assert (exact.delayed.mean == longer.delayed.mean).all()
    assert (exact.delayed.covariance == longer.delayed.covariance).all()


def test_one_epoch():
    problem = b612()
    tracking = pz.simulate(problem, [0.0], np.random.default_rng(4))
    window = pz.SlidingWindow(10).estimate(problem, tracking)
    assert_same_estimate(window, pz.ExtendedKalmanFilter().estimate(problem, tracking), 1e-12)
    assert_same_estimate(window.delayed, window, 1e-12)


def test_newest_state_when_nothing_is_measured_is_a_prediction():
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(30) * 15.0, np.random.default_rng(4))
    values = tracking.values.copy()
    values[-1] = np.nan
    window = pz.SlidingWindow(10, iterations=6).estimate(problem, pz.Tracking(tracking.row_times, values))
    x, Phi = problem.step(window.delayed.mean[-2], 15.0)
    assert_allclose(window.mean[-1], x, rtol=1e-10)
    P = Phi @ window.delayed.covariance[-2] @ Phi.T + problem.process_noise.covariance * 15.0
    sigma = np.sqrt(np.diag(P))
    assert_allclose(window.covariance[-1] / np.outer(sigma, sigma), P / np.outer(sigma, sigma), rtol=0, atol=1e-9)


def test_covariances_are_symmetric_and_semidefinite():
    problem = satellite()
    tracking = pz.simulate(problem, np.arange(200) * 15.0, np.random.default_rng(4))
    window = pz.SlidingWindow(20).estimate(problem, tracking)
    for P in (window.covariance, window.delayed.covariance):
        assert (P.transpose(0, 2, 1) == P).all()
    assert window.success, window.message
    assert window.delayed.success, window.delayed.message


def test_wide_prior_leaves_the_delayed_covariances_their_digits(monkeypatch):
    """The oldest state's covariance goes from the prior's to that of the window: against dense least squares."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    A, H, R = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]]), np.array([[1e-2]])
    Q, P, z = 1e-4 * np.eye(2), np.diag([1e4, 1e4]), np.random.default_rng(1).standard_normal((12, 1))
    problem = linear(A, [H], [R], Q, pz.Gaussian([0.0, 0.0], P))
    delayed = pz.SlidingWindow(5).estimate(problem, pz.Tracking(np.arange(12.0), z)).delayed
    seen = [dense.Seen(v, H, R) for v in z]
    mean, covariance = dense.fixed_lag(np.zeros(2), P, [A] * 11, [Q] * 11, seen, [max(k - 4, 0) for k in range(12)])
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert (np.abs(delayed.mean - mean) / sigma).max() <= 1e-7
    assert (np.abs(delayed.covariance - covariance) / (sigma[:, :, None] * sigma[:, None, :])).max() <= 1e-7


@pytest.mark.parametrize("loss", [None, pz.Huber(1e6)])
def test_a_prior_of_any_width_leaves_the_delayed_covariance_what_its_own_measurements_say(monkeypatch, loss):
    """A mean of five: the oldest state of a window knows no less than its own measurement."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x"], ["0"], [pz.Sensor("place", ["x"])])
    problem = pz.Problem(model, pz.Gaussian([0.0], [1e20]), None, [pz.Station("here", "place", 1.0)])
    delayed = pz.SlidingWindow(5, loss=loss).estimate(problem, pz.Tracking(np.arange(12.0), np.ones(12))).delayed
    assert_allclose(delayed.covariance[:5, 0, 0], 1 / np.arange(5.0, 10.0), rtol=1e-9)


def test_what_nobody_sees_under_a_huge_prior_is_named_by_the_delayed_estimate(monkeypatch):
    """In the words of the full graph, however few states a window keeps; in real time everything begins open."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["seen", "unseen"], ["0", "0"], [pz.Sensor("first", ["seen"])])
    tracking = pz.Tracking(np.arange(12.0), np.linspace(1.0, 3.0, 12))
    for variance, told in ((1e30, True), (1e2, False)):
        problem = pz.Problem(model, pz.Gaussian([0.0, 5.0], [1e30, variance]), None, [pz.Station("here", "first", 1.0)])
        graph = pz.FactorGraph().estimate(problem, tracking)
        assert ("do not determine 'unseen'" in graph.message) == told
        for lag in (1, 3, 12, 100):
            window = pz.SlidingWindow(lag).estimate(problem, tracking)
            assert window.delayed.message == graph.message
            assert window.success


def test_what_only_later_measurements_tell_is_no_open_question(monkeypatch):
    """One place says nothing about the speed; what leaves a window of one state knows no more than that."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("place", ["x"])])
    problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], [1.0, 1e16]), None, [pz.Station("here", "place", 1.0)])
    delayed = pz.SlidingWindow(1).estimate(problem, pz.Tracking(np.arange(8.0), np.arange(8.0))).delayed
    assert delayed.covariance[0, 1, 1] == 1e16
    assert delayed.success, delayed.message


def test_window_that_leaves_the_numbers_says_when(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["quiet", "wild"], ["-quiet", "wild**3"], [pz.Sensor("both", ["quiet + wild"])])
    problem = pz.Problem(model, pz.Gaussian([1.0, 3.0], [1.0, 1e-4]), None, [pz.Station("here", "both", 1.0)])
    window = pz.SlidingWindow(3).estimate(problem, pz.Tracking(np.arange(8) * 0.05, np.ones(8)))
    assert not window.success
    assert "not finite from epoch" in window.message
    assert "t = " in window.message
    assert not window.delayed.success


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"lag": 0}, "lag is 0"),
        ({"lag": 2.5}, "lag is 2.5"),
        ({"iterations": 0}, "iterations is 0"),
        ({"lag_seconds": -1.0}, "lag_seconds is -1.0"),
        ({"lag_seconds": float("nan")}, "lag_seconds is nan"),
        ({"lag_seconds": float("inf")}, "lag_seconds is inf"),
    ],
)
def test_settings_are_checked(settings, told):
    with pytest.raises(ValueError, match=told):
        pz.SlidingWindow(**settings)
