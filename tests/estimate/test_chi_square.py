"""Quantiles against closed forms and 50-digit arithmetic."""

from math import exp, factorial, log
from statistics import NormalDist

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piazzi.estimate.chi_square import cdf, quantile

probability = st.floats(1e-6, 1 - 1e-9)


@given(probability)
def test_two_degrees_of_freedom_are_exponential(p):
    assert quantile(p, 2) == pytest.approx(-2 * log(1 - p), rel=1e-12 + 1e-15 / (1 - p))


@given(st.floats(0.01, 0.9999))
def test_one_degree_of_freedom_is_a_squared_normal(p):
    assert quantile(p, 1) == pytest.approx(NormalDist().inv_cdf(0.5 * (1 + p)) ** 2, rel=1e-10)


@given(st.integers(1, 12), st.floats(0.01, 80))
def test_even_degrees_of_freedom_are_a_poisson_sum(half, x):
    poisson = sum(exp(-x / 2) * (x / 2) ** i / factorial(i) for i in range(half))
    assert cdf(x, 2 * half) == pytest.approx(1 - poisson, abs=1e-13)


@given(st.floats(0.5, 5000), st.floats(0.01, 10))
def test_cdf_equals_the_incomplete_gamma_function(k, ratio):
    x = k * ratio
    with mpmath.workdps(50):
        expected = float(mpmath.gammainc(mpmath.mpf(k) / 2, 0, mpmath.mpf(x) / 2, regularized=True))
    assert cdf(x, k) == pytest.approx(expected, rel=1e-9, abs=1e-13)


@given(probability, st.floats(0.5, 2000))
def test_quantile_is_the_inverse_of_the_cdf(p, k):
    assert cdf(quantile(p, k), k) == pytest.approx(p, abs=1e-12)


def test_ends_of_the_range():
    assert quantile(0.0, 3) == 0.0
    assert cdf(-1.0, 3) == 0.0
    assert cdf(float("inf"), 3) == 1.0


@pytest.mark.parametrize(("p", "k"), [(1.0, 3), (-0.1, 3), (0.5, 0), (float("nan"), 3)])
def test_what_has_no_quantile_is_refused(p, k):
    with pytest.raises(ValueError, match="no chi-square quantile"):
        quantile(p, k)
