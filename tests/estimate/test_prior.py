"""A prior that stands after the first measurement: propagated back, or refused where that would not be sound."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz

W = 0.7  # rad/s of the oscillator
M0, P0 = np.array([1.0, -0.4]), np.array([[0.09, 0.02], [0.02, 0.04]])


def model_of(dynamics, sensor, *parameters, **more):
    return pz.Model(list(dynamics), dynamics, [sensor], list(parameters), **more)


def oscillator(prior, prior_time, q=0.0, model=None, parameters=None, integrator=None):
    """x'' = -W^2 x, position measured."""
    model = model or model_of({"x": "v", "v": f"-{W}**2*x"}, pz.Sensor("ruler", {"position": "x"}))
    noise = pz.ProcessNoise(np.diag([0.0, q]), "second")
    station = pz.Station("wall", "ruler", 0.01)
    integrator = integrator or pz.RungeKutta8(max_step=0.05)
    return pz.Problem(model, prior, noise, [station], parameters or {}, integrator, prior_time=prior_time)


def rotation(t):
    """exp(F t) of the oscillator."""
    c, s = np.cos(W * t), np.sin(W * t)
    return np.array([[c, s / W], [-W * s, c]])


def noise_over(gap, q):
    """The integral of Phi(s) diag(0, q) Phi(s)^T over the gap, by its antiderivatives."""
    s2 = gap / 2 - np.sin(2 * W * gap) / (4 * W)  # of sin^2
    c2 = gap / 2 + np.sin(2 * W * gap) / (4 * W)
    cs = np.sin(W * gap) ** 2 / (2 * W)
    return q * np.array([[s2 / W**2, cs / W], [cs / W, c2]])


def tracking(start=-3.0, K=40):
    t = start + 0.25 * np.arange(K)
    rng = np.random.default_rng(5)
    x = np.array([rotation(s) @ [1.2, -0.3] for s in t])
    return pz.Tracking(t, x[:, 0] + 0.1 * rng.standard_normal(K), truth=x)


def test_a_prior_moved_back_is_that_of_the_closed_form():
    moved = pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0), -3.0)
    back = rotation(-5.0)
    assert moved.prior_time == -3.0
    assert_allclose(moved.prior.mean, back @ M0, rtol=0, atol=1e-12)
    assert_allclose(moved.prior.covariance, back @ P0 @ back.T, rtol=0, atol=1e-13)


def test_the_process_noise_of_the_gap_counts():
    q = 1e-6
    moved = pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0, q), -3.0)
    back = rotation(-5.0)
    expected = back @ (P0 + noise_over(5.0, q)) @ back.T
    assert np.abs(expected - back @ P0 @ back.T).max() > 1e-6
    assert_allclose(moved.prior.covariance, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "estimator",
    [
        pz.ExtendedKalmanFilter(),
        pz.FactorGraph(),
        pytest.param(pz.Smoother(), marks=pytest.mark.slow),
        pytest.param(pz.SquareRootKalmanFilter(), marks=pytest.mark.slow),
    ],
)
def test_estimates_are_those_of_the_same_problem_with_its_prior_given_at_the_first_measurement(estimator):
    back, seen = rotation(-5.0), tracking()
    given = oscillator(pz.Gaussian(back @ M0, back @ P0 @ back.T), -3.0)
    moved = pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0), -3.0)
    one, other = estimator.estimate(given, seen), estimator.estimate(moved, seen)
    assert_allclose(other.mean, one.mean, rtol=0, atol=1e-10)
    assert_allclose(other.covariance, one.covariance, rtol=0, atol=1e-11)


def test_without_noise_it_is_the_regression_on_the_state_at_the_time_of_the_prior():
    """Least squares in the state at t = 2 s, of the prior there and all measurements before and after it."""
    seen = tracking()
    found = pz.BatchLeastSquares().estimate(pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0), -3.0), seen)
    H = np.array([rotation(t - 2.0)[0] for t in seen.times]) / 0.1
    root = np.linalg.inv(np.linalg.cholesky(P0))
    x = np.linalg.lstsq(np.vstack([root, H]), np.concatenate([root @ M0, seen.values[:, 0] / 0.1]), rcond=None)[0]
    assert_allclose(found.mean[20], x, rtol=0, atol=1e-10)  # epoch 20 is at 2 s


@pytest.mark.parametrize(
    "integrator", [pz.Kepler(), pytest.param(pz.DormandPrince(), marks=pytest.mark.slow), pz.RungeKutta4(max_step=5.0)]
)
def test_an_orbit_goes_back_by_every_kind_of_integrator(integrator):
    """Back and forward again is where the prior was, by the same integrator; by Kepler, the closed form's state."""
    mu, r, v = 3.986e14, np.array([7e6, 0.0, 0.0]), np.array([100.0, 5.4e3, 5.2e3])
    axes = ("x", "y", "z")
    r3 = "(x**2 + y**2 + z**2)**1.5"
    model = model_of(
        {a: f"v{a}" for a in axes} | {f"v{a}": f"-mu*{a}/{r3}" for a in axes},
        pz.Sensor("range", {"range": "sqrt((x - 6.4e6)**2 + y**2 + z**2)"}),
        "mu",
        groups={"position": axes, "velocity": [f"v{a}" for a in axes]},
    )
    sigma = np.array([1e3] * 3 + [1.0] * 3)
    prior = pz.Gaussian.from_sigma(np.concatenate([r, v]), sigma)
    problem = pz.Problem(model, prior, None, [pz.Station("dish", "range", 100.0)], {"mu": mu}, integrator, prior_time=600.0)
    moved = pz.with_prior_at(problem, -200.0)
    forward = pz.predict(moved, moved.prior, -200.0, 800.0)
    assert (np.abs(forward.mean - prior.mean) < 1e-6 * sigma).all()
    correlation = (forward.covariance - prior.covariance) / np.outer(sigma, sigma)
    assert np.abs(correlation).max() < 1e-8
    exact = np.concatenate(pz.propagate_kepler(r, v, mu, -800.0))
    assert (np.abs(moved.prior.mean - exact) < (1e-6 if isinstance(integrator, pz.Kepler) else 1e-2) * sigma).all()


