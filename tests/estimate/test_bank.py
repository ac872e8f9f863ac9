"""A bank of starts: what it finds, how probable that is, and that it helps where the usual start does not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.estimate.bank import Paths
from tests.laws.graphs import LinearCase
from tests.laws.problems import assert_same_estimate, b612

TIMES = np.arange(100) * 0.1


def mirrored(vy=0.0, Q=(0.0, 0.0, 0.01, 0.01)):
    """B612 with a prior that does not know which way round the probe goes, and ranges that do not tell."""
    prior = pz.Gaussian([12.0, 0.0, 0.0, vy], np.diag([1.0, 1.0, 1.0, 100.0]))
    problem = b612(Q, prior=prior)
    return problem, pz.simulate(problem, TIMES, np.random.default_rng(1))


def test_twins_are_found_and_equally_probable():
    """Ranges from a station on the x axis are the same for a track and its mirror image, and so is this prior."""
    problem, tracking = mirrored()
    estimate = pz.FactorGraph(start="bank").estimate(problem, tracking)
    assert estimate.success, estimate.message
    first, second = estimate.details["modes"]
    assert first["probability"] == pytest.approx(0.5, abs=1e-4)
    assert first["probability"] + second["probability"] == pytest.approx(1.0)
    a, b = estimate.details["mode_states"]
    sigma = np.sqrt(np.diagonal(estimate.covariance, axis1=1, axis2=2))
    assert (np.abs(a - b * [1, -1, 1, -1]) / sigma).max() < 1e-3
    assert_allclose(a, estimate.mean, atol=1e-5)
    assert_allclose(first["state"], a[0])
    distance = [np.abs(states - tracking.truth).max() for states in (a, b)]
    assert min(distance) < 1.0
    assert max(distance) > 10.0


def test_given_paths_are_weighed_as_members_are():
    """From near each twin: both are found, and the details are those of a bank."""
    problem, tracking = mirrored()
    bank = pz.FactorGraph(start="bank").estimate(problem, tracking)
    a, b = bank.details["mode_states"]
    found = pz.FactorGraph(start=Paths((b + 0.01, a + 0.01))).estimate(problem, tracking)
    assert found.success, found.message
    assert [mode["probability"] for mode in found.details["modes"]] == pytest.approx([0.5, 0.5], abs=1e-4)
    assert_allclose(np.sort(found.details["mode_states"][:, 0], axis=0), np.sort(np.stack([a, b])[:, 0], axis=0), atol=1e-4)


def test_a_prior_that_leans_one_way_makes_that_twin_the_more_probable_one():
    """By as much as the prior's density: all else is the same for both."""
    problem, tracking = mirrored(vy=1.0)
    estimate = pz.FactorGraph(start="bank").estimate(problem, tracking)
    a, b = estimate.details["modes"]
    vy = a["state"][3]
    assert vy > 0 > b["state"][3]
    ratio = np.exp(((vy + 1.0) ** 2 - (vy - 1.0) ** 2) / 200.0)
    assert a["probability"] / b["probability"] == pytest.approx(ratio, rel=0.01)


def test_the_bank_helps_where_the_usual_start_does_not():
    """From the mean of a prior that is the same on both sides, everything stays between the twins."""
    problem, tracking = mirrored(Q=(0.0, 0.0, 0.0, 0.0))
    usual = pz.FactorGraph().estimate(problem, tracking)
    assert not usual.success or usual.details["cost"] > 1000
    bank = pz.FactorGraph(start="bank").estimate(problem, tracking)
    assert bank.success, bank.message
    assert bank.details["cost"] < 0.7 * len(TIMES)  # half the sum of about 100 unit squares
    assert len(bank.details["modes"]) == 2


def test_the_same_bytes_every_time():
    problem, tracking = mirrored()
    a, b = (pz.FactorGraph(start=pz.Bank(6)).estimate(problem, tracking) for _ in range(2))
    assert a.mean.tobytes() == b.mean.tobytes()
    assert a.details["modes"] == b.details["modes"]


