"""Unknown constants: an estimated one is a state without noise, a considered one adds what an augmented least squares says."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import passes, spacecraft, spacecraft_model
from tests.laws.problems import assert_same_estimate, b612, random_covariance, random_stable

SEEDS = st.integers(0, 2**32 - 1)
ESTIMATORS = {
    "ekf": pz.ExtendedKalmanFilter(),
    "window": pz.SlidingWindow(8),
    "graph": pz.FactorGraph(tolerance=1e-9),
    "smoother": pz.Smoother(),
    "batch": pz.BatchLeastSquares(tolerance=1e-9),
}


# ---- estimated -------------------------------------------------------------------------------------------------------


def with_bias_as_state():
    """The spacecraft problem with the range bias written as a fifth state that stays as it is."""
    model, problem = spacecraft_model(), spacecraft()
    kept = tuple(p for p in model.parameters if p.name != "bias")
    extended = pz.Model((*model.states, "bias"), (*model.dynamics, "0"), model.sensors, kept)
    prior = pz.Gaussian([*problem.prior.mean, 0.0], np.diag([*np.diag(problem.prior.covariance), 1e4]))
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4, 0.0])
    parameters = {k: v for k, v in problem.parameters.items() if k != "bias"}
    return pz.Problem(extended, prior, noise, problem.stations, parameters, problem.integrator)


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimated_constant_is_a_state_without_noise(name):
    """The graph solves one beside the chain and the other in it."""
    problem, tracking = spacecraft(), passes(spacecraft())
    estimate = ESTIMATORS[name].estimate(problem, tracking)
    as_state = ESTIMATORS[name].estimate(
        with_bias_as_state(), pz.Tracking(tracking.row_times, tracking.values, tracking.row_stations)
    )
    assert estimate.success, estimate.message
    assert as_state.success, as_state.message
    assert_same_estimate(estimate, as_state, 1e-5)
    if name == "graph":
        assert (estimate.details["solver"], as_state.details["solver"]) == ("bordered", "chain")


def linear_with_constant(rng, n, role, Q, where="parameter"):
    """x' = A x + g c, z = H x + d c + noise, with an uncertain constant c, of the model or of the station."""
    A, g, H = random_stable(rng, n) + 0.3 * np.eye(n), rng.standard_normal(n), rng.standard_normal((2, n))
    d, R = rng.standard_normal(2), random_covariance(rng, 2)
    name = "c" if where == "parameter" else "own"
    rows = [" + ".join(f"({float(A[i, j])!r})*x{j}" for j in range(n)) for i in range(n)]
    if where == "parameter":
        rows = [f"{row} + ({float(g[i])!r})*c" for i, row in enumerate(rows)]
    else:
        g = np.zeros(n)
    seen = {
        f"z{i}": " + ".join(f"({float(H[i, j])!r})*x{j}" for j in range(n)) + f" + ({float(d[i])!r})*{name}" for i in range(2)
    }
    parameters = [pz.Parameter("c", role)] if where == "parameter" else []
    model = pz.Model([f"x{i}" for i in range(n)], rows, [pz.Sensor("s", seen)], parameters, discrete=True)
    m, P, c = rng.standard_normal(n), random_covariance(rng, n), pz.Gaussian(0.7, 0.3**2)
    numbers = {} if where == "parameter" else {"own": c}
    station = pz.Station("here", "s", R, numbers, considered=["own"] if numbers and role == "considered" else ())
    problem = pz.Problem(model, pz.Gaussian(m, P), pz.ProcessNoise(Q, "step"), [station], {"c": c} if parameters else {})
    return problem, (A, g, H, d, R, m, P)


def augmented_least_squares(matrices, Q, z, constant):
    """Whitened Jacobians of all residuals by the states and by the constant, and the residuals at zero, of the full problem."""
    A, g, H, d, R, m, P = matrices
    n, K = len(A), len(z)
    rows_x, rows_c, rhs = [], [], []

    def add(covariance, by_state, by_constant, value):
        L = np.linalg.cholesky(covariance)
        rows_x.append(np.linalg.solve(L, by_state))
        rows_c.append(np.linalg.solve(L, by_constant))
        rhs.append(np.linalg.solve(L, value))

    def block(k, matrix):
        out = np.zeros((len(matrix), K * n))
        out[:, k * n : (k + 1) * n] = matrix
        return out

    add(P, block(0, np.eye(n)), np.zeros(n), m)
    for k in range(1, K):
        add(Q, block(k, np.eye(n)) - block(k - 1, A), -g, np.zeros(n))
    for k in range(K):
        add(R, block(k, H), d, z[k])
    return np.vstack(rows_x), np.concatenate(rows_c), np.concatenate(rhs)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("where", ["parameter", "station"])
