"""Angles whose noise is on the sky: the same as noise that is larger by one over the cosine of the other angle."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz

SIGMA = 1e-3


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def problem(noise, on_sky=()):
    sensor = pz.Sensor("eye", {"az": "a", "el": "e"}, ("az", "el"), on_sky=on_sky)
    model = pz.Model(["a", "e"], {"a": "1e-3", "e": "1e-4"}, sensor)
    return pz.Problem(model, pz.Gaussian([3.13, 1.2], [1e-2, 1e-2]), [1e-9, 1e-9], pz.Station("eye", "eye", noise))


@pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(3)])
def test_estimates_are_those_of_the_noise_of_each_row(estimator):
    z = np.array([-3.14, 1.2031])
    R = np.array([[1.0, 0.3], [0.3, 1.0]]) * SIGMA**2
    scale = np.array([1.0 / np.cos(z[1]), 1.0])
    tracking = pz.Tracking([0.0, 5.0], [z, z])
    one = estimator.estimate(problem(R, {"az": "el"}), tracking)
    other = estimator.estimate(problem(R * np.outer(scale, scale)), tracking)
    assert_allclose(one.mean, other.mean, rtol=1e-12)
    assert_allclose(one.covariance, other.covariance, rtol=1e-9)


def test_where_the_other_angle_is_missing_its_prediction_serves():
    tracking = pz.Tracking([0.0], [[-3.14, np.nan]])
    one = pz.ExtendedKalmanFilter().estimate(problem([SIGMA**2] * 2, {"az": "el"}), tracking)
    other = pz.ExtendedKalmanFilter().estimate(problem([(SIGMA / np.cos(1.2)) ** 2, SIGMA**2]), tracking)
    assert_allclose(one.mean, other.mean, rtol=1e-12)


def test_simulated_noise_is_on_the_sky_and_estimates_are_honest():
    p = problem([SIGMA**2] * 2, {"az": "el"})
    assert not p.runs_in_ensemble
    tracking = pz.simulate(p, np.arange(0.0, 400.0), np.random.default_rng(3))
    off = tracking.values - tracking.truth
    off = (off + np.pi) % (2 * np.pi) - np.pi
    spread = (off * np.stack([np.cos(tracking.truth[:, 1]), np.ones(400)], -1) / SIGMA).std(axis=0)
    assert_allclose(spread, 1.0, atol=0.12)  # 3.4 sigma of 400
    for estimator in (pz.UnscentedKalmanFilter(), pz.ExtendedKalmanFilter()):
        found = estimator.estimate(p, tracking)
        sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        assert 0.5 < np.mean(((found.mean - tracking.truth) / sigma)[50:] ** 2) < 2.0  # one run, correlated over some 40 epochs


def test_only_angles_are_on_the_sky():
    with pytest.raises(ValueError, match="on_sky names 'az', which is not among its angles"):
        pz.Sensor("eye", {"az": "a", "el": "e"}, on_sky={"az": "el"})
