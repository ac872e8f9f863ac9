"""How Q becomes the covariance of one interval: per step, Q dt, or the integral of Phi Q Phi^T; singular and zero Q too."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.laws.problems import b612, linear, network, random_covariance, random_stable
from tests.references.van_loan import discretize

pytestmark = pytest.mark.usefixtures("uncompiled")

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 6)


def continuous(A, Q, per="second", method="integral", integrator=None):
    n = len(A)
    prior = pz.Gaussian(np.zeros(n), np.eye(n))
    return linear(A, [np.ones((1, n))], [np.eye(1)], Q, prior, discrete=False, per=per, method=method, integrator=integrator)


def noise(problem, dt, t=0.0):
    return pz.predict(problem, problem.prior, t, dt).Q


def some_covariance(rng, n):
    """Of any rank, zero included."""
    return random_covariance(rng, n, rank=int(rng.integers(0, n + 1)))


@given(SIZES, SEEDS, st.floats(0.01, 30))
@settings(max_examples=20)
def test_per_step_is_the_matrix_whatever_the_interval(n, seed, dt):
    rng = np.random.default_rng(seed)
    Q = some_covariance(rng, n)
    assert_allclose(noise(continuous(-np.eye(n), Q, "step"), dt), Q, rtol=1e-15, atol=0)
    assert_allclose(noise(continuous(-np.eye(n), Q, "second", "scaled"), dt), Q * dt, rtol=1e-14, atol=0)


@given(SIZES, SEEDS, st.floats(0.05, 1.0))
@settings(max_examples=20)
def test_integral_is_van_loans(n, seed, dt):
    rng = np.random.default_rng(seed)
    A, Q = 2 * random_stable(rng, n), some_covariance(rng, n)
    problem = continuous(A, Q, integrator=pz.RungeKutta4(max_step=0.01))
    Phi, exact = discretize(A, Q, dt)
    prediction = pz.predict(problem, problem.prior, 0.0, dt)
    assert_allclose(prediction.Q, exact, rtol=0, atol=1e-7 * max(np.abs(exact).max(), 1e-300))
    assert_allclose(prediction.Phi, Phi, rtol=0, atol=1e-8 * np.abs(Phi).max())
    assert_allclose(prediction.covariance, Phi @ Phi.T + exact, rtol=0, atol=1e-7 * np.abs(Phi @ Phi.T + exact).max())


def test_integral_of_constant_velocity_is_exact_in_one_step():
    """Noise of acceleration q: [[dt^3/3, dt^2/2], [dt^2/2, dt]] q, a polynomial that Simpson's rule integrates exactly."""
    problem, dt = continuous(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, 2.5]), integrator=pz.RungeKutta4(1)), 15.0
    assert_allclose(noise(problem, dt), 2.5 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), rtol=1e-14)


@pytest.mark.parametrize("integrator", [pz.RungeKutta4, pz.Taylor])
def test_error_of_the_integral_falls_with_the_step(integrator):
    rng = np.random.default_rng(1)
    A, Q = np.block([[np.zeros((2, 2)), np.eye(2)], [rng.standard_normal((2, 4))]]), np.diag([0, 0, 1.0, 2.0])
    _, exact = discretize(A, Q, 1.0)
    errors = [np.abs(noise(continuous(A, Q, integrator=integrator(s)), 1.0) - exact).max() for s in (8, 16)]
    assert errors[0] / errors[1] > (12 if integrator is pz.RungeKutta4 else 1.7)


@given(SEEDS, st.floats(0.1, 3.0))
@settings(max_examples=15)
def test_intervals_compose(seed, dt):
    """Noise of a whole interval = noise of its first part, carried through the second, + noise of the second."""
    rng = np.random.default_rng(seed)
    parts, whole = (
        network(rng, process_noise=pz.ProcessNoise(np.diag([0, 0, 2.0, 1.0])), integrator=pz.RungeKutta4(s)) for s in (6, 12)
    )
    first = pz.predict(parts, parts.prior, 0.0, dt)
    second = pz.predict(parts, first, dt, dt)
    both = pz.predict(whole, whole.prior, 0.0, 2 * dt)
    composed = second.Phi @ first.Q @ second.Phi.T + second.Q
    assert_allclose(composed, both.Q, rtol=1e-9, atol=1e-9 * np.abs(both.Q).max())
    assert_allclose(second.covariance, both.covariance, rtol=1e-9, atol=1e-9 * np.abs(both.covariance).max())


@given(SEEDS, st.floats(0.1, 50.0))
@settings(max_examples=20)
def test_integral_is_symmetric_and_semidefinite_however_long_the_step(seed, dt):
    rng = np.random.default_rng(seed)
    problem = network(rng, process_noise=pz.ProcessNoise(some_covariance(rng, 4)), integrator=pz.RungeKutta4(1))
    Q = noise(problem, dt)
    assert_array_equal(Q, Q.T)
    assert np.linalg.eigvalsh(Q).min() >= -1e-12 * np.abs(Q).max()


def test_integral_of_a_curved_flow():
    """Against Gauss-Legendre quadrature of Phi(end, s) Q Phi(end, s)^T along the orbit."""
    Q, dt = np.diag([0.0, 0.0, 1.0, 2.0]), 0.4
    problem = b612(process_noise=pz.ProcessNoise(Q), integrator=pz.RungeKutta4(200))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = np.zeros((4, 4))
    for node, weight in zip(nodes, weights, strict=True):
        s = dt * (node + 1) / 2
        x, _ = problem.step(problem.mean, s)
        _, Phi = problem.step(x, dt - s)
        total += weight * dt / 2 * Phi @ Q @ Phi.T
    assert_allclose(noise(problem, dt), total, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("per", ["step", "second"])
def test_zero_noise_adds_nothing(per):
    problem = b612(process_noise=pz.ProcessNoise(np.zeros(4), per))
    prediction = pz.predict(problem, problem.prior, 0.0, 0.1)
    assert not prediction.Q.any()
    assert_allclose(prediction.covariance, prediction.Phi @ problem.covariance @ prediction.Phi.T, rtol=1e-14, atol=1e-15)


def test_estimated_constants_stand_still_unless_told_otherwise():
    model = pz.Model(["x"], ["-k*x"], [pz.Sensor("s", ["x"])], {"k": "estimated"})
    numbers = {
        "prior": pz.Gaussian(1.0, 1.0),
        "stations": pz.Station("s", "s", 1.0),
        "parameters": {"k": pz.Gaussian(0.5, 0.01)},
    }
    still = pz.Problem(model, process_noise=pz.ProcessNoise(2.0, "step"), **numbers)
    assert_allclose(noise(still, 1.0), [[2.0, 0.0], [0.0, 0.0]])
    wandering = pz.Problem(model, process_noise=pz.ProcessNoise([2.0, 3.0], "step"), **numbers)
    assert_allclose(noise(wandering, 1.0), [[2.0, 0.0], [0.0, 3.0]])
    prediction = pz.predict(still, still.prior, 0.0, 1.0)
    assert prediction.mean[1] == 0.5
    assert prediction.covariance[1, 1] == pytest.approx(0.01)
