"""Tests of one run: on linear problems everything they rest on is known, and they reject a share of 5 % of matched runs."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.evaluate.bounds import linearized, posterior_bounds
from piazzi.evaluate.consistency_tests import check_consistency, error_correlation, own_innovations
from piazzi.evaluate.metrics import nees
from tests.laws.problems import b612, linear, network, random_covariance, random_stable

K = 5


def two_stations(seed: int = 3, rank: int | None = None) -> pz.Problem:
    """Three states, two stations at each epoch, correlated noise; the second sees two components."""
    rng = np.random.default_rng(seed)
    H = [rng.standard_normal((1, 3)), rng.standard_normal((2, 3))]
    R, Q = [random_covariance(rng, 1), random_covariance(rng, 2)], random_covariance(rng, 3, rank)
    return linear(random_stable(rng, 3), H, R, Q, pz.Gaussian(np.zeros(3), random_covariance(rng, 3)))


def drawn(problem, seed=0, epochs=K):
    return pz.simulate(problem, np.arange(float(epochs)), np.random.default_rng(seed))


def errors_by_source(problem, estimator, view):
    """Errors of all epochs (K n) for a unit of every independent source of error: first state, process noise, noise.

    The estimators are linear here, so these columns T have Cov(errors) = T T^T.
    """
    n = problem.model.n
    A = np.array([[problem.parameters[f"a{i}_{j}"] for j in range(n)] for i in range(n)])
    blank = drawn(problem)
    sources = [np.linalg.cholesky(problem.covariance)]
    values, vectors = np.linalg.eigh(problem.process_noise.covariance)
    noise = vectors * np.sqrt(np.maximum(values, 0.0))
    columns = []
    for k in range(K):
        for w in (sources[0] if k == 0 else noise).T:
            truth, x = np.zeros((K, n)), w
            for j in range(k, K):
                truth[j] = x
                x = A @ x
            columns.append((truth, np.zeros((len(blank.values), 2))))
    stations = blank.stations_of(problem)
    for row, s in enumerate(stations):
        L = np.linalg.cholesky(problem.stations[s].noise)
        for v in L.T:
            z = np.zeros((len(blank.values), 2))
            z[row, : len(v)] = v
            columns.append((np.zeros((K, n)), z))
    out = []
    for truth, v in columns:
        z = v.copy()
        for row, s in enumerate(stations):
            h = problem.measure(problem.stations[s].name, truth[row // 2])
            z[row, : len(h)] += h
        z[np.isnan(blank.values)] = np.nan
        estimate = estimator.estimate(problem, pz.Tracking(blank.row_times, z, blank.row_stations))
        estimate = estimate.delayed if view == "delayed" and estimate.delayed is not None else estimate
        out.append((estimate.mean - truth).ravel())
    return np.array(out).T


CASES = [
    (pz.ExtendedKalmanFilter(), "realtime", True),
    (pz.FactorGraph(), "delayed", True),
    (pz.SlidingWindow(3), "delayed", False),  # errors of neighbours only: they are no Markov chain
    (pz.SlidingWindow(1), "delayed", True),
]


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize(("estimator", "view", "markov"), CASES)
@pytest.mark.parametrize("rank", [None, 1])
def test_correlation_of_errors_in_time_is_the_true_one(estimator, view, markov, rank):
    problem = two_stations(rank=rank)
    T = errors_by_source(problem, estimator, view)
    C = (T @ T.T).reshape(K, 3, K, 3).transpose(0, 2, 1, 3)
    estimate = estimator.estimate(problem, drawn(problem))
    estimate = estimate.delayed if view == "delayed" and estimate.delayed is not None else estimate
    assert_allclose(C[range(K), range(K)], estimate.covariance, atol=1e-10)  # matched: the covariance is right
    R = error_correlation(estimate, linearized(problem, estimate.tracking, estimate.mean))
    L = np.linalg.cholesky(estimate.covariance)
    for j in range(K):
        product = np.eye(3)
        for k in range(j + 1, K if markov else min(j + 2, K)):
            product = product @ R[k - 1]
            whitened = np.linalg.solve(L[k], np.linalg.solve(L[j], C[j, k]).T).T
            assert_allclose(product, whitened, atol=1e-8)


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("estimator", [pz.ExtendedKalmanFilter(), pz.FactorGraph(), pz.SlidingWindow(2)])
def test_innovations_are_whitened_as_by_the_covariance_of_all_measurements(estimator):
    """Rows of one epoch against each other too: standardised innovations are L^-1 (z - mean) for Cov(all z) = L L^T."""
    problem = two_stations()
    tracking = drawn(problem, seed=2)
    holes = tracking.values.copy()
    holes[3, 1] = np.nan
    tracking = pz.Tracking(tracking.row_times, holes, tracking.row_stations, tracking.truth)
    A = np.array([[problem.parameters[f"a{i}_{j}"] for j in range(3)] for i in range(3)])
    H = {s.name: problem.measurement_jacobian(s.name, np.zeros(3)) for s in problem.stations}
    P, blocks = problem.covariance, []
    for _ in range(K):
        blocks.append(P)
        P = A @ P @ A.T + problem.process_noise.covariance
    rows = [(int(t), H[name]) for t, name in zip(tracking.row_times, tracking.row_stations, strict=True)]

    def joint(a, b):
        (j, h), (k, g) = rows[a], rows[b]
        cross = np.linalg.matrix_power(A, j - k) @ blocks[k] if j >= k else (np.linalg.matrix_power(A, k - j) @ blocks[j]).T
        noise = problem.stations[int(tracking.stations_of(problem)[a])].noise if a == b else 0.0
        return h @ cross @ g.T + noise

    V = np.block([[joint(a, b) for b in range(len(rows))] for a in range(len(rows))])
    z = np.concatenate([tracking.values[r, : len(h)] for r, (_, h) in enumerate(rows)])
    there = ~np.isnan(z)
    white = np.linalg.solve(np.linalg.cholesky(V[np.ix_(there, there)]), z[there])
    estimate = estimator.estimate(problem, tracking)
    found = own_innovations(estimate, linearized(problem, tracking, estimate.mean))
    assert_allclose(found[~np.isnan(found)], white, atol=1e-9)


@pytest.mark.usefixtures("uncompiled")
def test_the_bound_of_a_linear_problem_is_the_covariance_itself():
    problem = two_stations()
    tracking = drawn(problem)
    bounds = posterior_bounds(problem, tracking)
    assert_allclose(bounds.realtime, pz.ExtendedKalmanFilter().estimate(problem, tracking).covariance, atol=1e-10)
    assert_allclose(bounds.delayed, pz.FactorGraph().estimate(problem, tracking).covariance, atol=1e-10)
    assert_allclose(bounds.states, pz.ExtendedKalmanFilter().estimate(problem, tracking).mean, atol=1e-9)
    early = replace(problem, prior_time=-1.0)
    assert_allclose(
        posterior_bounds(early, tracking).realtime, pz.ExtendedKalmanFilter().estimate(early, tracking).covariance, atol=1e-10
    )
    bare = pz.Tracking(tracking.row_times, tracking.values, tracking.row_stations)
    assert posterior_bounds(problem, bare) is None


@pytest.mark.usefixtures("uncompiled")
def test_the_bound_of_a_nonlinear_problem_is_the_filters_covariance_at_the_truth():
    """Noiseless measurements and a prior at the truth: the filter never leaves it."""
    problem = network(np.random.default_rng(2), process_noise=pz.ProcessNoise(np.zeros(4), "step"))
    still = replace(problem, truth=pz.Truth(state=problem.prior.mean, measurement_noise=False))
    tracking = pz.simulate(still, 0.3 * np.arange(6), np.random.default_rng(0))
    estimate = pz.ExtendedKalmanFilter().estimate(still, tracking)
    sigma = np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))
    difference = posterior_bounds(still, tracking).realtime - estimate.covariance
    assert np.abs(difference / (sigma[:, :, None] * sigma[:, None, :])).max() < 1e-6


@pytest.mark.usefixtures("uncompiled")
def test_bounds_are_the_same_bits_in_blocks_of_any_size(monkeypatch):
    problem = two_stations()
    tracking = drawn(problem)

    def arrays():
        found = linearized(problem, tracking, tracking.truth)
        bounds = posterior_bounds(problem, tracking)
        return [bounds.realtime, bounds.delayed, bounds.states, found.updated, found.whitened, found.states]

    whole = arrays()
    monkeypatch.setattr("piazzi.evaluate.bounds._BLOCK", 3)
    for a, b in zip(whole, arrays(), strict=True):
        assert_array_equal(a, b)


def test_bounds_of_long_runs_take_little_more_memory_than_they_have_numbers():
    problem, epochs = b612(), 100_000
    tracking = pz.simulate(problem, np.arange(epochs) * 0.1, np.random.default_rng(0))
    posterior_bounds(problem, pz.simulate(problem, np.arange(5) * 0.1, np.random.default_rng(0)))  # all modules are there
    tracemalloc.start()
    try:
        bounds = posterior_bounds(problem, tracking)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3 * (bounds.realtime.nbytes + bounds.delayed.nbytes + bounds.states.nbytes)


@pytest.mark.usefixtures("uncompiled")
def test_what_cannot_be_tested_is_none():
    problem = two_stations()
    tracking = drawn(problem)
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    one = pz.Tracking(tracking.row_times[:2], tracking.values[:2], tracking.row_stations[:2], tracking.truth[:1])
    single = pz.ExtendedKalmanFilter().estimate(problem, one)
    found = check_consistency(single, nees(single))
    assert found.nees.effective == pytest.approx(1)
    assert found.whiteness is None
    assert found.bias is None
    assert check_consistency(estimate, None).nees is None
    assert check_consistency(estimate, None).nis is not None
    assert check_consistency(replace(estimate, failure="no"), nees(estimate)).nis is None


# ---- the size of the tests -----------------------------------------------------------------------------------------------

STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
NOISE = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
RUNS, EPOCHS = 500, 200


def manoeuvring(factor: float = 1.0) -> pz.Problem:
    """Position and velocity on a line under white acceleration of 1 m^2/s^3, seen by its position to 1 m every second."""
    prior = pz.Gaussian(np.zeros(2), np.diag([100.0, 10.0]))
    return linear(STEP, [np.array([[1.0, 0.0]])], [np.eye(1)], factor * NOISE, prior)


def rejected(believed: pz.Problem, estimator: pz.ExtendedKalmanFilter, view: str, runs: int) -> dict[str, float]:
    """Share of runs of the true problem that each test rejects."""
    truth, out = manoeuvring(), []
    for seed in range(runs):
        estimate = estimator.estimate(believed, drawn(truth, 7000 + seed, EPOCHS))
        estimate = estimate.delayed if view == "delayed" and estimate.delayed is not None else estimate
        found = check_consistency(estimate, nees(estimate))
        out.append([not check.passed for check in (found.nees, found.nees_last_half, found.nis, found.whiteness, found.bias)])
    return dict(zip(("nees", "nees_last_half", "nis", "whiteness", "bias"), np.mean(out, axis=0).tolist(), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "view"),
    [(pz.ExtendedKalmanFilter(), "realtime"), (pz.FactorGraph(), "delayed"), (pz.SlidingWindow(10), "delayed")],
)
def test_one_matched_run_in_twenty_is_rejected(estimator, view):
    """5 % within 2 %, over 500 runs."""
    shares = rejected(manoeuvring(), estimator, view, RUNS)
    print("\nrejected of matched runs:", type(estimator).__name__, shares)
    assert all(0.03 <= share <= 0.07 for share in shares.values()), shares


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_a_process_noise_that_is_off_by_ten_is_found(factor):
    """At least 95 % of runs, by each of the tests that can: too much or too little noise is no bias."""
    shares = rejected(manoeuvring(factor), pz.ExtendedKalmanFilter(), "realtime", RUNS)
    print(f"\nrejected with Q times {factor:g}:", shares)
    assert min(shares[name] for name in ("nees", "nees_last_half", "nis", "whiteness")) >= 0.95
