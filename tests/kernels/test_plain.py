"""The two vocabularies of the kernels mean the same: NumPy's for uncompiled source, Numba's for compiled."""

import inspect
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piazzi.kernels import compiled, plain, vocabulary
from tests.kernels.test_lanes import call

PUBLIC = {name for name, value in vars(plain).items() if not name.startswith("_") and not inspect.ismodule(value)} - {
    "annotations",
    "Callable",
    "Any",
}


def test_both_vocabularies_have_the_same_words():
    assert {name for name in PUBLIC if not hasattr(compiled, name)} == set()
    assert {name for name in PUBLIC if not hasattr(vocabulary, name)} == set()


@given(st.floats(-1e6, 1e6))
def test_angle_is_wrapped_into_half_open_turn(a):
    w = plain.wrap_angle(a)
    assert -math.pi - 1e-9 < w <= math.pi + 1e-9
    assert math.cos(w - a) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("a", "wrapped"), [(0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (4.0, 4.0 - 2 * math.pi)]
)
def test_minus_pi_is_pi(a, wrapped):
    assert plain.wrap_angle(a) == pytest.approx(wrapped, abs=1e-15)


def test_small_angles_are_untouched():
    """No rounding by wrapping what needs none."""
    for a in (1e-300, -3.14159, 0.1, math.pi):
        assert plain.wrap_angle(a) == a


FUNCTIONS_OF_ONE = [
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "exp",
    "log",
    "sqrt",
    "fabs",
    "sign",
    "heaviside",
    "wrap_angle",
]
FUNCTIONS_OF_TWO = ["atan2", "pow", "maximum", "minimum", "unless_missing"]
NUMBERS = np.array([0.0, -0.0, 0.5, 1.0, -1.0, 2.5, -700.0, 1e3, 1e308, -1e308, np.inf, -np.inf, np.nan])


def plainly(name, *args):
    with np.errstate(all="ignore"):
        return float(getattr(plain, name)(*map(np.float64, args)))


@pytest.mark.parametrize("name", FUNCTIONS_OF_ONE + FUNCTIONS_OF_TWO)
def test_functions_agree_also_where_they_have_no_value(name):
    """The root of a negative number is NaN and the logarithm of zero minus infinity; nothing raises."""
    function = getattr(compiled, name)
    if name in FUNCTIONS_OF_ONE:
        x = np.where(np.abs(NUMBERS) == 1e308, 9.0, NUMBERS) if name == "wrap_angle" else NUMBERS
        y, out = x, np.zeros(len(x))

        def each(x, y, out):
            for i in range(13):
                out[i] = function(x[i])

        wanted = [plainly(name, v) for v in x]
    else:
        x, y = map(np.ravel, np.meshgrid(NUMBERS, NUMBERS))
        x = np.where(np.isinf(x), 7.0, x) if name == "pow" else x  # the root of -inf is a matter of taste
        out = np.zeros(len(x))

        def each(x, y, out):
            for i in range(169):
                out[i] = function(x[i], y[i])

        wanted = [plainly(name, v, w) for v, w in zip(x, y, strict=True)]
    call(each, np.ascontiguousarray(x), np.ascontiguousarray(y), out)
    finite = np.isfinite(wanted)
    np.testing.assert_array_equal(np.where(finite, 0, out), np.where(finite, 0, wanted))
    np.testing.assert_allclose(out[finite], np.array(wanted)[finite], rtol=1e-14, atol={"wrap_angle": 1e-12}.get(name, 1e-15))


def test_missing_stays_missing_and_failure_shows():
    nan = math.nan
    assert plain.unless_missing(1.0, 0.25) == 0.25
    assert math.isnan(plain.unless_missing(nan, nan))
    assert plain.unless_missing(1.0, nan) == math.inf
