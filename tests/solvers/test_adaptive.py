"""Adaptive steps: the tolerance holds, steps end on epochs, and failure shows as NaN."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

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
def test_without_and_with_derivative_the_steps_are_the_same():
    """Simulation moves without a derivative, the filter with one: from the same state to the same bits."""
    problem = orbits.orbit(
        2, kernels.DormandPrince(1e-7), prior=pz.Gaussian(orbits.state(2, 0.7), np.zeros(4)), process_noise=np.zeros(4)
    )
    tracking = pz.simulate(problem, [0.0, 100.0, 2000.0, 9000.0], np.random.default_rng(0))
    x = tracking.truth[0]
    for k, dt in enumerate(np.diff(tracking.times), start=1):
        x, _ = problem.step(x, dt, tracking.times[k - 1])
        assert_array_equal(x, tracking.truth[k])


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
    """On a linear model, Van Loan's integral; a limit on the steps refines the quadrature with them."""
    A = np.array([[0.0, 1.0], [-0.5, -0.2]])
    Q = np.array([[0.02, 0.01], [0.01, 0.05]])
    model = pz.Model(["q", "w"], ["w", "-0.5*q - 0.2*w"], [pz.Sensor("s", ["q"])])
    solver = kernels.DormandPrince(1e-9, 1e-9, substeps=substeps)
    problem = pz.Problem(model, pz.Gaussian([1.0, 0.0], np.eye(2)), Q, [pz.Station("a", "s", 1.0)], integrator=solver)
    predicted = pz.predict(problem, problem.prior, 0.0, 2.0)
    Phi, noise = van_loan.discretize(A, Q, 2.0)
    assert_allclose(predicted.Phi, Phi, rtol=0, atol=1e-8)
    assert_allclose(predicted.Q, noise, rtol=0, atol=1e-3 / substeps**4)


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
