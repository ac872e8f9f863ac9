"""An ensemble has the runs that the ordinary simulation, filter and metrics make one by one."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.evaluate.metrics import errors, nees, nis, rmse
from piazzi.study.ensemble import Layout, filter_runs, semidefinite_root, simulate_runs
from tests.laws.problems import b612, network, random_covariance, satellite

RUNS, EPOCHS = 11, 40


@cache
def case(name):
    """A problem whose runs make an ensemble, and the seconds between its epochs."""
    scaled = pz.ProcessNoise([0.0, 0.0, 1e-5, 1e-5], "second", "scaled")
    return {
        "satellite": lambda: (satellite(), 15.0),
        "b612": lambda: (b612(truth=None), 0.1),
        "network": lambda: (network(np.random.default_rng(3), process_noise=scaled), 0.2),
    }[name]()


def drawn(problem, runs, seed=0):
    """First states and unit draws of process and measurement noise."""
    rng = np.random.default_rng(seed)
    first = problem.mean + 0.1 * rng.standard_normal((runs, problem.model.n)) @ np.linalg.cholesky(problem.covariance).T
    rows = EPOCHS * len(problem.stations)
    return first, rng.standard_normal((runs, EPOCHS, problem.model.n)), rng.standard_normal((runs, rows, problem.model.width))


@cache
def runs_of(name):
    problem, dt = case(name)
    layout = Layout(problem, np.arange(EPOCHS) * dt)
    truth, z = simulate_runs(layout, problem, *drawn(problem, RUNS))
    return layout, truth, z, filter_runs(layout, z, truth)


def one_by_one(layout, truth, z):
    """The tracking of one run."""
    names = np.array([s.name for s in layout.problem.stations])[layout.station]
    return pz.Tracking(np.repeat(layout.times, len(layout.problem.stations)), z, names, truth)


@pytest.mark.parametrize("name", ["satellite", "b612", pytest.param("network", marks=pytest.mark.slow)])
def test_the_filter_of_an_ensemble_is_the_filter(name):
    layout, truth, z, (mean, P, scores) = runs_of(name)
    groups = layout.problem.model.group_indices
    for run in range(RUNS):
        estimate = pz.ExtendedKalmanFilter().estimate(layout.problem, one_by_one(layout, truth[run], z[run]))
        assert estimate.success
        sigma = np.sqrt(np.diagonal(estimate.covariance[-1]))
        assert_allclose(mean[run] / sigma, estimate.mean[-1] / sigma, rtol=1e-11, atol=1e-9)
        assert_allclose(P[run] / np.outer(sigma, sigma), estimate.covariance[-1] / np.outer(sigma, sigma), atol=1e-9)
        assert_allclose(scores.nees[run], nees(estimate).value, rtol=1e-7)
        assert_allclose(scores.nis[run], nis(estimate).value, rtol=1e-7, atol=1e-9)
        for g, columns in enumerate(groups.values()):
            expected = rmse(errors(estimate), columns)
            assert np.sqrt(scores.squared[run, g].mean()) == pytest.approx(expected, rel=1e-9)
            spread = np.diagonal(estimate.covariance, axis1=1, axis2=2)[:, list(columns)].sum(axis=1)
            assert_allclose(scores.spread[run, g], spread, rtol=1e-8)


@pytest.mark.parametrize("name", ["satellite", "b612", pytest.param("network", marks=pytest.mark.slow)])
def test_truth_of_an_ensemble_obeys_dynamics_noise_and_sensors(name):
    """Each interval leaves L w, with L L^T = Q dt; what is measured is h, and L v with L L^T = R."""
    layout, truth, z, _ = runs_of(name)
    problem, times = layout.problem, layout.times
    first, w, v = drawn(problem, RUNS)
    assert_array_equal(truth[:, 0], first)
    _, _, scale = problem.intervals(times)
    L = semidefinite_root(problem.process_noise.covariance)
    for run in (0, RUNS - 1):
        moved, _ = problem.step(truth[run, :-1], times[1] - times[0], times[:-1])
        kick = np.sqrt(scale[1:, None]) * (w[run, 1:] @ L.T)
        assert_allclose(truth[run, 1:], moved + kick, rtol=1e-12, atol=1e-12)
        for s, station in enumerate(problem.stations):
            rows, m = layout.station == s, len(station.noise)
            error = z[run, rows, :m] - problem.measure(station.name, truth[run], times)
            expected = v[run, rows, :m] @ np.linalg.cholesky(station.noise).T
            wrapped = (error - expected) / (2 * np.pi)
            angle = np.array(problem.model.sensor(station.sensor).is_angle)
            wrapped[:, angle] -= np.round(wrapped[:, angle])
            assert_allclose(wrapped, 0.0, atol=1e-12)
            assert (np.abs(z[run, rows, :m][:, angle]) <= np.pi).all()
            assert np.isnan(z[run, rows, m:]).all()


@pytest.mark.parametrize("runs", [1, 3, 8, 9])
def test_company_changes_no_bit(runs):
    """A run is the same alone, in a lane of its own or in the last, overlapping group."""
    layout, truth, z, (mean, P, scores) = runs_of("satellite")
    first, w, v = drawn(layout.problem, RUNS)
    part = slice(RUNS - runs, RUNS)
    again, measured = simulate_runs(layout, layout.problem, first[part], w[part], v[part])
    assert_array_equal(again, truth[part])
    assert_array_equal(measured, z[part])
    mean_again, P_again, scores_again = filter_runs(layout, measured, again)
    assert_array_equal(mean_again, mean[part])
    assert_array_equal(P_again, P[part])
    for name in ("squared", "spread", "nees", "nis", "lowest"):
        assert_array_equal(getattr(scores_again, name), getattr(scores, name)[part], err_msg=name)


def test_bound_is_the_riccati_recursion_at_the_truth():
    """The textbook recursion with F and H at the true states (Van Trees and Bell 2007; Tichavsky et al. 1998)."""
    layout, truth, z, _ = runs_of("satellite")
    problem, dt = layout.problem, 15.0
    _, covariance, scores = filter_runs(layout, z, truth, at_truth=True)
    assert_allclose(scores.squared, 0.0, atol=1e-12)
    for run in (0, RUNS - 1):
        P, spread = problem.covariance, []
        Phi = problem.step(truth[run], dt, layout.times)[1]
        H = problem.measurement_jacobian("earth", truth[run], layout.times)
        for k in range(EPOCHS):
            P = P if k == 0 else Phi[k - 1] @ P @ Phi[k - 1].T + dt * problem.process_noise.covariance
            S = H[k] @ P @ H[k].T + problem.stations[0].noise
            P = P - P @ H[k].T @ np.linalg.solve(S, H[k] @ P)
            spread.append(P[0, 0] + P[1, 1])
        assert_allclose(scores.spread[run, 0], spread, rtol=1e-8)
        assert_allclose(covariance[run], P, rtol=1e-6, atol=1e-9 * np.abs(P).max())


def test_uncompiled_runs_are_the_same(monkeypatch):
    layout, truth, z, (mean, _, scores) = runs_of("b612")
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = layout.problem
    first, w, v = drawn(problem, RUNS)
    plain_truth, plain_z = simulate_runs(layout, problem, first[:2], w[:2], v[:2])
    assert_allclose(plain_truth, truth[:2], rtol=1e-11, atol=1e-11)
    assert_allclose(plain_z, z[:2], rtol=1e-11, atol=1e-11)
    plain_mean, _, plain_scores = filter_runs(layout, z[:2], truth[:2])
    assert_allclose(plain_mean, mean[:2], rtol=1e-10, atol=1e-10)
    assert_allclose(plain_scores.nees, scores.nees[:2], rtol=1e-7)


@pytest.mark.parametrize("rank", [0, 1, 3, 4])
def test_root_of_a_semidefinite_matrix(rank):
    Q = random_covariance(np.random.default_rng(rank), 4, rank)
    L = semidefinite_root(Q)
    assert_allclose(L @ L.T, Q, atol=1e-12)
    assert_array_equal(L, np.tril(L))


def test_which_problems_make_ensembles():
    assert satellite().runs_in_ensemble
    assert b612().runs_in_ensemble
    assert not satellite(method="integral").runs_in_ensemble
    assert not satellite(pz.Kepler(), method="scaled").runs_in_ensemble
    assert not satellite(manoeuvres=[pz.Manoeuvre(30.0, [1.0, 0.0])]).runs_in_ensemble
