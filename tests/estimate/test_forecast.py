"""An estimate carried beyond its last epoch: closed forms, and the filter that goes on without measurements."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.problems import b612, satellite
from tests.solvers import orbits


def line(q=0.3, **changes):
    """A point on a line with white acceleration, its place measured."""
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("place", ["x"])])
    numbers = {
        "prior": pz.Gaussian([0.0, 1.0], np.eye(2)),
        "process_noise": pz.ProcessNoise([0.0, q]),
        "stations": pz.Station("s", "place", 0.1),
    }
    return pz.Problem(model, **(numbers | changes))


@pytest.fixture
def uncompiled(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


@pytest.fixture
def estimate(uncompiled):
    problem = line()
    return pz.ExtendedKalmanFilter().estimate(problem, pz.simulate(problem, np.arange(5.0), np.random.default_rng(0)))


def test_closed_form_of_white_acceleration(estimate):
    """P + dt-terms + q [[dt^3/3, dt^2/2], [dt^2/2, dt]], whatever the parts."""
    ahead = np.array([0.0, 0.5, 7.3, 100.0])
    forecast = estimate.predict(4.0 + ahead)
    for dt, mean, P in zip(ahead, forecast.mean, forecast.covariance, strict=True):
        F = np.array([[1.0, dt], [0.0, 1.0]])
        Q = 0.3 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        assert_allclose(mean, F @ estimate.mean[-1], rtol=1e-12)
        assert_allclose(P, F @ estimate.covariance[-1] @ F.T + Q, rtol=1e-9)
    last = np.sqrt(np.diag(estimate.covariance[-1]))
    assert_array_equal(forecast.growth[0], [1.0, 1.0])
    assert_allclose(forecast.growth, forecast.sigma / last)
    assert (np.diff(forecast.growth, axis=0) > 0).all()
    assert forecast.start == 4.0
    assert forecast.names == ("x", "v")


@pytest.mark.parametrize(
    ("problem", "step", "epochs"), [(satellite(), 15.0, 200), (b612(), 0.1, 100)], ids=["satellite, Q dt", "b612, Q per step"]
)
def test_it_is_the_filter_without_measurements(problem, step, epochs):
    """A tracking that goes on at the same pace with nothing but missing values gives the same."""
    tracking = pz.simulate(problem, np.arange(epochs) * step, np.random.default_rng(1))
    more = np.arange(epochs, epochs + 40) * step
    longer = pz.Tracking(np.append(tracking.times, more), np.append(tracking.values[:, 0], np.full(40, np.nan)))
    ekf = pz.ExtendedKalmanFilter()
    short, whole = ekf.estimate(problem, tracking), ekf.estimate(problem, longer)
    forecast = short.predict(more[[3, 20, 39]])
    unit = np.sqrt(np.diagonal(whole.covariance[-1]))
    for k, mean, P in zip((3, 20, 39), forecast.mean, forecast.covariance, strict=True):
        assert_allclose(mean / unit, whole.mean[epochs + k] / unit, rtol=0, atol=1e-9)
        assert_allclose(P / np.outer(unit, unit), whole.covariance[epochs + k] / np.outer(unit, unit), rtol=0, atol=1e-9)
    assert_allclose(short.predict(more[39]).mean[0] / unit, forecast.mean[2] / unit, rtol=0, atol=1e-9)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("integrator", [pz.RungeKutta4(6), pz.Kepler(), pz.DormandPrince(rtol=1e-10)])
def test_manoeuvres_constants_and_orbit_axes_on_the_way(integrator):
    """One interval ahead it is `predict`, with the correlations of the constants; a manoeuvre after the last epoch is made."""
    noise = pz.ProcessNoise([0.1, 0.2, 1e-4, 4e-4], "second", "scaled", axes="orbit")
    burn = pz.Manoeuvre(137.0, [3.0, -2.0], [[0.04, 0.01], [0.01, 0.09]])
    numbers = {"process_noise": noise, "parameters": {"mu": pz.Gaussian(orbits.MU, 1e18)}, "manoeuvres": [burn]}
    problem = orbits.orbit(2, integrator, "estimated", **numbers)
    tracking = pz.simulate(problem, np.arange(3) * 60.0, np.random.default_rng(0))
    estimate = pz.FactorGraph().estimate(problem, tracking)
    forecast = estimate.predict([170.0])
    wanted = pz.predict(problem, pz.Gaussian(estimate.mean[-1], estimate.covariance[-1]), 120.0, 50.0)
    size = np.sqrt(np.diag(wanted.covariance))
    assert_allclose(forecast.mean[0] / size, wanted.mean / size, rtol=1e-11)
    assert_allclose(forecast.covariance[0] / np.outer(size, size), wanted.covariance / np.outer(size, size), atol=1e-9)
    assert abs(wanted.covariance[0, 4]) > 0
    assert forecast.growth[0, 4] == pytest.approx(1.0)  # a constant does not grow


@pytest.mark.usefixtures("uncompiled")
def test_a_model_that_is_a_step_takes_as_many():
    """x[k+1] = 2 x[k]: ten epochs ahead of a tracking with one a second."""
    problem = pz.Problem(
        pz.Model(["x"], ["2*x"], [pz.Sensor("s", ["x"])], discrete=True), pz.Gaussian(1.0, 1.0), None, pz.Station("s", "s", 1.0)
    )
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 1.0, 2.0], [1.0, 2.0, 4.0]))
    forecast = estimate.predict(12.0)
    assert_allclose(forecast.mean[0], 2.0**10 * estimate.mean[-1])
    assert_allclose(forecast.growth[0], 2.0**10)


@pytest.mark.usefixtures("uncompiled")
def test_values_that_are_known_do_not_grow():
    problem = line(q=0.0, prior=pz.Gaussian([0.0, 1.0], np.diag([1.0, 0.0])))
    forecast = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0], [0.1])).predict([0.0, 10.0])
    assert_array_equal(forecast.growth, np.ones((2, 2)))
    problem = line(prior=pz.Gaussian([0.0, 1.0], np.zeros((2, 2))))
    assert_array_equal(pz.Smoother().estimate(problem, pz.Tracking([0.0], [0.1])).predict(1.0).growth, [[np.inf, np.inf]])


@pytest.mark.usefixtures("uncompiled")
def test_a_considered_acceleration_goes_on_working():
    """Nothing of it is in the first state; after dt it has added sigma [dt^2/2, dt]."""
    model = pz.Model(["x", "v"], ["v", "b"], [pz.Sensor("place", ["x"])], [pz.Parameter("b", "considered")])
    station, parameters = pz.Station("s", "place", 0.1), {"b": pz.Gaussian(0.2, 0.09)}
    problem = pz.Problem(model, pz.Gaussian([0.0, 1.0], np.eye(2)), None, station, parameters)
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0], [0.1]))
    forecast = estimate.predict([2.0, 5.0])
    for dt, mean, P in zip((2.0, 5.0), forecast.mean, forecast.covariance, strict=True):
        F, b = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt**2 / 2, dt])
        assert_allclose(mean, F @ estimate.mean[-1] + 0.2 * b, rtol=1e-12)
        assert_allclose(P, F @ estimate.covariance[-1] @ F.T + 0.09 * np.outer(b, b), rtol=1e-9)


def test_it_prints_as_a_table(estimate):
    text = str(estimate.predict([5.0, 9.0]))
    assert len(text.splitlines()) == 3
    assert "growth" in text
    assert text.count("x\n") + text.endswith("x") == 2


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([], "no times to predict"),
        (
            [3.0],
            "time 0 is 3 s, before the last epoch at 4 s: for an estimate there, give the tracking a row of missing values",
        ),
        ([5.0, np.nan], "time 1 is nan; it must be finite"),
        ([6.0, 5.0], "times must not decrease: time 1 is 5 s, after 6 s"),
        (["soon"], "times is not made of real numbers"),
        (1e9, "1e\\+09 of the tracking's intervals ahead"),
    ],
)
def test_what_cannot_be_predicted_is_said(estimate, times, message):
    with pytest.raises(ValueError, match=message) as error:
        estimate.predict(times)
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("uncompiled")
def test_an_estimate_that_failed_is_not_carried_forward():
    model = pz.Model(["x"], ["-1"], [pz.Sensor("depth", ["log(x)"])])
    problem = pz.Problem(model, pz.Gaussian(1.0, 1e-6), None, pz.Station("buoy", "depth", 1e6), integrator=pz.RungeKutta4(1))
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 0.5, 2.0], [0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="nothing can be propagated: the estimate is not finite from epoch 2"):
        estimate.predict(3.0)
