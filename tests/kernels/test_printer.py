"""Printed source computes what SymPy means: random expressions and their derivatives against 30-digit evaluation."""

import re

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from piazzi.expressions import FUNCTIONS, ExpressionError, symbol, to_sympy
from piazzi.kernels import plain, printer
from piazzi.model.jacobian import jacobian

NAMES = ("x", "y", "z")
SYMBOLS = {name: symbol(name) for name in NAMES}


def printed(*outputs: sp.Expr) -> str:
    return printer.function("f", [f"a_{n}" for n in NAMES], {SYMBOLS[n]: f"a_{n}" for n in NAMES}, list(outputs))


def values(source: str, *at: float) -> tuple[float, ...]:
    """Run printed source in the plain vocabulary."""
    scope = dict(vars(plain))
    exec(source, scope)
    with np.errstate(all="ignore"):
        return scope["f"](*map(np.float64, at))


def exact(e: sp.Expr, *at: float) -> float:
    """Value in 30 digits, or NaN where it is not a finite real number."""
    value = e.evalf(30, subs=dict(zip(SYMBOLS.values(), map(sp.Float, at), strict=True)), maxn=200)
    return float(value) if value.is_real and value.is_finite else float("nan")


def with_gradient(e: sp.Expr) -> list[sp.Expr]:
    return [e, *jacobian(sp.Matrix([e]), list(SYMBOLS.values()))]


# Every function with arguments at which it is defined, and powers of every kind
unary = ["sin({0})", "cos({0})", "tan({0}/4)", "asin(tanh({0})/2)", "acos(tanh({0})/2)", "atan({0})", "sinh({0}/3)",
         "cosh({0}/3)", "tanh({0})", "exp({0}/3)", "log(1 + abs({0}))", "sqrt(2 + sin({0}))", "abs({0})", "sign({0})",
         "-({0})"]  # fmt: skip
binary = ["({0}) + ({1})", "({0}) - ({1})", "({0})*({1})", "({0})/(2 + ({1})**2)", "atan2({0}, 2 + cos({1}))",
          "hypot({0}, {1} + 5)", "min({0}, {1})", "max({0}, {1})", "(1 + abs({0}))**({1}/5)"]  # fmt: skip
powers = ["({0})**{k}", "(1 + ({0})**2)**({k}/2)", "(2 + sin({0}))**({k}.5)", "(3 + cos({0}))**(-{k}/2)"]
leaves = st.sampled_from([*NAMES, "x*y", "x + y", "2", "0.3", "-1.75", "pi", "1/3"])


def grow(inner):
    return st.one_of(
        st.builds(str.format, st.sampled_from(unary), inner),
        st.builds(str.format, st.sampled_from(binary), inner, inner),
        st.builds(lambda p, e, k: p.format(e, k=k), st.sampled_from(powers), inner, st.integers(1, 7)),
    )


EXPRESSIONS = st.recursive(leaves, grow, max_leaves=6)
POINTS = st.lists(st.floats(-2, 2).map(lambda v: round(v, 3)), min_size=3, max_size=3)


@given(EXPRESSIONS, POINTS)
@settings(max_examples=100)
def test_printed_source_equals_sympy(text, at):
    try:
        outputs = with_gradient(to_sympy(text, SYMBOLS))
    except ExpressionError:  # a drawn constant such as sinh(1000), which the language refuses
        assume(False)
    wanted = [exact(e, *at) for e in outputs]
    assume(np.isfinite(wanted).all() and np.abs(wanted).max() < 1e8)
    # how far rounding of the point itself moves the outputs: an ill-conditioned formula may be off by as much
    moved = [exact(e, *(v * (1 + 1e-13) + 1e-14 for v in at)) for e in outputs]
    assume(np.isfinite(moved).all())
    slack = 1e-11 * (1 + np.abs(wanted)) + 100 * np.abs(np.subtract(moved, wanted))
    assume(slack.max() < 1e-4)
    assert (np.abs(np.subtract(values(printed(*outputs), *at), wanted)) <= slack).all(), (
        text,
        values(printed(*outputs), *at),
        wanted,
    )


