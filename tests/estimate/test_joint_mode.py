"""Constants that multiply noisy states: the joint mode is biased, the marginal one is that of the exact likelihood."""

import numpy as np
import pytest

import piazzi as pz

EPOCHS = 2000
Q, R_DIRECT, R_SCALED, SPEED, TRUE_SCALE = 0.05, 4.0, 0.01, 10.0, 1.03


def odometer(equation="scale*v"):
    """A speed that walks at random, seen directly and through a wheel of unknown scale."""
    model = pz.Model(
        ["v"], ["v"], [pz.Sensor("both", {"direct": "v", "wheel": equation})], parameters={"scale": "estimated"}, discrete=True
    )
    prior, noise = pz.Gaussian([SPEED], [4.0]), pz.ProcessNoise([Q], "step")
    station = pz.Station("car", "both", [R_DIRECT, R_SCALED])
    scale, truth = pz.Gaussian(1.0, 0.05**2), pz.Truth(parameters={"scale": TRUE_SCALE})
    return pz.Problem(model, prior, noise, [station], {"scale": scale}, truth=truth)


def log_posterior(scale, z):
    """Of the constant alone: prior, and innovations of a Kalman filter, which is exact for a given scale."""
    v, P, total = SPEED, 4.0, -0.5 * (scale - 1.0) ** 2 / 0.05**2
    for k, row in enumerate(z):
        P += Q if k else 0.0
        for value, h, R in zip(row, (1.0, scale), (R_DIRECT, R_SCALED), strict=True):
            S = h * h * P + R
            nu = value - h * v
            total -= 0.5 * (nu * nu / S + np.log(S))
            v, P = v + P * h / S * nu, P * R / S
    return total


def exact(z, near):
    """Mode and sigma of the exact posterior of the constant, by Newton's method on differences."""
    h, scale = 1e-4, near
    for _ in range(6):
        below, at, above = (log_posterior(scale + d, z) for d in (-h, 0.0, h))
        bend = (above - 2 * at + below) / h**2
        scale -= (above - below) / (2 * h) / bend
    return scale, (-bend) ** -0.5


@pytest.mark.parametrize("solver", ["bordered", "chain"])
@pytest.mark.parametrize("seed", [0, 1])
def test_marginal_constants_are_those_of_the_exact_likelihood(solver, seed):
    problem = odometer()
    tracking = pz.simulate(problem, np.arange(float(EPOCHS)), np.random.default_rng(seed))
    joint = pz.FactorGraph(solver=solver).estimate(problem, tracking)
    marginal = pz.FactorGraph(solver=solver, constants="marginal").estimate(problem, tracking)
    scale, sigma = exact(tracking.values, marginal.mean[-1, 1])
    off = (joint.mean[-1, 1] - scale) / sigma
    assert abs(off) > 2.0
    assert joint.success
    assert "the joint mode is biased: 'scale' is about" in joint.message
    told = float(joint.message.split(" is about ")[1].split()[0])
    assert told == pytest.approx(abs(off), rel=0.25)
    assert marginal.success
    assert marginal.message == ""
    assert abs(marginal.mean[-1, 1] - scale) <= 0.02 * sigma
    assert np.sqrt(marginal.covariance[-1, 1, 1]) == pytest.approx(sigma, rel=0.1)  # expected and observed information
    assert abs(marginal.mean[-1, 1] - TRUE_SCALE) < 3.5 * sigma


def test_constant_that_adds_has_no_bias_and_one_mode():
    problem = odometer("v + scale")
    tracking = pz.simulate(problem, np.arange(200.0), np.random.default_rng(0))
    joint, marginal = (pz.FactorGraph(constants=c).estimate(problem, tracking) for c in ("joint", "marginal"))
    assert joint.success
    assert joint.message == ""
    np.testing.assert_allclose(marginal.mean, joint.mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(marginal.covariance, joint.covariance, rtol=1e-9, atol=1e-15)


def test_nothing_is_asked_where_nothing_is_constant(monkeypatch):
    """The check costs linearisations, which problems without estimated constants do not pay."""
    monkeypatch.setattr("piazzi.estimate.joint_mode.shift", lambda *given: pytest.fail("asked"))
    model = pz.Model(["v"], ["v"], [pz.Sensor("s", ["v"])], discrete=True)
    problem = pz.Problem(model, pz.Gaussian([0.0], [1.0]), pz.ProcessNoise([1.0], "step"), [pz.Station("a", "s", 1.0)])
    tracking = pz.simulate(problem, np.arange(5.0), np.random.default_rng(0))
    assert pz.FactorGraph(constants="marginal").estimate(problem, tracking).success


def test_a_word_that_is_no_choice_is_refused():
    with pytest.raises(ValueError, match="constants is 'both'; it must be one of joint, marginal"):
        pz.FactorGraph(constants="both")