@pytest.mark.parametrize("solver", ["chain", "bordered"])
@pytest.mark.parametrize("rank", [None, 0])
def test_a_linear_problem_has_one_mode_and_laplace_is_exact(monkeypatch, rank, solver):
    """log N(z; H m, H P H^T + R) by dense algebra: equal up to a constant, whatever the measurements and the prior's width."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    offsets = []
    case = LinearCase(3, (2, 1), seed=9, rank=rank, missing=0.2, epochs=8)
    for scale in (1.0, 30.0):
        problem = pz.Problem(
            case.problem.model,
            pz.Gaussian(case.m, scale * case.P),
            case.problem.process_noise,
            case.problem.stations,
            case.problem.parameters,
        )
        for size in (0.1, 1.0):
            tracking = pz.Tracking(case.tracking.row_times, size * case.values, case.tracking.row_stations)
            estimate = pz.FactorGraph(start="bank", solver=solver).estimate(problem, tracking)
            assert estimate.details["solver"] == solver
            (mode,) = estimate.details["modes"]
            assert mode["probability"] == 1.0
            assert_same_estimate(estimate, pz.FactorGraph().estimate(problem, tracking), 1e-6)
            offsets.append(mode["log_evidence"] - log_evidence(case, scale, size))
    assert_allclose(offsets, offsets[0], atol=1e-7)


def log_evidence(case, scale, size):
    """Logarithm of the density of all measurements, states integrated out."""
    n, K = len(case.m), case.epochs
    mean, covariance = [case.m], np.zeros((K * n, K * n))
    covariance[:n, :n] = scale * case.P
    for k in range(1, K):
        mean.append(case.A @ mean[-1])
        now, before = slice(k * n, k * n + n), slice(k * n - n, k * n)
        covariance[now, : k * n] = case.A @ covariance[before, : k * n]
        covariance[: k * n, now] = covariance[now, : k * n].T
        covariance[now, now] = case.A @ covariance[before, before] @ case.A.T + case.Q
    rows, R, residual = [], [], []
    for k, s in enumerate(case.seen):
        there = ~np.isnan(s.z)
        h = np.zeros((int(there.sum()), K * n))
        h[:, k * n : k * n + n] = s.H[there]
        rows.append(h)
        R.append(s.R[np.ix_(there, there)])
        residual.append(size * s.z[there] - s.H[there] @ mean[k])
    H, r = np.vstack(rows), np.concatenate(residual)
    S = H @ covariance @ H.T
    at = 0
    for block in R:
        S[at : at + len(block), at : at + len(block)] += block
        at += len(block)
    return -0.5 * (r @ np.linalg.solve(S, r) + np.linalg.slogdet(S)[1])


LEVELS = np.array([0.0, 0.1, -0.1, 0.0, 6.0, 10.0, 14.0, 18.0, 22.0])


def constant(loss):
    """A constant measured with unit noise, four good rows and five that spread; and its cost as a function of the constant."""
    model = pz.Model(["x"], ["0"], [pz.Sensor("level", ["x"])])
    problem = pz.Problem(model, pz.Gaussian(3.0, 100.0), None, [pz.Station("a", "level", 1.0)])

    def cost(x):
        s = (LEVELS[:, None] - np.atleast_1d(x)) ** 2
        return 0.5 * loss.cost(s, np.float64(loss.k**2)).sum(axis=0) + 0.5 * (np.atleast_1d(x) - 3.0) ** 2 / 100.0

    return problem, pz.Tracking(np.arange(9.0), LEVELS), cost


@pytest.mark.parametrize("loss", [pz.Tukey(), pz.Cauchy(0.5)], ids=str)
@pytest.mark.parametrize("start", ["bank", np.zeros((9, 1))], ids=["bank", "given"])
def test_a_bank_and_given_states_find_the_true_minimum_of_a_loss_with_several(monkeypatch, loss, start):
    """By the cost on a grid.  Huber's minimum lies in the basin of another one."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking, cost = constant(loss)
    grid = np.linspace(-5.0, 30.0, 350_001)
    values = cost(grid)
    estimate = pz.FactorGraph(start=start, loss=loss).estimate(problem, tracking)
    assert estimate.success, estimate.message
    assert estimate.mean[0, 0] == pytest.approx(grid[values.argmin()], abs=2e-4)
    assert estimate.details["cost"] == pytest.approx(values.min(), rel=1e-9)
    assert_allclose(
        estimate.details["weights"], loss.weight((LEVELS - estimate.mean[0, 0]) ** 2, np.float64(loss.k**2)), atol=1e-5
    )
    if isinstance(start, str):
        modes = estimate.details["modes"]
        assert estimate.details["start"] == "bank"
        assert estimate.details["cost"] == modes[0]["cost"]
        assert_allclose(estimate.details["mode_states"][0], estimate.mean)
        for mode in modes:
            x = mode["state"][0]
            assert mode["cost"] == pytest.approx(cost(x)[0], rel=1e-9)
            assert cost(x)[0] < min(cost(x - 0.01)[0], cost(x + 0.01)[0])


