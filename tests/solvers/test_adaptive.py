"""Adaptive steps: the tolerance holds, steps end on epochs, and failure shows as NaN."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from tests.references import van_loan
from tests.solvers import orbits


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
def test_error_follows_the_tolerance(rtol):
    """Over a quarter of an eccentric orbit the error is within a few hundred times the tolerance of a step."""
    x, dt = orbits.state(2, 0.7), 5000.0
    exact, _ = orbits.orbit(2, kernels.Kepler()).step(x, dt)
    after, _ = orbits.orbit(2, kernels.DormandPrince(rtol)).step(x, dt)
    error = np.linalg.norm((after - exact)[:2]) / np.linalg.norm(exact[:2])
    assert error < 300 * rtol


@pytest.mark.usefixtures("uncompiled")
def test_a_component_may_pass_through_zero():
    """The scale is the length of the group: no step collapses where x or vy vanishes, with no absolute tolerance at all."""
    x = orbits.state(2, 0.0, nu=np.pi / 2 - 1e-3)
    few = kernels.DormandPrince(1e-10, 0.0, max_steps=12)
    after, _ = orbits.orbit(2, few).step(x, 600.0)
    exact, _ = orbits.orbit(2, kernels.Kepler()).step(x, 600.0)
    assert_allclose(after, exact, rtol=1e-8)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("rtol", [1e-7, 1e-11])
def test_simulation_and_filter_move_alike_within_the_tolerance(rtol):
    """Simulation holds the state to the tolerance, the filter its transition matrix too: both within it of Kepler's motion."""
    problem = orbits.orbit(
        2, kernels.DormandPrince(rtol), prior=pz.Gaussian(orbits.state(2, 0.7), np.zeros(4)), process_noise=np.zeros(4)
    )
    exact = orbits.orbit(2, kernels.Kepler())
    tracking = pz.simulate(problem, [0.0, 100.0, 2000.0, 9000.0], np.random.default_rng(0))
    for k, dt in enumerate(np.diff(tracking.times)):
        after, _ = exact.step(tracking.truth[k], dt)
        for moved in (tracking.truth[k + 1], problem.step(tracking.truth[k], dt, tracking.times[k])[0]):
            assert np.linalg.norm((moved - after)[:2]) < 300 * rtol * np.linalg.norm(after[:2])


UPRIGHT = np.array([[0.0, 1.0], [9.81, 0.0]])


