"""Tests of consistency on arrays, against brute force and textbook formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.evaluate import consistency
from piazzi.evaluate.consistency import (
    bias_check,
    chi_square_check,
    epoch_bounds,
    nees_check,
    nis_check,
    paired,
    whiteness_check,
)
from piazzi.evaluate.consistency_tests import standardized
from piazzi.evaluate.metrics import convergence_time
from tests.references.chi_square import mean_bounds


def brute(R, weight):
    """The double sum as it is written."""
    total = 0.0
    for j in range(len(R)):
        product = np.eye(R.shape[1])
        for k in range(j + 1, len(R) + 1):
            product = product @ R[k - 1]
            total += weight[j] * weight[k] * np.sum(product**2)
    return total


@pytest.mark.parametrize("K", [1, 2, 3, 8, 21])
def test_pairs_are_all_summed(K):
    rng = np.random.default_rng(K)
    R, weight = rng.standard_normal((K - 1, 3, 3)) / 2, rng.integers(0, 2, K).astype(float)
    assert_allclose(paired(R, weight), brute(R, weight), rtol=1e-12, atol=1e-12)


def test_blocks_of_pairs_meet(monkeypatch):
    monkeypatch.setattr(consistency, "_BLOCK", 4)
    R = np.random.default_rng(2).standard_normal((13, 2, 2)) / 2
    assert_allclose(paired(R, np.ones(14)), brute(R, np.ones(14)), rtol=1e-12)


def test_independent_epochs_give_the_bounds_of_chi_square():
    value, rank = np.full(50, 2.0), np.full(50, 2)
    check = nees_check(value, rank, np.zeros((49, 2, 2)))
    assert_allclose((check.low, check.high), mean_bounds(2, 50, 0.05), rtol=2e-3)
    assert check.effective == pytest.approx(50)
    assert check.passed


def test_an_error_that_never_changes_is_worth_one_epoch():
    """Without process noise a smoothed error is one error, turned: 95 % of chi-square with n degrees."""
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    check = nees_check(np.full(80, 7.0), np.full(80, 2), np.tile(turn, (79, 1, 1)))
    assert check.effective == pytest.approx(1)
    assert check.low == pytest.approx(-2 * np.log(0.975))  # quantiles of chi-square with two degrees
    assert check.high == pytest.approx(-2 * np.log(0.025))
    assert check.passed


def test_correlated_sums_have_the_bounds_that_simulation_finds():
    """An AR(1) error of one dimension: the mean of its squares, many times over."""
    rng, K, rho, runs = np.random.default_rng(6), 60, 0.9, 20_000
    e = np.empty((runs, K))
    e[:, 0] = rng.standard_normal(runs)
    for k in range(1, K):
        e[:, k] = rho * e[:, k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(runs)
    mean = (e**2).mean(axis=1)
    check = nees_check(np.ones(K), np.ones(K, dtype=int), np.full((K - 1, 1, 1), rho))
    assert_allclose(K / check.effective * 2 / K, mean.var(), rtol=0.05)
    outside = ((mean < check.low) | (mean > check.high)).mean()
    assert 0.03 < outside < 0.07  # the tails of a factor times chi-square are nearly those of the sum


def test_epochs_without_truth_are_left_out():
    value, rank = np.array([np.nan, 3.0, np.nan, 1.0]), np.array([0, 2, 0, 2])
    check = nees_check(value, rank, np.zeros((3, 2, 2)))
    assert (check.statistic, check.effective) == (2.0, pytest.approx(2))
    assert nees_check(value[:1], rank[:1], np.zeros((0, 2, 2))) is None


def test_nis_bounds_are_those_of_chi_square_and_missing_values_do_not_count():
    w = np.ones((40, 2))
    w[::4, 1] = np.nan
    check = nis_check(w, 40)
    low, high = mean_bounds(70, 1, 0.05)
    assert_allclose((check.statistic, check.low, check.high), (70 / 40, low / 40, high / 40), rtol=2e-3)
    assert nis_check(np.full((3, 1), np.nan), 0) is None


def test_whiteness_is_the_statistic_of_ljung_and_box():
    w, lags = np.random.default_rng(1).standard_normal(100), 10
    r = np.array([(w[k:] * w[:-k]).sum() / (w * w).sum() for k in range(1, lags + 1)])
    Q = 100 * 102 * (r**2 / (100 - np.arange(1, lags + 1))).sum()
    check = whiteness_check([w])
    assert check.statistic == pytest.approx(Q)
    assert check.high == pytest.approx(18.307, abs=1e-3)  # 95 % of chi-square with ten degrees, from tables
    two = whiteness_check([w, w])
    assert (two.statistic, two.effective) == (pytest.approx(2 * Q), 20)


def test_colour_is_seen_and_gaps_are_no_colour():
    rng = np.random.default_rng(4)
    w = rng.standard_normal(400)
    assert whiteness_check([w]).passed
    assert not whiteness_check([w[1:] + 0.7 * w[:-1]]).passed
    holes = np.where(rng.random(400) < 0.5, np.nan, w)
    assert whiteness_check([holes]).passed
    assert whiteness_check([w[:9]]) is None
    assert whiteness_check([]) is None
    assert whiteness_check([np.zeros(50)]) is None


def test_bias_is_the_squared_mean_in_units_of_its_variance():
    w = np.random.default_rng(5).standard_normal(100)
    assert bias_check([w]).statistic == pytest.approx(100 * w.mean() ** 2 / (w**2).mean())
    assert bias_check([w]).high == pytest.approx(1.959964**2, rel=1e-6)
    assert bias_check([w - w.mean()]).statistic == pytest.approx(0, abs=1e-20)
    assert not bias_check([w + 0.5]).passed
    assert bias_check([w[:5]]) is None


def test_bounds_of_single_epochs():
    low, high = epoch_bounds(np.array([2, 0, 4]))
    assert_allclose((low[0], high[0]), (-2 * np.log(0.975), -2 * np.log(0.025)))
    assert np.isnan([low[1], high[1]]).all()
    assert (low[2], high[2]) == pytest.approx((0.484419, 11.143287))  # from tables
    low, high = epoch_bounds(np.array([3]), runs=100)
    assert_allclose((low[0], high[0]), mean_bounds(3, 100, 0.05), rtol=1e-3)


def test_a_statistic_that_is_not_finite_does_not_pass():
    assert not chi_square_check(np.nan, 4.0, 8.0, 4).passed
    assert not chi_square_check(np.inf, 4.0, 8.0, 4).passed


def test_rows_are_whitened_by_their_own_covariance():
    rng = np.random.default_rng(7)
    a = rng.standard_normal((3, 3))
    S = a @ a.T
    nu = rng.standard_normal(3)
    assert_allclose(standardized(nu[None], S[None])[0], np.linalg.solve(np.linalg.cholesky(S), nu))
    partial = standardized(np.array([[nu[0], np.nan, nu[2]]]), S[None])[0]
    kept = np.ix_([0, 2], [0, 2])
    assert_allclose(partial[[0, 2]], np.linalg.solve(np.linalg.cholesky(S[kept]), nu[[0, 2]]))
    assert np.isnan(partial[1])


def test_time_to_convergence():
    """An error of 100 for 30 epochs, then of 1: from then on all that follows is small."""
    times = 5.0 + 2.0 * np.arange(100)
    error = np.column_stack([np.where(np.arange(100) < 30, 100.0, 1.0), np.full(100, 1e9)])
    assert convergence_time(error, [0], times) == 60.0
    assert convergence_time(error[30:], [0], times[30:]) == 0.0
    error[40, 0] = np.nan  # an epoch without truth
    assert convergence_time(error, [0], times) == 60.0
    error[50:, 0] = np.nan
    assert convergence_time(error, [0], times) is None
    assert convergence_time(np.ones((1, 1)), [0], times[:1]) == 0.0
