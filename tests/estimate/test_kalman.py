"""The filter's building blocks and its results as values: shapes, order, what is missing, and honest failure."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.problems import b612, network, random_covariance, sigma


@pytest.fixture(scope="module", autouse=True)
def uncompiled():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        yield


SEEDS = st.integers(0, 2**32 - 1)
METHODS = st.sampled_from(["joint", "components"])


@given(SEEDS, METHODS, st.sampled_from(["north", "south", "east"]))
@settings(max_examples=15)
def test_predict_and_update_in_turn_are_the_filter(seed, method, station):
    rng = np.random.default_rng(seed)
    problem = network(rng, prior_time=0.0)
    times = np.cumsum(rng.uniform(0.1, 0.5, 5))
    tracking = pz.simulate(problem, times, rng, [station])
    values = np.where(rng.random(tracking.values.shape) < 0.3, np.nan, tracking.values)
    values[0, 0] = tracking.values[0, 0]
    tracking = pz.Tracking(tracking.row_times, values, tracking.row_stations)
    whole = pz.ExtendedKalmanFilter(method).estimate(problem, tracking)
    belief, before, m = problem.prior, 0.0, len(problem.stations[problem.station_index(station)].noise)
    for k, t in enumerate(times):
        predicted = pz.predict(problem, belief, before, t - before)
        belief, before = pz.update(problem, predicted, station, values[k, :m], t, method), t
        assert_allclose(belief.mean, whole.mean[k], rtol=1e-12, atol=1e-12)
        assert_allclose(belief.covariance, whole.covariance[k], rtol=1e-9, atol=1e-15)
        assert_allclose(belief.innovation, whole.innovations[k, :m], rtol=1e-9, atol=1e-12)
        assert_allclose(belief.innovation_covariance, whole.innovation_covariances[k, :m, :m], rtol=1e-9, atol=1e-15)


@given(SEEDS, METHODS)
@settings(max_examples=15)
def test_update_is_the_textbook_one(seed, method):
    rng = np.random.default_rng(seed)
    problem = network(rng)
    belief = pz.Gaussian(problem.mean + 0.1 * rng.standard_normal(4), 0.01 * random_covariance(rng, 4))
    z = problem.measure("south", belief.mean) + 0.01 * rng.standard_normal(3)
    updated = pz.update(problem, belief, "south", z, method=method)
    H, R, P = problem.measurement_jacobian("south", belief.mean), problem.stations[1].noise, np.asarray(belief.covariance)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    nu = z - problem.measure("south", belief.mean)
    assert_allclose(updated.mean, belief.mean + K @ nu, rtol=1e-9, atol=1e-12)
    assert_allclose(updated.covariance, (np.eye(4) - K @ H) @ P, rtol=1e-7, atol=1e-12)
    assert_allclose(updated.innovation, nu, rtol=1e-9, atol=1e-14)
    assert_allclose(updated.innovation_covariance, S, rtol=1e-9)


def test_beliefs_that_are_given_are_not_changed():
    problem = b612()
    mean, P = np.array([12.0, 0.0, 0.0, 9.0]), np.eye(4)
    belief = pz.Gaussian(mean, P)
    pz.predict(problem, belief, 0.0, 0.1)
    pz.update(problem, belief, "radar", 2.0)
    assert_array_equal(mean, [12.0, 0.0, 0.0, 9.0])
    assert_array_equal(P, np.eye(4))


def test_nothing_measured_nothing_learned():
    problem = b612()
    updated = pz.update(problem, problem.prior, "radar", np.nan)
    assert_array_equal(updated.mean, problem.mean)
    assert_allclose(updated.covariance, problem.covariance, rtol=1e-15)
    assert np.isnan(updated.innovation).all()
    assert np.isnan(updated.innovation_covariance).all()


def test_wrong_arguments_of_the_building_blocks():
    problem = b612()
    for call, match in [
        (lambda: pz.predict(problem, problem.prior, 0.0, 0.0), "dt is 0.0 s; a prediction goes forward"),
        (lambda: pz.predict(problem, problem.prior, 0.0, np.nan), "dt is nan s"),
        (lambda: pz.predict(problem, pz.Gaussian([1.0], np.eye(4)), 0.0, 1.0), "mean has 1 values; it needs 4"),
        (
            lambda: pz.predict(problem, pz.Gaussian(np.ones(4), -np.eye(4)), 0.0, 1.0),
            "covariance must be positive semidefinite",
        ),
        (lambda: pz.update(problem, problem.prior, "rader", 1.0), "unknown station 'rader'; did you mean 'radar'"),
        (lambda: pz.update(problem, problem.prior, "radar", [1.0, 2.0]), "must be 1 numbers, NaN where missing"),
        (lambda: pz.update(problem, problem.prior, "radar", np.inf), "measurement of station 'radar' is inf"),
        (lambda: pz.update(problem, problem.prior, "radar", "x"), "measurement of station 'radar' is not made of real numbers"),
    ]:
        with pytest.raises(ValueError, match=match) as error:
            call()
        assert "\n" not in str(error.value)


# ---- results ---------------------------------------------------------------------------------------------------------


def test_shapes_of_an_estimate():
    problem = network(np.random.default_rng(0))
    tracking = pz.simulate(problem, [0.0, 0.4, 0.9], np.random.default_rng(1))
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert estimate.mean.shape == (3, 4)
    assert estimate.covariance.shape == (3, 4, 4)
    assert estimate.innovations.shape == tracking.values.shape == (12, 3)
    assert estimate.innovation_covariances.shape == (12, 3, 3)
    assert_array_equal(estimate.times, [0.0, 0.4, 0.9])
    assert_array_equal(np.isnan(estimate.innovations), np.isnan(tracking.values))
    assert estimate.iterations == 3
    assert estimate.view == "realtime"
    assert estimate.seconds > 0
    assert estimate.success
    assert estimate.message == ""


def test_estimates_cannot_change():
    problem = b612()
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 0.1], [1.0, 1.2]))
    for array in (estimate.mean, estimate.covariance, estimate.innovations, estimate.innovation_covariances):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_estimated_constant_is_found():
    """A bias of the sensor, from a truth that has it; its doubt shrinks and never grows."""
    model = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("s", {"place": "x + bias", "speed": "v"})], {"bias": "estimated"})
    problem = pz.Problem(
        model, pz.Gaussian([1.0, 0.0], 0.01 * np.eye(2)), None, pz.Station("s", "s", 0.01 * np.eye(2)),
        {"bias": pz.Gaussian(0.0, 1.0)}, truth=pz.Truth(parameters={"bias": 0.8}),
    )  # fmt: skip
    tracking = pz.simulate(problem, np.arange(200) * 0.1, np.random.default_rng(0))
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    spread = sigma(estimate)[:, 2]
    assert (np.diff(spread) <= 1e-12).all()
    assert abs(estimate.mean[-1, 2] - 0.8) < 4 * spread[-1] < 0.1
    assert estimate.names == ("x", "v", "bias")


def test_failure_is_told_with_epoch_and_time():
    """The state falls into the centre of attraction: no exception, no success, and where it happened."""
    problem = b612(
        prior=pz.Gaussian([1e-6, 0.0, 0.0, 0.0], 1e-20 * np.eye(4)), process_noise=np.zeros(4), integrator=pz.Taylor(1)
    )
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking(np.arange(5) * 1e200, np.full(5, 10.0)))
    assert not estimate.success
    assert "the estimate is not finite from epoch" in estimate.message
    assert "t = " in estimate.message


def test_a_prediction_without_a_value_is_no_missing_measurement():
    """Where h has no value the filter must not pass over the measurement in silence."""
    model = pz.Model(["x"], ["-1"], [pz.Sensor("depth", ["log(x)"])])
    problem = pz.Problem(model, pz.Gaussian(1.0, 1e-6), None, pz.Station("buoy", "depth", 1e6), integrator=pz.RungeKutta4(1))
    tracking = pz.Tracking([0.0, 0.5, 2.0, 3.0], [0.0, 0.0, 0.0, np.nan])
    for method in ("joint", "components"):
        estimate = pz.ExtendedKalmanFilter(method).estimate(problem, tracking)
        assert not estimate.success
        assert estimate.message == "the estimate is not finite from epoch 2 (t = 2 s) (x)"
        assert np.isfinite(estimate.mean[:2]).all()


def test_angle_without_a_value_is_no_missing_measurement_either():
    model = pz.Model(["x"], ["1"], [pz.Sensor("a", ["asin(x)"], angles=["a"])])
    problem = pz.Problem(model, pz.Gaussian(0.0, 1e-6), None, pz.Station("s", "a", 1e6), integrator=pz.RungeKutta4(1))
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 0.5, 2.0], [0.0, 0.5, 0.1]))
    assert "from epoch 2" in estimate.message


def test_settings_are_values():
    assert pz.ExtendedKalmanFilter() == pz.ExtendedKalmanFilter("auto")
    assert len({pz.ExtendedKalmanFilter("joint"), pz.ExtendedKalmanFilter("joint"), pz.ExtendedKalmanFilter()}) == 2


def test_auto_takes_components_only_where_every_noise_is_diagonal():
    from piazzi.estimate.kalman import update_fragments

    assert "update_components" in update_fragments(b612(), "auto")
    assert "update_joint" in update_fragments(network(np.random.default_rng(0)), "auto")
    assert "update_components" in update_fragments(network(np.random.default_rng(0)), "components")