def test_claimed_sigmas_are_within_a_percent_where_noise_is_as_large_as_is_taken():
    """The exact posterior of state and noise of the gap, whose joint distribution the moved prior loses the correlation of."""
    gap, back = 5.0, rotation(-5.0)
    unit = noise_over(gap, 1.0)
    lam = np.linalg.eigvalsh(np.linalg.solve(np.linalg.cholesky(P0), np.linalg.solve(np.linalg.cholesky(P0), unit).T))[-1]
    limit = 0.02**2 / (1 - 0.02**2) / lam
    pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0, 0.999 * limit), -3.0)
    with pytest.raises(ValueError, match=r"process noise in between is 0\.04 % of the prior's variance"):
        pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0, 1.001 * limit), -3.0)
    Q = noise_over(gap, limit)
    # errors of the moved prior, back @ (e + w), and the noise w that the next states gain
    joint = np.block([[back @ (P0 + Q) @ back.T, back @ Q], [Q @ back.T, Q]])
    claimed = joint.copy()
    claimed[:2, 2:] = claimed[2:, :2] = 0.0
    rng = np.random.default_rng(1)
    for A in rng.standard_normal((500, 4)) / np.sqrt(np.diag(joint)):
        assert abs(np.sqrt(A @ claimed @ A / (A @ joint @ A)) - 1) < 0.0102


class TestRefusals:
    def test_noise_that_would_count_twice(self):
        with pytest.raises(ValueError, match="the prior at 2 s cannot be propagated back to the first measurement at -3 s"):
            pz.with_prior_at(oscillator(pz.Gaussian(M0, P0), 2.0, 1e-3), -3.0)

    def test_a_perfect_prior_with_noise(self):
        with pytest.raises(ValueError, match="would be counted twice"):
            pz.with_prior_at(oscillator(pz.Gaussian(M0, np.zeros((2, 2))), 2.0, 1e-9), -3.0)

    def test_a_model_that_is_a_step(self):
        model = model_of({"x": "0.5*x"}, pz.Sensor("ruler", {"position": "x"}), discrete=True)
        problem = pz.Problem(model, pz.Gaussian(1.0, 1.0), None, [pz.Station("wall", "ruler", 0.01)], prior_time=2.0)
        with pytest.raises(ValueError, match="the model is a step"):
            pz.with_prior_at(problem, 0.0)

    @pytest.mark.parametrize("role", ["estimated", "considered"])
    def test_an_uncertain_parameter_that_drives_the_motion(self, role):
        model = model_of({"x": "v", "v": "-k*x"}, pz.Sensor("ruler", {"position": "x"}), pz.Parameter("k", role))
        problem = oscillator(pz.Gaussian(M0, P0), 2.0, model=model, parameters={"k": pz.Gaussian(W**2, 0.01)})
        with pytest.raises(ValueError, match="parameter 'k' is uncertain and drives the motion"):
            pz.with_prior_at(problem, -3.0)

    def test_motion_that_cannot_be_reversed(self):
        """x' = -x^3 came from infinity at t = -1/2 where x = 1 at t = 0."""
        model = model_of({"x": "-x**3"}, pz.Sensor("ruler", {"position": "x"}))
        problem = pz.Problem(model, pz.Gaussian(1.0, 0.01), None, [pz.Station("wall", "ruler", 0.01)], prior_time=0.0)
        with pytest.raises(ValueError, match="no state was found there that moves to the prior mean"):
            pz.with_prior_at(problem, -2.0)

    def test_estimators_name_the_way_out(self):
        with pytest.raises(ValueError, match=r"the prior is at 2 s, after the first measurement at -3 s: with_prior_at"):
            pz.ExtendedKalmanFilter().estimate(oscillator(pz.Gaussian(M0, P0), 2.0), tracking())


@pytest.mark.parametrize("role", ["estimated", "considered"])
def test_a_parameter_of_a_sensor_keeps_its_uncertainty(role):
    model = model_of({"x": "v", "v": f"-{W}**2*x"}, pz.Sensor("ruler", {"position": "x + b"}), pz.Parameter("b", role))
    problem = oscillator(pz.Gaussian(M0, P0), 2.0, model=model, parameters={"b": pz.Gaussian(0.3, 0.04)})
    moved = pz.with_prior_at(problem, -3.0)
    assert moved.parameters["b"].mean[0] == 0.3
    assert_allclose(moved.parameters["b"].covariance, [[0.04]], rtol=1e-14)
    back = rotation(-5.0)
    assert_allclose(moved.prior.covariance, back @ P0 @ back.T, rtol=0, atol=1e-13)


def test_a_prior_that_is_early_enough_stays():
    for time in (None, -3.0, -7.0):
        problem = oscillator(pz.Gaussian(M0, P0), time)
        assert pz.with_prior_at(problem, -3.0) is problem


def test_steps_backwards_are_as_short_as_steps_forward():
    problem = oscillator(pz.Gaussian(M0, P0), 0.0, integrator=pz.RungeKutta4(max_step=0.01))
    there, Phi = problem.step(M0, -5.0)
    assert_allclose(there, rotation(-5.0) @ M0, rtol=0, atol=1e-8)
    assert_allclose(Phi, rotation(-5.0), rtol=0, atol=1e-8)
    assert replace(problem, prior_time=None).prior_start(np.array([4.0])) == 4.0
