"""Fixes that err alike over minutes: as many of them are used as do not go together."""

from types import SimpleNamespace

import numpy as np
import pytest

from piazzi.determination import whiteness
from piazzi.determination.setup import Setup
from piazzi.estimate.chi_square import quantile

K = 600


def correlated(left, seed, count=K):
    """Residuals (K, 3) of unit variance of a first-order process with this correlation from row to row."""
    rng = np.random.default_rng(seed)
    out = rng.standard_normal((count, 3))
    for k in range(1, count):
        out[k] = left * out[k - 1] + np.sqrt(1.0 - left**2) * out[k]
    return out


@pytest.fixture
def thinned(monkeypatch):
    """What becomes of fixes a minute apart with these residuals."""

    def of(residuals):
        t = 60.0 * np.arange(len(residuals))
        tracking = SimpleNamespace(row_times=t, stations_of=lambda problem: np.zeros(len(t), dtype=int))
        problem = SimpleNamespace(stations=[SimpleNamespace(sensor="position")])
        given = Setup(None, None, None, problem, tracking, np.zeros((len(t), 3), dtype=int), np.zeros((1, 6)), 0, ())
        monkeypatch.setattr(whiteness, "analysed", lambda given, states: SimpleNamespace(whitened=residuals))
        found = whiteness.with_white_fixes(given)
        return found if found is not given else None

    return of


def test_white_fixes_are_all_used(thinned):
    kept = [thinned(correlated(0.0, seed)) is None for seed in range(200)]
    assert sum(kept) >= 197  # chance sets some aside, at the rate that is stated: one in a thousand, one-sided


def test_correlated_fixes_are_thinned_until_they_are_white(thinned):
    found = thinned(correlated(0.8, 1))
    stride = K // int((~found.spare).sum())
    assert 0.8**stride < 0.2 and stride & (stride - 1) == 0  # as far apart as the process forgets
    assert found.assumed[-1] == f"fixes are correlated: one in {stride} is used, {stride:.1f} min apart, which are not"


def test_a_mean_of_what_is_left_is_as_good_as_its_sigma_says(thinned):
    """The mean of thinned rows has the variance of as many independent ones; that of all rows has many times its own."""
    thin, whole = [], []
    for seed in range(60):
        rows = correlated(0.8, seed)
        own = rows[~thinned(rows).spare]
        thin.append(len(own) * (own.mean(axis=0) ** 2).sum())
        whole.append(K * (rows.mean(axis=0) ** 2).sum())
    assert np.sum(whole) > 4.0 * quantile(0.999, 180)
    assert np.sum(thin) < 1.5 * quantile(0.999, 180)


def test_what_never_ends_is_no_error_of_fixes(thinned):
    """Residuals of forces that do not hold go together over the whole orbit: fewer rows would not mend them."""
    assert thinned(correlated(0.999, 3, 100)) is None


def test_outliers_alone_are_no_correlation(thinned):
    rows = correlated(0.0, 5)
    rows[100:102] = 500.0
    assert thinned(rows) is None