def test_the_start_is_the_usual_one_where_the_bank_finds_no_better(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    case = LinearCase(2, (1,), seed=1, epochs=5)
    estimate = pz.FactorGraph(start="bank").estimate(case.problem, case.tracking)
    assert estimate.details["start"] == "ekf"


def test_where_no_start_leads_anywhere_the_usual_one_is_told(monkeypatch):
    """States, covariance and innovations belong together, and there are no modes."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem, tracking = mirrored()
    tracking = pz.Tracking(tracking.times[:6], tracking.values[:6])
    monkeypatch.setattr("piazzi.estimate.bank.STEPS", 1)
    monkeypatch.setattr("piazzi.estimate.gauss_newton.ACCEPTABLE", 0.0)
    usual = pz.FactorGraph(max_iterations=1).estimate(problem, tracking)
    bank = pz.FactorGraph(start=pz.Bank(3), max_iterations=1).estimate(problem, tracking)
    assert not usual.success
    assert not bank.success
    assert bank.details["modes"] == []
    assert bank.details["mode_states"].shape == (0, 6, 4)
    assert bank.details["start"] == usual.details["start"]
    assert_allclose(bank.mean, usual.mean, rtol=1e-12)
    assert_allclose(bank.covariance, usual.covariance, rtol=1e-9, atol=1e-12)
    assert_allclose(bank.innovation_covariances, usual.innovation_covariances, rtol=1e-9)
    assert bank.iterations > usual.iterations


def test_a_prior_too_wide_for_the_solver_is_not_tried_by_the_members(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("level", ["x"])])
    problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], 1e14 * np.eye(2)), None, [pz.Station("a", "level", 1.0)])
    tracking = pz.Tracking(np.arange(5.0), np.arange(5.0))
    estimate = pz.FactorGraph(start="bank", solver="chain").estimate(problem, tracking)
    assert "too wide" in estimate.message
    assert estimate.details["modes"] == []
    assert estimate.iterations == pz.FactorGraph(solver="chain").estimate(problem, tracking).iterations


def test_members_are_the_mean_and_pairs_about_it_that_cover_the_prior():
    problem = b612()
    points = pz.Bank(401).points(problem)
    assert points.shape == (401, 4)
    assert_allclose(points[0], problem.mean)
    assert_allclose(points.mean(axis=0), problem.mean, atol=1e-12)
    spread = np.cov(points.T)
    assert_allclose(spread, problem.covariance, atol=0.1)
    assert np.array_equal(pz.Bank(7).points(problem), points[:7])


def test_modes_survive_a_file(tmp_path):
    from piazzi.io.netcdf import read_estimate, write_estimate

    problem, tracking = mirrored()
    estimate = pz.FactorGraph(start=pz.Bank(6)).estimate(problem, tracking)
    write_estimate(tmp_path / "twins.nc", estimate)
    back = read_estimate(tmp_path / "twins.nc")
    assert back.details["modes"] == estimate.details["modes"]
    assert_allclose(back.details["mode_states"], estimate.details["mode_states"])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pz.Bank(0), "members is 0"),
        (lambda: pz.Bank(2.5), "members is 2.5"),
        (lambda: pz.Bank(spread=0.0), "spread is 0.0"),
        (lambda: pz.FactorGraph(start="banks"), "start is 'banks'"),
    ],
)
def test_what_is_no_bank_is_refused(make, message):
    with pytest.raises(ValueError) as caught:
        make()
    assert message in str(caught.value)
