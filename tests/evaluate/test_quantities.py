"""Numbers as people read them."""

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from piazzi.evaluate.quantities import display_of, displays, duration, number, with_sigma


@given(st.floats(-1e300, 1e300), st.integers(1, 12))
def test_a_number_keeps_its_significant_digits(value, digits):
    text = number(value, digits)
    assert float(text) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits), abs=1e-320)
    assert len(text) <= digits + 8


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (0.0, "0"),
        (616655.46, "616700"),
        (13.9854, "13.99"),
        (-0.00012345, "-0.0001234"),
        (1e-9, "1.000e-09"),
        (nan, "nan"),
    ],
)
def test_ordinary_sizes_have_no_exponent(value, text):
    assert number(value) == text


@given(st.floats(-1e9, 1e9), st.floats(1e-6, 1e6))
def test_value_and_sigma_share_their_decimals(value, sigma):
    shown, spread = with_sigma(value, sigma)
    assert len(shown.partition(".")[2]) == len(spread.partition(".")[2])
    assert abs(float(shown) - value) <= max(0.06 * sigma, 0.5)
    assert float(spread) == pytest.approx(sigma, rel=0.06, abs=0.5 if sigma >= 10 else 0)


def test_large_values_keep_the_digits_that_their_sigma_leaves():
    assert with_sigma(3.98600398739e14, 4.157e5) == ("3.9860039874e+14", "420000")
    assert with_sigma(2.0, 1e10)[1] == "1.0e+10"


@pytest.mark.parametrize("sigma", [0.0, nan, inf, 1e-300])
def test_a_sigma_that_says_nothing_takes_no_digits_away(sigma):
    assert with_sigma(1.25, sigma)[0] == "1.25000"


@pytest.mark.parametrize(
    ("unit", "values", "shown", "factor"),
    [
        ("m", [5.0, 9999.0], "m", 1.0),
        ("m", [5.0, None, 10000.0], "km", 1e-3),
        ("m/s", [-4500.0], "km/s", 1e-3),
        ("rad", [1e-9], "deg", 57.29577951308232),
        ("kg", [1e9], "kg", 1.0),
        ("", [], "", 1.0),
        ("m", [nan, inf], "m", 1.0),
    ],
)
def test_units_follow_the_size(unit, values, shown, factor):
    display = display_of(unit, values)
    assert (display.unit, display.factor) == (shown, pytest.approx(factor))


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (None, "-"), (nan, "-"), (0.0, "0 s"), (2.5e-7, "0.250 us"), (0.00105, "1.05 ms"), (1.5, "1.50 s"), (119.0, "119 s"),
        (150.0, "2.50 min"), (21600.0, "6.00 h"), (864000.0, "10.0 days"),
    ],
)  # fmt: skip
def test_durations_have_the_unit_that_suits_them(seconds, text):
    assert duration(seconds) == text


def test_a_group_has_one_unit_and_what_is_in_none_its_own():
    """A velocity of kilometres a second may have one component of metres; a bias of centimetres is no part of a position."""
    units = ["m", "m", "m", "m/s", "m/s", "m", "rad"]
    values = [[7e6], [12.0], [None], [7.5e3], [-19.0], [0.02], [1.0]]
    shown = displays(units, values, [range(3), (3, 4)])
    assert [show.unit for show in shown] == ["km", "km", "km", "km/s", "km/s", "m", "deg"]
    assert [show.unit for show in displays(["m", "m", "m/s"], [[2e4], [1.0], [1.0]])] == ["km", "km", "m/s"]
