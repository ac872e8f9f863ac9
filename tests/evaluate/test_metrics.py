"""Errors and consistency against definitions written out epoch by epoch."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.evaluate import errors, evaluate, has_diverged, nees, nis, rmse
from piazzi.evaluate.metrics import apart, residual_rms, squared_in_sigmas
from tests.evaluate.conftest import made
from tests.laws.problems import b612


def covariances(rng, K, n, condition=1e4):
    """Random covariances (K, n, n) with units that differ by orders of magnitude."""
    q = np.linalg.qr(rng.standard_normal((K, n, n)))[0]
    values = condition ** rng.uniform(-1, 0, (K, 1, n))
    units = 10.0 ** rng.uniform(-3, 6, n)
    return (q * values) @ q.transpose(0, 2, 1) * np.outer(units, units)


def draws(rng, P):
    return np.einsum("kij,kj->ki", np.linalg.cholesky(P), rng.standard_normal(P.shape[:2]))


def everywhere(e):
    return np.ones(e.shape, dtype=bool)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9))
def test_squares_in_sigmas_equal_a_solve_at_each_epoch(seed, n):
    rng = np.random.default_rng(seed)
    P = covariances(rng, 12, n)
    e = draws(rng, P)
    found = squared_in_sigmas(e, P, everywhere(e))
    assert_allclose(found.value, [v @ np.linalg.solve(m, v) for v, m in zip(e, P, strict=True)], rtol=1e-7)
    assert (found.rank == n).all()


@given(st.integers(0, 2**32 - 1))
def test_squares_do_not_depend_on_units(seed):
    rng = np.random.default_rng(seed)
    P = covariances(rng, 5, 4, condition=1e2)
    e, unit = draws(rng, P), 10.0 ** rng.uniform(-8, 8, 4)
    one = squared_in_sigmas(e, P, everywhere(e)).value
    other = squared_in_sigmas(e * unit, P * np.outer(unit, unit), everywhere(e)).value
    assert_allclose(other, one, rtol=1e-8)


def test_their_mean_over_gaussian_errors_is_the_number_of_states():
    rng = np.random.default_rng(4)
    P = covariances(rng, 40_000, 4)
    mean = squared_in_sigmas(draws(rng, P), P, np.ones((len(P), 4), dtype=bool)).mean()
    assert mean == pytest.approx(4, abs=5 * np.sqrt(2 * 4 / len(P)))


def test_missing_components_leave_the_marginal_distribution_of_the_others():
    rng = np.random.default_rng(5)
    P = covariances(rng, 20, 4)
    e = draws(rng, P)
    present = rng.random((20, 4)) < 0.6
    found = squared_in_sigmas(np.where(present, e, np.nan), P, present)
    for k, there in enumerate(present):
        assert found.rank[k] == there.sum()
        if there.any():
            assert_allclose(found.value[k], e[k, there] @ np.linalg.solve(P[k][np.ix_(there, there)], e[k, there]), rtol=1e-9)
        else:
            assert np.isnan(found.value[k])


@pytest.mark.parametrize("n", [2, 4, 6])
def test_a_singular_covariance_counts_the_directions_it_has(n):
    """Errors in the range of P = L L^T with r columns: the square is that of the r numbers that made them."""
    rng = np.random.default_rng(n)
    for r in range(1, n):
        L, y = rng.standard_normal((30, n, r)), rng.standard_normal((30, r))
        found = squared_in_sigmas(np.einsum("kir,kr->ki", L, y), L @ L.transpose(0, 2, 1), np.ones((30, n), dtype=bool))
        assert (found.rank == r).all()
        assert_allclose(found.value, (y**2).sum(axis=1), rtol=1e-6)


def test_a_zero_covariance_says_nothing():
    found = squared_in_sigmas(np.ones((1, 2)), np.zeros((1, 2, 2)), np.ones((1, 2), dtype=bool))
    assert found.rank[0] == 0
    assert found.mean() is None


def test_one_epoch_that_is_not_finite_does_not_touch_the_others():
    e = np.ones((3, 2))
    P = np.tile(np.eye(2), (3, 1, 1))
    P[1, 0, 0] = np.inf
    e[2, 1] = np.nan
    found = squared_in_sigmas(e, P, everywhere(e))
    assert found.value[0] == 2
    assert np.isnan(found.value[1:]).all()
    assert np.isnan(found.mean())


def test_many_epochs_equal_the_same_epochs_in_parts():
    rng = np.random.default_rng(6)
    P = covariances(rng, 40_000, 3)
    e = draws(rng, P)
    whole, part = (
        squared_in_sigmas(e, P, everywhere(e)),
        squared_in_sigmas(e[17:33_000], P[17:33_000], everywhere(e[17:33_000])),
    )
    assert_allclose(whole.value[17:33_000], part.value, rtol=1e-10)


def test_rmse_is_the_root_mean_square_of_the_length_of_the_error():
    error = np.array([[3.0, 4.0, 9.0], [0.0, 0.0, 9.0], [6.0, 8.0, 9.0]])
    assert rmse(error, (0, 1)) == pytest.approx(np.sqrt((25 + 0 + 100) / 3))
    assert rmse(error, (0, 1), slice(1, None)) == pytest.approx(np.sqrt(50))
    assert rmse(None, (0, 1)) is None


def test_errors_are_known_where_the_truth_is():
    estimate = made(np.ones((3, 2)), np.eye(2), truth=[[0, 0], [np.nan, 0], [0, 3]])
    assert_allclose(errors(estimate), [[1, 1], [np.nan, 1], [1, -2]])
    assert_allclose(nees(estimate).value, [2, 1, 5])
    assert_allclose(nees(estimate).rank, [2, 1, 2])


def test_without_truth_there_are_no_errors():
    estimate = made(np.ones((3, 2)), np.eye(2))
    assert errors(estimate) is None
    assert nees(estimate) is None
    unknown = made(np.ones((3, 2)), np.eye(2), truth=np.full((3, 2), np.nan))
    assert errors(unknown) is None


def test_a_truth_of_another_width_is_refused():
    with pytest.raises(ValueError, match=r"truth has 3 columns; the model has 2 states \(a, b\)"):
        errors(made(np.ones((3, 2)), np.eye(2), truth=np.zeros((3, 3))))


def test_nis_is_taken_over_the_measurements_that_are_there():
    estimate = made(
        np.zeros((4, 1)), np.eye(1), nu=[[1.0], [np.nan], [3.0], [2.0]], S=np.array([1.0, np.nan, 9.0, 2.0]).reshape(-1, 1, 1)
    )
    found = nis(estimate)
    assert_allclose(found.value, [1, np.nan, 1, 2])
    assert found.mean() == pytest.approx(4 / 3)


# ---- divergence ----------------------------------------------------------------------------------------------------------

K = 200
NOISE = np.random.default_rng(7).standard_normal((K, 2))
RAMP = np.repeat(np.linspace(0, 1, K)[:, None], 2, axis=1)


@pytest.mark.parametrize(
    ("error", "sigma", "expected"),
    [
        (NOISE, 1.0, False),  # honest
        (3 * NOISE, 1.0, False),  # too confident, but no more than that
        (50 * NOISE, 1.0, True),  # far beyond its covariance, and staying there
        (1000 * RAMP**2, 1.0, True),  # growing without knowing it
        (1000 * RAMP**2, 1000.0, False),  # growing and knowing it
        (1e5 * np.exp(-12 * RAMP), 1.0, False),  # still beyond its covariance in the last half, but coming down
        (np.where(RAMP == 0, 1.0, 1e6 * np.exp(-9 * RAMP)), 1.0, True),  # coming down, but further off than where it began
        (np.where(RAMP > 0.9, np.nan, NOISE), 1.0, True),  # not finite
        (np.where(RAMP < 0.4, 500 * NOISE, NOISE), 1.0, False),  # lost at first, found again
    ],
)
def test_divergence_is_an_error_beyond_its_covariance_that_stays(error, sigma, expected):
    estimate = made(error, sigma**2 * np.eye(2), truth=np.zeros((K, 2)))
    assert has_diverged(estimate) is expected


@pytest.mark.parametrize(("size", "expected"), [(1, False), (4, False), (60, True)])
def test_without_truth_innovations_tell(size, expected):
    estimate = made(np.zeros((K, 2)), np.eye(2), nu=size * NOISE[:, :1])
    assert has_diverged(estimate) is expected


@pytest.mark.parametrize("epochs", [1, 2, 3])
def test_a_run_of_few_epochs_can_be_judged(epochs):
    assert has_diverged(made(1e6 * np.ones((epochs, 2)), np.eye(2), truth=np.zeros((epochs, 2)))) in (True, False)
    assert not has_diverged(made(np.ones((epochs, 2)), np.eye(2), truth=np.zeros((epochs, 2))))


def test_residuals_are_what_the_states_leave_of_the_measurements():
    problem = b612()
    tracking = pz.simulate(problem, np.arange(40) * 0.1, np.random.default_rng(1))
    values = tracking.values.copy()
    values[3] = np.nan
    estimate = pz.FactorGraph().estimate(problem, pz.Tracking(tracking.row_times, values))
    left = values[:, 0] - problem.measure("radar", estimate.mean)[:, 0]
    assert_allclose(estimate.details["residuals"][:, 0], left, rtol=0, atol=1e-9)
    assert residual_rms(estimate) == {"range": pytest.approx(np.sqrt(np.nanmean(left**2)))}
    assert residual_rms(pz.ExtendedKalmanFilter().estimate(problem, tracking)) == {}


@pytest.mark.usefixtures("uncompiled")
def test_residuals_by_unit_are_of_the_states_of_the_estimate():
    """Of an estimator that keeps none, too; of components of one unit together; of the rows that it used."""
    sensor = pz.Sensor("both", {"a": "x", "b": "x + 2*y", "turn": "y"}, units={"a": "m", "b": "m", "turn": "rad"})
    model = pz.Model(["x", "y"], ["0", "0"], [sensor])
    problem = pz.Problem(model, pz.Gaussian([0.0, 0.0], np.eye(2)), stations=[pz.Station("s", "both", [1.0, 1.0, 0.01])])
    values = np.random.default_rng(3).standard_normal((30, 3)) * [1.0, 1.0, 0.1]
    values[4, 1] = np.nan
    values[7] = 50.0
    tracking = pz.Tracking(np.arange(30.0), values)
    for estimator in (pz.ExtendedKalmanFilter(), pz.FactorGraph(), pz.ExtendedKalmanFilter(gate=0.999)):
        estimate = estimator.estimate(problem, tracking)
        left = values - estimate.mean @ np.array([[1.0, 0.0], [1.0, 2.0], [0.0, 1.0]]).T
        if "rejected" in estimate.details:
            assert estimate.details["rejected"].tolist() == [k == 7 for k in range(30)]
            left[7] = np.nan
        expected = {"m": np.sqrt(np.nanmean(left[:, :2] ** 2)), "rad": np.sqrt(np.nanmean(left[:, 2] ** 2))}
        assert evaluate("any", estimate).residual_rms == pytest.approx(expected, rel=1e-12)


def test_how_far_another_ends_is_told_in_its_sigma():
    answer = made(np.zeros((5, 2)), np.diag([1.0, 4.0]))
    other = made(np.array([[9.0, 0.0]] * 4 + [[0.5, 3.0]]), np.diag([0.01, 9.0]))
    assert apart(replace(answer, view="delayed"), replace(other, view="delayed")) == pytest.approx(1.5)  # of the answer
    assert apart(answer, other) == pytest.approx(5.0)  # in real time one's own
    assert apart(answer, answer) == 0.0
