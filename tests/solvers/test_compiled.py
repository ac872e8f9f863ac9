"""Compiled, every option gives what its own source gives uncompiled."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import kernels
from tests.solvers import orbits

pytestmark = pytest.mark.slow

TIMES = np.cumsum(np.random.default_rng(0).uniform(20, 120, 12))


def moved(solver, d=3, **changes) -> pz.Problem:
    """Noise in axes of the orbit and two manoeuvres, one of them at an epoch."""
    dv = np.array([2.0, -3.0, 1.0])[:d]
    moves = [pz.Manoeuvre(TIMES[4], dv, 0.01 * np.eye(d)), pz.Manoeuvre(TIMES[7] + 3.0, -dv)]
    noise = pz.ProcessNoise([0.0] * d + [1e-4, 4e-4, 9e-4][:d], axes="orbit")
    return orbits.orbit(d, solver, process_noise=noise, manoeuvres=moves, **changes)


def both(monkeypatch, run):
    """Results compiled and uncompiled."""
    out = []
    for jit in ("1", "0"):
        monkeypatch.setenv("PIAZZI_JIT", jit)
        out.append(run())
    return out


def assert_same(one, other, tolerance=1e-8):
    sigma = np.sqrt(np.diagonal(other.covariance, axis1=1, axis2=2))
    assert one.success, one.message
    assert np.abs((one.mean - other.mean) / sigma).max() < tolerance
    assert np.abs((one.covariance - other.covariance) / (sigma[:, :, None] * sigma[:, None, :])).max() < tolerance


@pytest.mark.parametrize("solver", [kernels.Kepler(), kernels.DormandPrince(1e-11), kernels.RungeKutta8(2)])
def test_filter_with_every_kind_of_motion(solver, monkeypatch):
    problem = moved(solver, 3 if isinstance(solver, kernels.Kepler) else 2)
    tracking, plain = both(monkeypatch, lambda: pz.simulate(problem, TIMES, np.random.default_rng(1)))
    assert_allclose(tracking.truth, plain.truth, rtol=1e-9)
    assert_same(*both(monkeypatch, lambda: pz.ExtendedKalmanFilter().estimate(problem, tracking)))


@pytest.mark.parametrize("estimator", [pz.FactorGraph(), pz.SlidingWindow(4)])
def test_graph_and_window_through_manoeuvres(estimator, monkeypatch):
    problem = moved(kernels.RungeKutta4(2), 2)
    tracking = pz.simulate(problem, TIMES, np.random.default_rng(1))
    assert_same(*both(monkeypatch, lambda: estimator.estimate(problem, tracking)))


@pytest.mark.parametrize("estimator", [pz.FactorGraph(), pz.SlidingWindow(4)])
def test_graph_and_window_one_state_at_a_time(estimator, monkeypatch):
    """Noise that is a multiple of one matrix, and steps that cannot be taken together."""
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 4e-4], "second", "scaled")
    problem = orbits.orbit(2, kernels.Kepler(), "estimated", process_noise=noise)
    tracking = pz.simulate(problem, TIMES, np.random.default_rng(1))
    assert_same(*both(monkeypatch, lambda: estimator.estimate(problem, tracking)))


def test_guarded_filter_and_its_live_twin(monkeypatch):
    problem = moved(kernels.Kepler(), 2)
    tracking = pz.simulate(problem, TIMES, np.random.default_rng(1))
    estimator = pz.ExtendedKalmanFilter(iterations=3, gate=0.99)
    one, other = both(monkeypatch, lambda: estimator.estimate(problem, tracking))
    assert_same(one, other)
    monkeypatch.setenv("PIAZZI_JIT", "1")
    live = estimator.start(problem)
    for k, t in enumerate(TIMES):
        live.update("centre", tracking.values[k], t)
        assert_allclose(live.mean, one.mean[k], rtol=1e-12)
