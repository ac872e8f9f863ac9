"""First-order Gauss-Markov accelerations as further states."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.solvers import orbits

pytestmark = pytest.mark.usefixtures("uncompiled")

SIGMA, TAU = 2e-3, 400.0


def disturbed(**changes) -> pz.Problem:
    return pz.with_gauss_markov(orbits.orbit(2, pz.RungeKutta4(20), **changes), SIGMA, TAU)


def test_the_model_says_what_was_added():
    model = disturbed().model
    assert model.states == ("x", "y", "vx", "vy", "gm_vx", "gm_vy")
    assert model.dynamics[2].endswith(" + gm_vx")
    assert model.dynamics[4] == "-gm_vx/tau"
    assert "tau" in model.parameter_names
    assert dict(model.groups)["gauss_markov"] == ("gm_vx", "gm_vy")


def test_units_are_those_of_rates():
    """Written as everywhere: a power of seconds, never one division after the other."""
    for unit, rate in {"m/s": "m/s^2", "m/s^2": "m/s^3", "1/s": "1/s^2", "m": "m/s", "rad": "rad/s", "": ""}.items():
        model = pz.Model(["v"], ["0"], [pz.Sensor("s", ["v"])], units={"v": unit} if unit else {})
        problem = pz.Problem(model, pz.Gaussian([0], [1]), stations=[pz.Station("a", "s", 1.0)])
        assert pz.with_gauss_markov(problem, SIGMA, TAU, ["v"]).model.unit("gm_v") == rate


def test_rates_are_those_of_before_plus_the_disturbance():
    problem = disturbed()
    x = orbits.state(2, 0.1)
    plain = orbits.orbit(2, pz.RungeKutta4(20)).dynamics(x)
    rates = problem.dynamics([*x, 1e-3, -2e-3])
    assert_allclose(rates, [*plain[:2], plain[2] + 1e-3, plain[3] - 2e-3, -1e-3 / TAU, 2e-3 / TAU], rtol=1e-14)


def test_the_process_is_stationary_with_its_sigma_and_forgets_with_its_time_constant():
    """Variance sigma^2 at all times, correlation exp(-dt / tau)."""
    problem = disturbed()
    predicted = pz.predict(problem, problem.prior, 0.0, 300.0)
    assert_allclose(np.diag(predicted.covariance)[4:], SIGMA**2, rtol=1e-6)
    assert_allclose(np.diag(predicted.Phi)[4:], np.exp(-300.0 / TAU), rtol=1e-7)


def test_what_it_does_to_the_velocity_is_the_textbook_integral():
    """Far from any mass: Var(v) after t is 2 sigma^2 tau^2 (t/tau - 1 + exp(-t/tau)), the integrated process of Ornstein."""
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("s", ["x"])], groups={"velocity": ["v"]})
    problem = pz.Problem(
        model, pz.Gaussian([0, 0], np.zeros((2, 2))), stations=[pz.Station("a", "s", 1.0)], integrator=pz.RungeKutta4(50)
    )
    problem = pz.with_gauss_markov(problem, SIGMA, TAU)
    predicted = pz.predict(problem, problem.prior, 0.0, 500.0)
    u = 500.0 / TAU
    assert_allclose(predicted.covariance[1, 1], 2 * (SIGMA * TAU) ** 2 * (u - 1 + np.exp(-u)), rtol=1e-6)


def test_simulated_accelerations_are_such_a_process():
    model = pz.Model(["v"], ["0"], [pz.Sensor("s", ["v"])])
    problem = pz.Problem(model, pz.Gaussian([0], [1]), stations=[pz.Station("a", "s", 1.0)], integrator=pz.RungeKutta4(1))
    problem = pz.with_gauss_markov(problem, SIGMA, TAU, ["v"])
    a = pz.simulate(problem, np.arange(4000) * 40.0, np.random.default_rng(0)).truth[:, 1]
    assert_allclose(a.std(), SIGMA, rtol=0.15)
    assert_allclose((a[1:] * a[:-1]).mean() / (a**2).mean(), np.exp(-40.0 / TAU), rtol=0.03)


def test_the_filter_sees_the_disturbance():
    problem = disturbed(stations=[pz.Station("centre", "range", 1.0)])
    tracking = pz.simulate(problem, np.arange(80) * 20.0, np.random.default_rng(3))
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert estimate.success, estimate.message
    error = estimate.mean - tracking.truth
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(estimate.covariance), error)
    assert nees.mean() < 12  # of six


def test_constants_groups_and_the_truth_are_kept():
    truth = pz.Truth(state=orbits.state(2, 0.1), process_noise=pz.ProcessNoise([0, 0, 1e-6, 1e-6]))
    before = orbits.orbit(2, pz.RungeKutta4(5), "estimated", process_noise=pz.ProcessNoise([1, 2, 3, 4]), truth=truth)
    problem = pz.with_gauss_markov(before, [1e-3, 2e-3], TAU, parameter="tau_a", prefix="a_")
    assert problem.model.names == ("x", "y", "vx", "vy", "a_vx", "a_vy", "mu")
    Q = np.diag(problem.process_noise.covariance)
    assert_allclose(Q, [1, 2, 3, 4, 2 * 1e-6 / TAU, 2 * 4e-6 / TAU, 0])
    assert_allclose(problem.truth.state, [*truth.state, 0, 0])
    tracking = pz.simulate(problem, [0.0, 10.0, 20.0], np.random.default_rng(0))
    assert_allclose(tracking.truth[:, 4:6], 0, atol=0)


def stepped() -> pz.Problem:
    return pz.Problem(pz.Model(["q"], ["q"], discrete=True), pz.Gaussian([0], [1]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pz.with_gauss_markov(orbits.orbit(2, pz.RungeKutta4()), SIGMA, TAU, "speed"), "'speed' is not a group"),
        (lambda: pz.with_gauss_markov(orbits.orbit(2, pz.RungeKutta4()), SIGMA, TAU, ["vq"]), "'vq' is not a state"),
        (lambda: pz.with_gauss_markov(orbits.orbit(2, pz.RungeKutta4()), SIGMA, -1.0), "time_constant -1.0"),
        (lambda: pz.with_gauss_markov(orbits.orbit(2, pz.Kepler()), SIGMA, TAU), "the rate of 'vx'"),
        (lambda: disturbed(process_noise=pz.ProcessNoise([1, 1, 1, 1], "step")), "per second"),
        (lambda: pz.with_gauss_markov(orbits.orbit(2, pz.RungeKutta4()), 0.0, TAU), "must be positive"),
        (lambda: pz.with_gauss_markov(stepped(), SIGMA, TAU, ["q"]), "needs rates"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
