"""Unknown constants: an estimated one is a state without noise, a considered one adds what an augmented least squares says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.scenarios import load_scenario
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

FILTERS = {
    "ekf": pz.ExtendedKalmanFilter(),
    "iekf": pz.ExtendedKalmanFilter(iterations=3),
    "srekf": pz.SquareRootKalmanFilter(),
    "ukf": pz.UnscentedKalmanFilter(),
    "window": pz.SlidingWindow(8),
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
    tracking = pz.Tracking(np.arange(5.0), z)
    estimate = pz.FactorGraph().estimate(problem, tracking)
    assert estimate.success, estimate.message
    assert estimate.details["solver"] == "bordered"
    for estimator in FILTERS.values():
        filtered = estimator.estimate(problem, tracking)
        assert_allclose(filtered.mean[-1], estimate.mean[-1], rtol=0, atol=1e-7)
        assert_allclose(filtered.covariance[-1], estimate.covariance[-1], rtol=0, atol=1e-7)
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
    for estimator in (*FILTERS.values(), pz.Smoother(), pz.FactorGraph(tolerance=1e-9, cross_covariances=True)):
        estimate = estimator.estimate(problem, pz.Tracking(np.arange(5.0), z))
        assert estimate.success, estimate.message
        last = slice(4 * n, 5 * n)
        assert_allclose(estimate.mean[-1], solution[last], rtol=0, atol=1e-7)
        assert_allclose(estimate.covariance[-1], own[last, last] + np.outer(s[last], s[last]), rtol=0, atol=1e-7)
        smoothed = estimate if estimate.view == "delayed" else estimate.delayed
        if smoothed is not None:
            for k in range(5):
                at = slice(k * n, (k + 1) * n)
                assert_allclose(smoothed.covariance[k], own[at, at] + np.outer(s[at], s[at]), rtol=0, atol=1e-7)
    for k, cross in enumerate(estimate.details["cross_covariances"]):
        now, then = slice(k * n, (k + 1) * n), slice((k + 1) * n, (k + 2) * n)
        assert_allclose(cross, own[now, then] + np.outer(s[now], s[then]), rtol=0, atol=1e-7)


@pytest.mark.parametrize("variance", [1e-14, 1e-8])
def test_considered_constant_of_an_angle_at_half_a_turn(variance, monkeypatch):
    """An innovation at the branch cut: its variance is that of noise and offset, or, where the estimate jumps, it is told."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    sensor = pz.Sensor("heading", ["a + offset"], angles=["heading"])
    model = pz.Model(["a"], ["0"], [sensor])
    station = pz.Station("here", "heading", 1e-4, {"offset": pz.Gaussian(0.0, 1e-4)}, considered=["offset"])
    problem = pz.Problem(model, pz.Gaussian([0.0], [variance]), None, [station])
    estimate = pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0], [np.pi - 1e-5]))
    if variance == 1e-14:
        assert estimate.success, estimate.message
        assert estimate.innovation_covariances[0, 0, 0] == pytest.approx(2e-4, rel=1e-6)
    else:
        assert "jumps where the considered parameter 'offset_here' changes" in estimate.message


def test_failed_estimate_with_considered_parameters_predicts_nothing(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    monkeypatch.setattr("piazzi.estimate.gauss_newton.ACCEPTABLE", 0.0)
    station = pz.Station("radar", "range", 0.01, {"mx": pz.Gaussian(10.0, 0.01), "my": 0.0}, considered=["mx"])
    problem = b612(stations=[station])
    tracking = pz.simulate(b612(), np.arange(5) * 0.1, np.random.default_rng(0))
    failed = pz.FactorGraph(max_iterations=1).estimate(problem, tracking)
    assert not failed.success
    with pytest.raises(ValueError, match=r"nothing can be propagated: .*not converged"):
        failed.predict([1.0])


def test_considered_constant_keeps_a_filter_honest():
    """A cart whose place is read with a drawn offset that nobody estimates: over 400 runs NEES is that of two values."""
    seen = pz.Sensor("place", ["x + offset"])
    model = pz.Model(["x", "v"], ["x + dt*v", "v"], [seen], discrete=True)
    prior, noise = pz.Gaussian([0.0, 1.0], [4.0, 0.25]), pz.ProcessNoise([0.0, 0.01], "step")

    def problem(offset, **considered):
        return pz.Problem(model, prior, noise, [pz.Station("ruler", "place", 0.01, {"offset": offset}, **considered)])

    scores = {True: [], False: []}
    for seed in range(400):
        rng = np.random.default_rng(seed)
        tracking = pz.simulate(problem(rng.standard_normal()), np.arange(20.0), rng)
        for told in (True, False):
            own = problem(pz.Gaussian(0.0, 1.0), considered=["offset"]) if told else problem(0.0)
            estimate = pz.ExtendedKalmanFilter().estimate(own, tracking)
            error = estimate.mean[-1] - tracking.truth[-1]
            scores[told].append(error @ np.linalg.solve(estimate.covariance[-1], error))
    assert abs(np.mean(scores[True]) - 2.0) < 2.58 * np.sqrt(2 * 2 / 400)
    assert np.mean(scores[False]) > 20


def test_considered_parameters_need_the_whole_run():
    station = pz.Station("radar", "range", 0.01, {"mx": pz.Gaussian(10.0, 0.01), "my": 0.0}, considered=["mx"])
    problem = b612(stations=[station])
    for estimator in (pz.ExtendedKalmanFilter(), pz.SlidingWindow(5)):
        with pytest.raises(ValueError, match=r"'mx_radar' is considered, which needs the whole run"):
            estimator.start(problem)


@pytest.mark.slow
def test_gravity_of_the_toy_planet_from_a_wrong_guess():
    """mu guessed 5 % off, with a prior sigma of 5 %: over 1000 recordings the last state's NEES is that of five values.

    Within the 95 % bounds of its mean.  The extended Kalman filter, for comparison, is nowhere near.
    """
    given = load_scenario("b612-range-q0")
    old, model = given.problem, given.problem.model
    estimated = pz.Model(model.states, model.dynamics, model.sensors, [pz.Parameter("mu", "estimated")], dict(model.groups))
    truth, guess = pz.Truth(old.truth.state, {"mu": 1000.0}, pz.ProcessNoise([0.0] * 4, "step")), pz.Gaussian(1050.0, 50.0**2)
    problem = pz.Problem(estimated, old.prior, old.process_noise, old.stations, {"mu": guess}, old.integrator, truth=truth)
    scores = {"graph": [], "batch": [], "ekf": []}
    for seed in range(1000):
        tracking = pz.simulate(problem, given.times, np.random.default_rng(seed))
        graph = pz.FactorGraph().estimate(problem, tracking)
        assert graph.success, f"seed {seed}: {graph.message}"
        for name, estimate in (("graph", graph), ("ekf", pz.ExtendedKalmanFilter().estimate(problem, tracking))):
            error = estimate.mean[-1] - tracking.truth[-1]
            scores[name].append(error @ np.linalg.solve(estimate.covariance[-1], error))
        batch = pz.BatchLeastSquares(start=graph.details["first_state"]).estimate(problem, tracking)
        assert batch.success, f"seed {seed}: {batch.message}"
        error = batch.mean[-1] - tracking.truth[-1]
        scores["batch"].append(error @ np.linalg.solve(batch.covariance[-1], error))
    for name in ("graph", "batch"):
        assert abs(np.mean(scores[name]) - 5.0) < 1.96 * np.sqrt(2 * 5 / 1000)
    assert np.median(scores["ekf"]) > 50