@given(n=st.integers(1, 4), seed=SEEDS)
@settings(max_examples=10)
def test_estimated_constant_against_dense_least_squares(where, n, seed):
    rng = np.random.default_rng(seed)
    Q = random_covariance(rng, n)
    problem, matrices = linear_with_constant(rng, n, "estimated", Q, where)
    z = rng.standard_normal((5, 2))
    J_x, J_c, rhs = augmented_least_squares(matrices, Q, z, None)
    J = np.vstack([np.column_stack([J_x, J_c]), [*np.zeros(J_x.shape[1]), 1 / 0.3]])
    covariance = np.linalg.inv(J.T @ J)
    solution = covariance @ J.T @ np.append(rhs, 0.7 / 0.3)
    estimate = pz.FactorGraph().estimate(problem, pz.Tracking(np.arange(5.0), z))
    assert estimate.success, estimate.message
    assert estimate.details["solver"] == "bordered"
    assert estimate.names[-1] == ("c" if where == "parameter" else "own_here")
    for k in range(5):
        at = [*range(k * n, (k + 1) * n), 5 * n]
        assert_allclose(estimate.mean[k], solution[at], rtol=0, atol=1e-8)
        assert_allclose(estimate.covariance[k], covariance[np.ix_(at, at)], rtol=0, atol=1e-8)


# ---- considered ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("where", ["parameter", "station"])
@given(n=st.integers(1, 3), seed=SEEDS)
@settings(max_examples=5)
def test_considered_constant_against_augmented_least_squares(where, n, seed):
    """P + s s^T with s = -(J_x^T J_x)^-1 J_x^T J_c sigma (Tapley, Schutz and Born 2004, eq. 6.3), for all estimators."""
    rng = np.random.default_rng(seed)
    Q = random_covariance(rng, n)
    problem, matrices = linear_with_constant(rng, n, "considered", Q, where)
    z = rng.standard_normal((5, 2))
    J_x, J_c, rhs = augmented_least_squares(matrices, Q, z, None)
    own = np.linalg.inv(J_x.T @ J_x)
    solution = own @ J_x.T @ (rhs - 0.7 * J_c)
    s = -own @ J_x.T @ J_c * 0.3
    for name in ("ekf", "window", "smoother", "graph"):
        estimate = ESTIMATORS[name].estimate(problem, pz.Tracking(np.arange(5.0), z))
        assert estimate.success, estimate.message
        last = slice(4 * n, 5 * n)
        assert_allclose(estimate.mean[-1], solution[last], rtol=0, atol=1e-7)
        assert_allclose(estimate.covariance[-1], own[last, last] + np.outer(s[last], s[last]), rtol=0, atol=1e-7)
        smoothed = estimate if estimate.view == "delayed" else estimate.delayed
        if smoothed is not None:
            for k in range(5):
                at = slice(k * n, (k + 1) * n)
                assert_allclose(smoothed.covariance[k], own[at, at] + np.outer(s[at], s[at]), rtol=0, atol=1e-7)


@pytest.mark.slow
def test_considered_constant_keeps_a_filter_honest():
    """Over 300 recordings with a drawn range bias that nobody estimates: NEES is that of five, less without considering it."""
    model = b612().model
    biased = replace(
        model,
        sensors=(pz.Sensor("range", ["sqrt((x - mx)**2 + (y - my)**2) + b"]),),
        groups=dict(model.groups),
        units={},
        memory={},
    )
    scores = {True: [], False: []}
    for seed in range(300):
        rng = np.random.default_rng(seed)
        bias = 0.5 * rng.standard_normal()
        station = pz.Station("radar", "range", 0.01, {"mx": 10.0, "my": 0.0, "b": bias})
        truth = b612((0.0, 0.0, 1e-4, 1e-4)).truth
        actual = pz.Problem(biased, b612().prior, pz.ProcessNoise([0.0] * 4, "step"), [station], {"mu": 1000.0}, truth=truth)
        tracking = pz.simulate(actual, np.arange(40) * 0.1, rng)
        for considered in (True, False):
            numbers = {"mx": 10.0, "my": 0.0, "b": pz.Gaussian(0.0, 0.25) if considered else 0.0}
            own = pz.Station("radar", "range", 0.01, numbers, considered=["b"] if considered else ())
            estimate = pz.FactorGraph().estimate(replace(actual, stations=[own], truth=None), tracking)
            assert estimate.success, estimate.message
            error = estimate.mean[-1] - tracking.truth[-1]
            scores[considered].append(error @ np.linalg.solve(estimate.covariance[-1], error))
    assert np.mean(scores[False]) > 12
    assert np.mean(scores[True]) < 6


def test_considered_parameters_need_the_whole_run():
    station = pz.Station("radar", "range", 0.01, {"mx": pz.Gaussian(10.0, 0.01), "my": 0.0}, considered=["mx"])
    problem = b612(stations=[station])
    for estimator in (pz.ExtendedKalmanFilter(), pz.SlidingWindow(5)):
        with pytest.raises(ValueError, match=r"'mx_radar' is considered, which needs the whole run"):
            estimator.start(problem)