def upright(solver, q=0.5) -> pz.Problem:
    """A pendulum that stands on its head: the state rests whatever the step, its derivative does not."""
    model = pz.Model(["th", "om"], ["om", "9.81*sin(th)"], [pz.Sensor("s", ["th"])])
    return pz.Problem(model, pz.Gaussian([0, 0], [1e-4, 1e-4]), [0.0, q], [pz.Station("a", "s", 1e-4)], integrator=solver)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("rtol", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("dt", [1.0, 3.0])
def test_at_an_equilibrium_the_derivative_is_held_to_the_tolerance(rtol, dt):
    problem = upright(kernels.DormandPrince(rtol, 0.0))
    Phi, Q = van_loan.discretize(UPRIGHT, np.diag([0.0, 0.5]), dt)
    predicted = pz.predict(problem, problem.prior, 0.0, dt)
    for found in (predicted.Phi, problem.step([0.0, 0.0], dt)[1]):
        assert_allclose(found, Phi, rtol=30 * rtol)
    assert_allclose(predicted.Q, Q, rtol=30 * rtol)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("estimator", [
    pz.ExtendedKalmanFilter(), pz.ExtendedKalmanFilter(gate=0.99), pz.SquareRootKalmanFilter(), pz.UnscentedKalmanFilter(),
    pz.Smoother(), pz.FactorGraph(), pz.SlidingWindow(3),
], ids=lambda e: f"{type(e).__name__}{'-gate' if getattr(e, 'gate', None) else ''}")  # fmt: skip
@pytest.mark.parametrize("q", [0.5, 0.0])
def test_at_an_equilibrium_every_estimator_s_covariance_is_the_exact_one(estimator, q):
    """The Kalman filter of the linear problem, with Van Loan's matrices; at the last epoch the views of all are one."""
    if isinstance(estimator, pz.UnscentedKalmanFilter):
        estimator = pz.UnscentedKalmanFilter(alpha=1e-3)  # its points are beside the equilibrium, where sin(th) bends
    problem = upright(kernels.DormandPrince(1e-10), q)
    estimate = estimator.estimate(problem, pz.Tracking(np.arange(4.0), np.zeros(4)))
    assert estimate.success, estimate.message
    Phi, Q = van_loan.discretize(UPRIGHT, np.diag([0.0, q]), 1.0)
    P, H = np.diag([1e-4, 1e-4]), np.array([[1.0, 0.0]])
    for k in range(4):
        P = Phi @ P @ Phi.T + Q if k else P
        P = P - P @ H.T @ H @ P / (P[0, 0] + 1e-4)
    assert_allclose(estimate.covariance[-1], P, rtol=1e-6)


@pytest.mark.usefixtures("uncompiled")
def test_a_column_that_hardly_matters_does_not_stop_the_steps():
    """Ten states in a row: the first moves the last as t^9 / 9!, far below the error of a step of order 8."""
    names = [f"x{i}" for i in range(10)]
    model = pz.Model(names, [*names[1:], "0"], [pz.Sensor("s", ["x0"])])
    prior = pz.Gaussian(np.ones(10), np.eye(10))
    noise = np.diag([0.0] * 9 + [1.0])
    solver = kernels.DormandPrince(1e-12, 0.0)
    problem = pz.Problem(model, prior, noise, [pz.Station("a", "s", 1.0)], integrator=solver)
    Phi, Q = van_loan.discretize(np.eye(10, k=1), noise, 0.5)
    predicted = pz.predict(problem, prior, 0.0, 0.5)
    assert_allclose(predicted.Phi, Phi, rtol=0, atol=1e-11)
    assert_allclose(predicted.Q, Q, rtol=0, atol=1e-11)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize(
    ("solver", "x"),
    [
        (kernels.DormandPrince(1e-12, max_steps=3), orbits.state(2, 0.1)),  # too few steps
        (kernels.DormandPrince(1e-10, max_steps=300), np.array([7e6, 0.0, 0.0, 0.0])),  # falls into the centre
        (kernels.DormandPrince(), np.array([7e6, np.nan, 0.0, 7e3])),
    ],
    ids=["steps", "singularity", "nan"],
)
def test_failure_is_not_finite(solver, x):
    after, Phi = orbits.orbit(2, solver).step(x, 5000.0)
    assert np.isnan(after[0])
    assert np.isnan(Phi[0]).all()


@pytest.mark.usefixtures("uncompiled")
def test_an_estimate_that_cannot_step_says_so():
    problem = orbits.orbit(2, kernels.DormandPrince(1e-12, max_steps=2))
    tracking = pz.Tracking([0.0, 60.0, 5000.0], [7e6, 7e6, 7e6])
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert not estimate.success
    assert "not finite from epoch 2 (t = 5000 s)" in estimate.message


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("substeps", [1, 5])
def test_noise_is_integrated_along_the_steps(substeps):
    """On a linear model, Van Loan's integral, to the tolerance."""
    A = np.array([[0.0, 1.0], [-0.5, -0.2]])
    Q = np.array([[0.02, 0.01], [0.01, 0.05]])
    model = pz.Model(["q", "w"], ["w", "-0.5*q - 0.2*w"], [pz.Sensor("s", ["q"])])
    solver = kernels.DormandPrince(1e-9, 1e-9, substeps=substeps)
    problem = pz.Problem(model, pz.Gaussian([1.0, 0.0], np.eye(2)), Q, [pz.Station("a", "s", 1.0)], integrator=solver)
    predicted = pz.predict(problem, problem.prior, 0.0, 2.0)
    Phi, noise = van_loan.discretize(A, Q, 2.0)
    assert_allclose(predicted.Phi, Phi, rtol=0, atol=1e-8)
    assert_allclose(predicted.Q, noise, rtol=0, atol=1e-9)


@pytest.mark.usefixtures("uncompiled")
def test_a_pulse_is_not_stepped_over_where_max_step_forbids_it():
    """Nothing moves but for a short thrust that a long step would not see."""
    model = pz.Model(["v"], ["exp(-((t - 700)/5)**2)"], [pz.Sensor("s", ["v"])])
    for solver, expected in ((kernels.DormandPrince(max_step=20.0), 5 * np.sqrt(np.pi)),):
        problem = pz.Problem(model, pz.Gaussian([0.0], [1.0]), stations=[pz.Station("a", "s", 1.0)], integrator=solver)
        assert problem.step([0.0], 1000.0)[0][0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_compiled_equals_uncompiled(monkeypatch):
    for solver in (kernels.DormandPrince(1e-9), kernels.Kepler(), kernels.RungeKutta8(2)):
        problem = orbits.orbit(2, solver)
        x = orbits.state(2, 0.3)
        monkeypatch.setenv("PIAZZI_JIT", "1")
        compiled = problem.step(x, 1500.0)
        monkeypatch.setenv("PIAZZI_JIT", "0")
        plain = problem.step(x, 1500.0)
        assert_allclose(compiled[0], plain[0], rtol=1e-12)
        unit = orbits.units(2)
        assert_allclose(compiled[1] * unit / unit[:, None], plain[1] * unit / unit[:, None], rtol=0, atol=1e-11)
