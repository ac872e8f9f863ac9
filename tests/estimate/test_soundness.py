"""What cannot be used says so: live estimates and predictions as whole runs do, and no checkpoint is made of it."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.estimate.soundness import defect, semidefinite

LIVE = {
    "ekf": pz.ExtendedKalmanFilter(),
    "gate": pz.ExtendedKalmanFilter(gate=0.999),
    "ukf": pz.UnscentedKalmanFilter(),
    "srekf": pz.SquareRootKalmanFilter(),
    "window": pz.SlidingWindow(lag=3),
}


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def cube():
    """A state that reaches infinity in half a second."""
    model = pz.Model(["x"], ["x**3"], [pz.Sensor("s", ["x"])])
    return pz.Problem(model, pz.Gaussian([1], [1]), stations=[pz.Station("a", "s", 1)])


def usable(mean, covariance):
    """By its definition: all is finite, and no direction has a negative variance, up to rounding in units of sigma."""
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()) or (np.diag(covariance) < 0).any():
        return False
    sigma = np.sqrt(np.diag(covariance))
    unit = np.where(sigma > 0, sigma, 1.0)
    return bool(np.linalg.eigvalsh(covariance / np.outer(unit, unit)).min() > -1e-6)


@pytest.mark.parametrize("name", LIVE)
def test_a_live_estimate_says_from_when_on_it_cannot_be_used(name):
    live = LIVE[name].start(cube())
    assert live.success
    for t in range(4):
        live.update("a", 1.0 + t, float(t))
        assert live.success == (live.message == "") == usable(live.mean, live.covariance)
    assert live.message == "the estimate is not finite at t = 3 s (x)"
    with pytest.raises(ValueError, match=r"the estimate is not finite at t = 3 s \(x\)"):
        live.checkpoint()
    whole = LIVE[name].estimate(cube(), pz.Tracking([0.0, 1.0, 2.0, 3.0], [1.0, 2.0, 3.0, 4.0]))
    assert not whole.success


@pytest.mark.parametrize("name", LIVE)
def test_a_prediction_that_cannot_be_used_says_so(name):
    live = LIVE[name].start(cube())
    live.update("a", 1.0, 0.0)
    for t in (1.0, 2.0, 3.0):
        live.predict(t)
    assert not live.success
    assert "at t = 3 s" in live.message


@pytest.mark.parametrize("name", LIVE)
@pytest.mark.parametrize("gap", [1e2, 1e4, 1e6, 1e9])
def test_success_means_that_it_can_be_used_and_kept(name, gap):
    """After a jump in time that the linearisation cannot follow: a success is usable, and its checkpoint can be read again."""
    problem, tracking = pz.load("b612-range")
    live = LIVE[name].start(problem)
    for k in range(40):
        live.update("radar", tracking.values[k], tracking.times[k] + (gap if k >= 20 else 0.0))
        if live.success:
            assert usable(live.mean, live.covariance)
            LIVE[name].start(problem).restore(live.checkpoint())
        else:
            with pytest.raises(ValueError):
                live.checkpoint()


def test_a_negative_variance_is_no_success_and_no_sigma():
    """Of a live estimate, wherever it is; and of a prediction, whose sigma was zero there."""
    live = pz.SlidingWindow(lag=3).start(cube())
    live._P[0, 0] = -0.3
    assert live.message == "the covariance is not semidefinite"
    forecast = pz.Forecast(cube(), 0.0, np.array([1.0, 2.0]), np.ones((2, 1)), np.array([[[1.0]], [[-0.3]]]), np.ones((2, 1)))
    assert forecast.message == "the covariance is not semidefinite at t = 2 s"
    assert not forecast.success
    np.testing.assert_array_equal(forecast.sigma, [[1.0], [np.nan]])


def test_a_forecast_that_overflows_says_where():
    estimate = pz.ExtendedKalmanFilter().estimate(cube(), pz.Tracking([0.0], [1.0]))
    assert estimate.success
    assert estimate.predict([0.0]).success
    forecast = estimate.predict([0.0, 1.0, 9.0, 10.0])
    assert not forecast.success
    k = int(np.argmin(np.isfinite(forecast.mean[:, 0])))
    assert forecast.message.startswith(f"the prediction is not finite at t = {forecast.times[k]:g} s")


def test_singular_covariances_can_be_used():
    """The quick way, by Cholesky's factor, does not decide: what has none is looked at with care."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        root = rng.standard_normal((4, 2)) * 10.0 ** rng.uniform(-8, 8, (4, 1))
        P = root @ root.T
        assert defect(np.zeros((1, 4)), ((P + P.T) / 2)[None], "abcd", lambda k: "here") == ""
    bad = np.diag([1.0, 1.0, 1.0, -1e-3])
    assert defect(np.zeros((2, 4)), np.array([np.eye(4), bad]), "abcd", lambda k: f"at {k}").endswith("at 1")


@pytest.mark.parametrize("sigma", [1.0, 1e-100, 1e150])
@pytest.mark.parametrize("pair", [2e-10, 1e-8, 1e-6])
def test_a_covariance_is_semidefinite_by_the_least_eigenvalue_of_its_correlations(sigma, pair):
    """Two values correlated by more than one, and two that are one value but differ by `pair` in what they say of a third."""
    scale = np.array([sigma, 1.0, 1.0])
    beyond = np.eye(3)
    beyond[0, 1] = beyond[1, 0] = 1 + pair
    differing = np.eye(3)
    differing[0, 1] = differing[1, 0] = 1.0
    differing[0, 2] = differing[2, 0] = 2 * np.sqrt(pair)
    for correlations in (beyond, differing):
        least = np.linalg.eigvalsh(correlations)[0]
        found = semidefinite((correlations * np.outer(scale, scale))[None])[0]
        assert found == (least >= -1e-9 * 3), least


def test_what_is_known_for_certain_is_correlated_with_nothing():
    certain = np.diag([0.0, 1.0])
    assert semidefinite(certain[None])[0]
    certain[0, 1] = certain[1, 0] = 1e-6
    assert not semidefinite(certain[None])[0]
    assert not semidefinite(np.diag([-1e-300, 1.0])[None])[0]


def test_variances_without_digits_are_judged_by_what_is_left_of_them():
    """A variance of two units in the last place there is; beside it a covariance that it cannot carry."""
    tiny, beside = 2 * 5e-324, 3.2e-162
    P = np.array([[1.0, beside], [beside, tiny]])
    assert beside > 1.005 * np.sqrt(tiny)
    assert not semidefinite(P[None])[0]
    assert defect(np.zeros((1, 2)), P[None], ["x", "y"], lambda k: "here") == "the covariance is not semidefinite here"
