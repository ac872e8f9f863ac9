"""When a scenario is measured: every way of saying it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from piazzi.scenarios.scenario import read_times
from piazzi.scenarios.table import Faults, Table
from piazzi.units import Units


def read(table, units=None):
    faults = Faults()
    times = read_times(Table(table, "times", faults), units or Units())
    assert not faults, faults
    return times


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e3), st.integers(1, 500))
def test_a_stop_that_a_step_reaches_is_an_epoch(start, step, count):
    times = read({"start": start, "step": step, "count": count})
    assert len(times) == count
    assert_array_equal(read({"start": start, "step": step, "stop": start + (count - 1) * step}), times)


def test_tenths_of_a_second_are_exact_multiples():
    assert_array_equal(read({"step": 0.1, "count": 100}), np.arange(100) * 0.1)
    assert_array_equal(read({"step": 0.1, "stop": 9.9}), np.arange(100) * 0.1)


def test_a_list_is_taken_as_it_is():
    assert_array_equal(read({"list": [0.0, 0.5, 2.0]}), [0.0, 0.5, 2.0])


def test_minutes_become_seconds():
    assert_allclose(read({"start": 1, "step": 2, "stop": 7}, Units.parse("min")), [60, 180, 300, 420])
    assert_allclose(read({"list": [0, 1]}, Units.parse("min")), [0, 60])


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"step": 1},
        {"step": 1, "count": 2, "stop": 3},
        {"step": 1e-300, "stop": 1},
        {"list": [1, 1]},
        {"list": 3},
        {"list": [[0], [1]]},
        {"step": 1e308, "count": 10},
        {"start": 1e300, "step": 1, "count": 3},
    ],
)
def test_what_makes_no_epochs_is_a_fault(table):
    faults = Faults()
    with np.errstate(all="ignore"):
        assert read_times(Table(table, "times", faults), Units()) is None
    assert faults
