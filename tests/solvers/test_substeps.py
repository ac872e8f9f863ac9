"""How much the steps matter: measured, chosen by a tolerance, and warned of."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from piazzi.estimate import long_steps
from piazzi.estimate.long_steps import step_warning
from piazzi.estimate.substeps import choose_substeps, substep_error
from tests.laws.problems import linear, random_covariance, satellite
from tests.solvers import orbits

TIMES = np.arange(200) * 15.0


def oscillator(count: int) -> pz.Problem:
    """Linear and undisturbed: the filter differs from the truth, whose steps are four times finer, by its steps alone."""
    return pz.Problem(
        pz.Model(["q", "w"], ["w", "-q"], [pz.Sensor("s", ["q"])]),
        pz.Gaussian([1, 0], np.eye(2)),
        pz.ProcessNoise([0.0, 0.01], "second", "scaled"),
        [pz.Station("a", "s", 0.01)],
        integrator=pz.Midpoint(count),
        truth=pz.Truth(
            [1.0, 0.0],
            process_noise=pz.ProcessNoise([0.0, 0.0]),
            integrator=pz.Midpoint(4 * count),
            measurement_noise=False,
        ),
    )


@pytest.mark.usefixtures("uncompiled")
def test_the_bias_is_the_filter_s_error_where_nothing_else_errs():
    """Up to the product of two errors: the bias is carried by the derivative of the coarse step, the truth by the fine one's.

    Both errors are of order h^2, so with half the step the difference, beside the bias, falls to a quarter.
    """
    times = np.cumsum(np.random.default_rng(0).uniform(0.1, 0.5, 30))
    beside = []
    for count in (3, 6):
        problem = oscillator(count)
        tracking = pz.simulate(problem, times, np.random.default_rng(0))
        error = substep_error(problem, tracking)
        estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
        unseen = error.bias - (estimate.mean - tracking.truth)
        beside.append(np.abs(unseen).max() / np.abs(error.bias).max())
        assert_allclose(error.sigma, np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2)), rtol=1e-12)
        assert error.worst == error.sigmas.max()
        k = list(error.times).index(error.where[1])
        assert error.sigmas[k, ["q", "w"].index(error.where[0])] == error.worst
    assert beside[0] < 0.01
    assert beside[1] / beside[0] == pytest.approx(1 / 4, rel=0.15)


@pytest.mark.usefixtures("uncompiled")
def test_the_bias_is_the_recursion_written_here():
    """b' = (I - K H) (Phi b + one step's error), with the filter's own gains, means and steps, on the same run."""
    problem = oscillator(3)
    times = np.cumsum(np.random.default_rng(0).uniform(0.1, 0.5, 30))
    tracking = pz.simulate(problem, times, np.random.default_rng(0))
    fine = replace(problem, integrator=pz.Midpoint(12))
    x, P, b = problem.mean, problem.covariance, np.zeros(2)
    expected, before, H, R = [], times[0], np.array([[1.0, 0.0]]), 0.01
    for t, z in zip(times, tracking.values[:, 0], strict=True):
        if t > before:
            exact = fine.step(x, t - before)[0]
            x, Phi = problem.step(x, t - before)
            b = Phi @ b + x - exact
            P = Phi @ P @ Phi.T + problem.process_noise.covariance * (t - before)
        before = t
        K = P @ H.T / (H @ P @ H.T + R)
        x, b, P = x + K[:, 0] * (z - x[0]), b - K[:, 0] * b[0], (np.eye(2) - K @ H) @ P
        expected.append(b)
    assert_allclose(substep_error(problem, tracking).bias, expected, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_one_long_step_is_warned_of_and_short_ones_are_not():
    """The founding problem: a step of 15 s ruins the filter, ten Runge-Kutta steps do not show."""
    long, short = satellite(kernels.Taylor(1)), satellite(kernels.RungeKutta4(10))
    tracking = pz.simulate(short, np.arange(1441) * 15.0, np.random.default_rng(1))
    text = step_warning(long, tracking)
    found = re.fullmatch(
        r"the integrator's steps are too long: (\d+) times as many move '(\w+)' by (\S+) sigma at t = (\S+) s; .*", text
    )
    seen = (1 - 1 / int(found[1])) / (1 - 1 / 4)  # a method of order 1 leaves a quarter of the error with steps of a quarter
    assert int(found[1]) > 4
    assert float(found[3]) == pytest.approx(seen * substep_error(long, tracking).worst, rel=0.1)  # the same, to first order
    assert step_warning(short, tracking) == ""
    assert step_warning(long, tracking, limit=1e3) == ""
    assert "too long" in step_warning(long, tracking, estimator=pz.SlidingWindow(5))
    estimates = [pz.ExtendedKalmanFilter().estimate(p, tracking) for p in (long, short)]
    sigma = np.sqrt(np.diagonal(estimates[1].covariance, axis1=1, axis2=2))
    actual = (np.abs(estimates[0].mean - estimates[1].mean) / sigma).max()
    assert 0.3 * actual < substep_error(long, tracking).worst < 3 * actual


@pytest.mark.usefixtures("uncompiled")
def test_a_filter_that_is_lost_with_any_steps_is_told_of():
    """Measurements of something else altogether: no word about steps, whose sigma would say nothing."""
    rng = np.random.default_rng(0)
    tracking = pz.Tracking(np.arange(50) * 0.5, 100 * rng.standard_normal(50))
    said = step_warning(oscillator(10), tracking)
    assert re.fullmatch(
        r"the estimate diverges with steps of any length: half of its innovations are beyond (\S+) sigma; .*", said
    )
    assert step_warning(oscillator(10), tracking, limit=1e-15) == said  # nor where runs that are lost agree no better
    own = pz.simulate(replace(oscillator(1), truth=None, integrator=pz.RungeKutta4(10)), tracking.times, rng)
    assert "too long" in step_warning(replace(oscillator(1), integrator=pz.Euler(1)), own)
    assert step_warning(oscillator(10), own) == ""
    elsewhere = pz.Tracking(own.times, own.values, truth=own.truth + 1e3)
    assert "half of its errors are beyond" in step_warning(oscillator(10), elsewhere)


def far_apart(integrator=None) -> tuple[pz.Problem, pz.Tracking]:
    """A low satellite by its distance from the centre, once in six hours: four turns between two measurements."""
    noise = pz.ProcessNoise([0.0, 0.0, 1e-8, 1e-8])
    x = np.array([7e6, 0.0, 0.0, 7.8e3])
    problem = orbits.orbit(
        2, integrator, prior=pz.Gaussian(x, [1e4, 1e4, 1e-2, 1e-2]), process_noise=noise,
        stations=[pz.Station("centre", "range", 1.0)],
    )  # fmt: skip
    times = 21600.0 * np.arange(6)
    exact = [np.linalg.norm(pz.propagate_kepler(x[:2], x[2:], orbits.MU, t)[0]) for t in times]
    return problem, pz.Tracking(times, exact)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.slow  # kernels of eight seconds
def test_the_worst_steps_are_not_passed_over():
    """The default's ten substeps between measurements six hours apart: as wrong as can be, and as sure of itself as ever."""
    problem, tracking = far_apart()
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    exact = pz.propagate_kepler(problem.mean[:2], problem.mean[2:], orbits.MU, tracking.times[-1])[0]
    assert estimate.success
    assert np.linalg.norm(estimate.mean[-1, :2] - exact) > 1e7  # a turn of the orbit is 1.4e7 m across
    found = re.fullmatch(
        r"the integrator's steps are too long: (\d+) times as many move '\w+' by (\S+) sigma at t = \S+ s; .*",
        step_warning(problem, tracking),
    )
    assert int(found[1]) >= 64
    assert float(found[2]) > 1e4
    enough = replace(problem, integrator=pz.RungeKutta4(10 * int(found[1])))
    assert step_warning(enough, tracking) == ""
    found = pz.ExtendedKalmanFilter().estimate(enough, tracking)
    assert np.linalg.norm(found.mean[-1, :2] - exact) < 100.0


@pytest.mark.usefixtures("uncompiled")
def test_steps_that_never_agree_are_told_of(monkeypatch):
    monkeypatch.setattr(long_steps, "FINEST", 64)
    said = step_warning(*far_apart(pz.Euler(10)))
    assert said.startswith("the integrator's steps are far too long: even 16 and 64 times as many differ by ")
    assert "DormandPrince" in said


@pytest.mark.usefixtures("uncompiled")
def test_an_estimate_that_only_finer_steps_make_finite():
    """x' = -x^3 in steps of a second: from 3 each jumps further out, and overflows."""
    model = pz.Model(["x"], ["-x**3"], [pz.Sensor("s", ["x"])])
    problem = pz.Problem(model, pz.Gaussian(3.0, 1e-2), None, [pz.Station("a", "s", 1.0)], integrator=pz.RungeKutta4(10))
    tracking = pz.Tracking(10.0 * np.arange(3), [3.0, 0.2, 0.15])
    assert not pz.ExtendedKalmanFilter().estimate(problem, tracking).success
    said = step_warning(problem, tracking)
    assert re.search(r"too long: the estimate is not finite, and is with \d+ times as many", said)


@pytest.mark.usefixtures("uncompiled")
def test_of_a_long_recording_the_beginning_is_looked_at(monkeypatch):
    monkeypatch.setattr(long_steps, "LOOKED_AT", 20)
    problem = replace(oscillator(1), integrator=pz.Euler(1), truth=None)
    times = np.concatenate([np.arange(20) * 1e-4, 1.0 + np.arange(20)])
    rows = np.repeat(times, 2)
    short, long = (pz.Tracking(rows[:n], np.cos(rows[:n]), np.full(n, "a")) for n in (40, 80))
    assert step_warning(problem, short) == step_warning(problem, long) == ""
    monkeypatch.setattr(long_steps, "LOOKED_AT", 40)
    assert "too long" in step_warning(problem, long)


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