@pytest.mark.parametrize("function", FUNCTIONS)
def test_every_function_of_the_language_has_a_compiled_form_and_a_derivative(function):
    """Also inside abs, sign, min and max, where SymPy's own derivative would allow for complex values."""
    call = f"{function}(x)" if FUNCTIONS[function] == 1 else f"{function}(x, y)"
    at = (0.4, 0.7, 0.1)
    for text in (
        call,
        f"abs({call} - 2)",
        f"sign({call})*x",
        f"max({call}, z)",
        f"min({call}, y, -z)*abs({call})",
        f"abs(z*{call})",
    ):
        outputs = with_gradient(to_sympy(text, SYMBOLS))
        got = values(printed(*outputs), *at)
        assert got[0] == pytest.approx(exact(outputs[0], *at), rel=1e-13)
        for i, derivative in enumerate(got[1:]):
            e, h = np.eye(3)[i], 1e-5
            numeric = (exact(outputs[0], *(at + h * e)) - exact(outputs[0], *(at - h * e))) / (2 * h)
            assert derivative == pytest.approx(numeric, rel=1e-7, abs=1e-8), text


@pytest.mark.parametrize("text", ["x**{}", "(x**2 + y**2)**{}", "y*(x + 1)**{}"])
@pytest.mark.parametrize(
    "exponent",
    [
        "2",
        "3",
        "7",
        "31",
        "64",
        "-1",
        "-2",
        "-64",
        "(1/2)",
        "0.5",
        "(3/2)",
        "1.5",
        "(-3/2)",
        "-1.5",
        "-2.5",
        "(7/2)",
        "63.5",
        "2.0",
        "-3.0",
        "0.0",
        "-0.0",
    ],
)
def test_powers_by_integers_and_halves_are_products(text, exponent):
    """However they are written: as fractions or as decimals."""
    e = to_sympy(text.format(exponent), SYMBOLS)
    source = printed(e)
    assert "pow" not in source
    assert "**" not in source
    assert values(source, 1.1, 0.9, 0.0)[0] == pytest.approx(exact(e, 1.1, 0.9, 0.0), rel=1e-13)


def test_derivatives_of_founding_gravity_have_no_pow():
    for text in ("-x/(x**2 + y**2)**1.5", "-x/(x**2 + y**2)**(3/2)", "-x/sqrt(x**2 + y**2)**3", "-x/hypot(x, y)**3"):
        source = printed(*with_gradient(to_sympy(text, SYMBOLS)))
        assert "pow" not in source
        assert source.count("sqrt(") == 1
        assert source.count("1.0/") == 1


def test_other_powers_are_left_to_pow():
    for text in ("x**y", "x**(1/3)", "2**x", "(x*y)**0.3"):
        assert "pow(" in printed(to_sympy(text, SYMBOLS))


def test_late_terms_come_last():
    """Only one operation waits for the slowest term of a sum or product."""
    body = re.search(r"return \((.*),\)", printed(to_sympy("exp(sin(x)) + y + z", SYMBOLS)))[1]
    assert body == "a_y + a_z + exp(sin(a_x))"
    body = re.search(r"return \((.*),\)", printed(to_sympy("sin(cos(x))*y*z", SYMBOLS)))[1]
    assert body.endswith("*sin(cos(a_x))")


@pytest.mark.parametrize(
    "text",
    [
        "-x - y",
        "-(x - y)*-2",
        "x - (y - z)",
        "-x**2",
        "(-x)**2",
        "x/-y",
        "-(x*y)/(-z + 5)",
        "1 - 1/(1 - x)",
        "-sin(-x)",
        "2*-3*x",
        "-sqrt(x + 5)*-y",
    ],
)
def test_signs(text):
    e = to_sympy(text, SYMBOLS)
    assert values(printed(e), 0.3, -1.7, 0.6)[0] == pytest.approx(exact(e, 0.3, -1.7, 0.6), rel=1e-14)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_survive_bit_for_bit(number):
    assume(number == 0 or 1e-300 < abs(number) < 1e300)
    e = to_sympy(repr(abs(number)), SYMBOLS) * SYMBOLS["x"]
    assert values(printed(e), 1.0, 0.0, 0.0)[0] == abs(number)


def test_shared_subexpressions_are_computed_once():
    """Over value and Jacobian together."""
    source = printed(*with_gradient(to_sympy("sin(x*y)*exp(x*y)", SYMBOLS)))
    assert source.count("sin(") == source.count("exp(") == source.count("cos(") == 1


def test_unknown_functions_are_refused():
    with pytest.raises(ValueError, match="no compiled form for 'gamma'"):
        printed(sp.gamma(SYMBOLS["x"]))
