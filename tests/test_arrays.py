"""Distinct values and medians are those of NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piazzi.arrays import distinct, median

values = st.lists(st.integers(-3, 3) | st.floats(-1e3, 1e3))


@given(values)
def test_distinct_values_are_those_of_numpy(found):
    np.testing.assert_array_equal(distinct(np.array(found)), np.unique(np.array(found)))


@given(st.lists(st.floats(-1e3, 1e3) | st.just(float("nan")), min_size=1))
def test_median_is_that_of_numpy(found):
    assert median(np.array(found)) == pytest.approx(np.median(np.array(found)), nan_ok=True, rel=1e-15, abs=1e-300)


def test_nothing_has_no_median():
    assert np.isnan(median(np.array([])))
