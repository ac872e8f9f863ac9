"""How much the steps matter: measured, chosen by a tolerance, and warned of."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from piazzi.estimate.substeps import choose_substeps, step_warning, substep_error
from tests.laws.problems import linear, random_covariance, satellite
from tests.solvers import orbits

TIMES = np.arange(200) * 15.0


@pytest.mark.usefixtures("uncompiled")
def test_the_bias_is_the_filter_s_error_where_nothing_else_errs():
    """A linear problem without noise: what separates the filter from the truth is its steps alone (to first order)."""
    model = pz.Model(["q", "w"], ["w", "-q"], [pz.Sensor("s", ["q"])])
    calm = pz.ProcessNoise([0.0, 0.0])
    problem = pz.Problem(
        model,
        pz.Gaussian([1, 0], np.eye(2)),
        pz.ProcessNoise([0.0, 0.01], "second", "scaled"),
        [pz.Station("a", "s", 0.01)],
        integrator=pz.Midpoint(3),
        truth=pz.Truth([1.0, 0.0], process_noise=calm, integrator=pz.Midpoint(12), measurement_noise=False),
    )
    rng = np.random.default_rng(0)
    tracking = pz.simulate(problem, np.cumsum(rng.uniform(0.1, 0.5, 30)), rng)
    error = substep_error(problem, tracking)
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert_allclose(error.bias, estimate.mean - tracking.truth, rtol=0, atol=0.01 * np.abs(error.bias).max())
    assert_allclose(error.sigma, np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2)), rtol=1e-12)
    assert error.worst == error.sigmas.max()
    k = list(error.times).index(error.where[1])
    assert error.sigmas[k, ["q", "w"].index(error.where[0])] == error.worst


@pytest.mark.slow
def test_one_long_step_is_warned_of_and_short_ones_are_not():
    """The founding problem: a step of 15 s ruins the filter, ten Runge-Kutta steps do not show."""
    long, short = satellite(kernels.Taylor(1)), satellite(kernels.RungeKutta4(10))
    tracking = pz.simulate(short, np.arange(1441) * 15.0, np.random.default_rng(1))
    text = step_warning(long, tracking)
    assert "too long" in text
    assert "sigma at t =" in text
    assert step_warning(short, tracking) == ""
    estimates = [pz.ExtendedKalmanFilter().estimate(p, tracking) for p in (long, short)]
    sigma = np.sqrt(np.diagonal(estimates[1].covariance, axis1=1, axis2=2))
    actual = (np.abs(estimates[0].mean - estimates[1].mean) / sigma).max()
    assert 0.3 * actual < substep_error(long, tracking).worst < 3 * actual


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("method", [kernels.Euler, kernels.Midpoint, kernels.RungeKutta4])
def test_chosen_substeps_meet_the_tolerance_and_are_few(method):
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4], "second", "scaled")
    problem = orbits.orbit(2, method(1), process_noise=noise)
    times = np.arange(5) * 60.0
    tolerance = 2.0 if method is kernels.Euler else 0.01
    chosen = choose_substeps(problem, times, tolerance)
    count = chosen.integrator.substeps
    assert substep_error(chosen, times).worst <= tolerance
    if count > 1:
        fewer = replace(chosen, integrator=method(max(1, int(count * 0.9) - 1)))
        assert substep_error(fewer, times).worst > tolerance


@pytest.mark.usefixtures("uncompiled")
def test_max_step_keeps_its_form_and_the_truth_gets_its_own():
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4], "second", "scaled")
    problem = orbits.orbit(
        2, kernels.RungeKutta4(max_step=1e3), process_noise=noise, truth=pz.Truth(integrator=kernels.Midpoint(1))
    )
    chosen = choose_substeps(problem, [0.0, 60.0, 90.0, 600.0], 0.01)
    assert chosen.integrator.substeps is None
    assert 1.0 < chosen.integrator.max_step <= 510.0
    assert chosen.truth.integrator.substeps > 510.0 / chosen.integrator.max_step


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("solver", [kernels.Kepler(), kernels.DormandPrince()])
def test_methods_that_answer_for_themselves_are_left_alone(solver):
    problem = orbits.orbit(2, solver)
    assert choose_substeps(problem, TIMES) is problem
    assert substep_error(problem, TIMES).worst == 0.0
    assert step_warning(problem, TIMES) == ""


@pytest.mark.usefixtures("uncompiled")
def test_a_discrete_model_has_no_step_error():
    rng = np.random.default_rng(0)
    problem = linear(np.eye(2), [np.eye(2)], [random_covariance(rng, 2)], np.eye(2), pz.Gaussian([0, 0], np.eye(2)))
    assert substep_error(problem, [0.0, 1.0]).worst == 0.0


@pytest.mark.usefixtures("uncompiled")
def test_a_wrong_tolerance_is_refused():
    with pytest.raises(ValueError, match="tolerance is 0"):
        choose_substeps(orbits.orbit(2, kernels.RungeKutta4()), TIMES, 0)
