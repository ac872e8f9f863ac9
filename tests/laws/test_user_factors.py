"""A user's own factor over two neighbouring states, against dense least squares written here."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz

K, DT = 12, 0.7
Q = np.array([[0.1, 0.02], [0.02, 0.3]])
P0 = np.diag([1.0, 2.0])
R_POSITION, R_FACTOR = 0.2, 0.05


@pytest.fixture
def problem():
    model = pz.Model(
        ["x", "v"],
        ["v", "-0.3*x"],
        [pz.Sensor("position", ["x"]), pz.Sensor("odometer", ["x - x_before - 0.4*v + 0.1"])],
        memory={"x_before": "x"},
    )
    stations = [pz.Station("a", "position", R_POSITION), pz.Station("wheel", "odometer", R_FACTOR)]
    return pz.Problem(model, pz.Gaussian([1, 0], P0), pz.ProcessNoise(Q, per="step"), stations)


@pytest.fixture
def tracking():
    return pz.Tracking(np.arange(K) * DT, np.random.default_rng(1).normal(size=K))


def dense(problem, z):
    """Mean and covariance by stacking every whitened factor into one least-squares problem."""
    F = problem.step(np.zeros(3), DT)[1][:2, :2]
    rows, values = [], []

    def factor(blocks, value, covariance):
        A = np.zeros((len(value), 2 * K))
        for k, block in blocks.items():
            A[:, 2 * k : 2 * k + 2] = block
        L = np.linalg.cholesky(covariance)
        rows.append(np.linalg.solve(L, A))
        values.append(np.linalg.solve(L, value))

    factor({0: np.eye(2)}, np.array([1.0, 0.0]), P0)
    for k in range(K):
        factor({k: np.array([[1.0, 0.0]])}, z[k], np.array([[R_POSITION]]))
    for k in range(1, K):
        factor({k: np.eye(2), k - 1: -F}, np.zeros(2), Q)
        factor({k: np.array([[1.0, -0.4]]), k - 1: np.array([[-1.0, 0.0]])}, np.array([-0.1]), np.array([[R_FACTOR]]))
    A = np.vstack(rows)
    covariance = np.linalg.pinv(A.T @ A)
    return np.linalg.lstsq(A, np.concatenate(values), rcond=None)[0].reshape(K, 2), covariance


def test_a_factor_between_neighbours_is_what_dense_least_squares_makes_of_it(problem, tracking, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    graph = pz.FactorGraph(tolerance=1e-10).estimate(problem, tracking.with_factor(problem, "wheel"))
    mean, covariance = dense(problem, tracking.values)
    assert graph.success
    assert_allclose(graph.mean[:, :2], mean, atol=1e-12)
    for k in range(K):
        assert_allclose(graph.covariance[k][:2, :2], covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2], atol=1e-12)
    assert_allclose(graph.mean[1:, 2], graph.mean[:-1, 0], atol=1e-12)  # the memory holds the smoothed state before


def test_a_window_of_all_states_agrees_with_the_graph_about_the_factor(problem, tracking, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    with_factor = tracking.with_factor(problem, "wheel")
    graph = pz.FactorGraph().estimate(problem, with_factor)
    window = pz.SlidingWindow(lag=K, iterations=3).estimate(problem, with_factor)
    assert_allclose(window.delayed.mean, graph.mean, atol=1e-10)
    assert_allclose(window.delayed.covariance, graph.covariance, atol=1e-10)


def test_what_a_factor_cannot_hold_at_is_named(problem, tracking):
    with pytest.raises(ValueError, match=r"factor 'wheel' is wanted at t = 0\.35 s, which is not an epoch"):
        tracking.with_factor(problem, "wheel", times=[0.35])
    with pytest.raises(ValueError, match="unknown station 'wheels'; did you mean 'wheel'"):
        tracking.with_factor(problem, "wheels")
    with pytest.raises(ValueError, match="memory 'y_before' is of 'y', which is not a state"):
        pz.Model(["x"], ["-x"], memory={"y_before": "y"})
