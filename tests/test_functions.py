"""The table of functions: a function that is added to it, and nowhere else, is a function of the whole program."""

import math
import subprocess
import sys

import numpy as np
import pytest
import sympy as sp

import piazzi as pz
from piazzi.expressions import Equation, ExpressionError, added, check, evaluate, evaluate_arrays, from_sympy, symbol, to_sympy
from piazzi.expressions.functions import TABLE, Function, arities
from piazzi.expressions.limits import read

SWITCH = Function(
    "switch",
    value=lambda x, w: 1.0 / (1.0 + math.exp(-x / w)),
    arity=2,
    array=lambda x, w: 1.0 / (1.0 + np.exp(-x / w)),
    partials=("switch(a, b)*(1 - switch(a, b))/b", "-a*switch(a, b)*(1 - switch(a, b))/b**2"),
    kernel="switch",
    code="def switch(x, w):\n    return 1.0/(1.0 + exp(-x/w))",
    size=0.0,
)


@pytest.fixture
def switch():
    with added(SWITCH):
        yield


def expected(x, w):
    return 0.5 * (1.0 + np.tanh(0.5 * np.asarray(x) / w))  # the same by another formula


@pytest.mark.usefixtures("switch")
def test_a_function_of_the_table_is_parsed_evaluated_and_written():
    assert check("3*switch(x, w + 1)", {"x", "w"}) == {"x", "w"}
    assert evaluate("switch(x, 2)", {"x": 0.7}) == pytest.approx(expected(0.7, 2.0), rel=1e-14)
    assert math.isnan(evaluate("switch(x, 0)", {"x": 0.7}))
    x = np.linspace(-3, 3, 7)
    np.testing.assert_allclose(evaluate_arrays("switch(x, 2)", {"x": x}), expected(x, 2.0), rtol=1e-14)
    expr = to_sympy("1 + 2*switch(x, w)", {"x": symbol("x"), "w": symbol("w")})
    assert from_sympy(expr) == "1 + 2*switch(x, w)"
    assert to_sympy(from_sympy(expr), {"x": symbol("x"), "w": symbol("w")}) == expr
    with pytest.raises(ExpressionError, match="switch takes 2 arguments, got 1"):
        check("switch(x)", {"x"})
    with pytest.raises(ExpressionError, match="did you mean 'switch'"):
        check("swich(x, 1)", {"x"})


@pytest.mark.usefixtures("switch")
def test_its_derivatives_are_its_partials():
    x, w = symbol("x"), symbol("w")
    expr = to_sympy("switch(x**2, w)", {"x": x, "w": w})
    at, h = {x: 0.8, w: 1.3}, 1e-6
    for variable, (dx, dw) in {x: (h, 0.0), w: (0.0, h)}.items():
        numeric = (expected((0.8 + dx) ** 2, 1.3 + dw) - expected((0.8 - dx) ** 2, 1.3 - dw)) / (2 * h)
        assert float(sp.diff(expr, variable).subs(at)) == pytest.approx(numeric, rel=1e-8)


@pytest.mark.usefixtures("switch")
@pytest.mark.parametrize("jit", ["0", "1"])
def test_it_runs_in_kernels_compiled_and_not(jit, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", jit)
    model = pz.Model(["x", "v"], ["v", "-0.2*switch(x, 0.5)"], [pz.Sensor("range", "sqrt(x**2 + 1)*switch(x + 3, 1)")])
    stations = [pz.Station("here", "range", [[1e-4]])]
    problem = pz.Problem(model, pz.Gaussian([1.0, 0.5], np.diag([0.01, 0.01])), np.diag([0.0, 1e-6]), stations)
    states = np.array([[0.3, 0.5], [-0.4, 0.1]])
    np.testing.assert_allclose(problem.dynamics(states)[:, 1], -0.2 * expected(states[:, 0], 0.5), rtol=1e-14)
    slope = (expected(0.3 + 1e-6, 0.5) - expected(0.3 - 1e-6, 0.5)) / 2e-6
    assert problem.dynamics_jacobian(states[0])[1, 0] == pytest.approx(-0.2 * slope, rel=1e-8)
    tracking = pz.simulate(problem, times=np.arange(0.0, 10.0), rng=np.random.default_rng(1))
    for estimator in (pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.FactorGraph()):  # the last two in lanes
        assert estimator.estimate(problem, tracking).success


def test_what_was_added_is_gone_afterwards():
    with added(SWITCH):
        check("switch(x, 1)", {"x"})
    with pytest.raises(ExpressionError, match="'switch' is not a function"):
        check("switch(x, 1)", {"x"})
    with pytest.raises(ValueError, match="has a function 'sin' already"), added(TABLE["sin"]):
        pass


def test_what_only_derivatives_are_made_of_cannot_be_written():
    assert TABLE["heaviside"].derived
    assert "heaviside" not in arities()
    with pytest.raises(ExpressionError, match="is not a function"):
        check("heaviside(x)", {"x"})


@pytest.mark.parametrize("name", [f.name for f in TABLE.values()])
def test_values_of_one_number_and_of_arrays_agree(name):
    function = TABLE[name]
    arguments = np.random.default_rng(0).uniform(0.1, 0.9, (function.arity, 50))
    one = [float(function.value(*column)) for column in arguments.T.tolist()]
    if not function.derived:
        np.testing.assert_allclose(function.on_arrays(*arguments), one, rtol=4e-16)


def test_a_text_is_read_once_and_is_equal_to_itself_alone():
    assert read("2*x + 1") is read("2*x + 1")
    assert read("2*x + 1") == Equation("2*x + 1", read("3").tree, {})
    assert hash(read("2*x + 1")) == hash(Equation("2*x + 1", read("3").tree, {}))
    assert read("2*x + 1") != read("2*x+1")


def test_reading_a_scenario_parses_each_equation_once():
    program = """
from collections import Counter
from piazzi.expressions import parse
count, init = Counter(), parse._Reader.__init__
def counted(self, text, *outside):
    count[text] += 1
    init(self, text, *outside)
parse._Reader.__init__ = counted
import piazzi as pz
pz.load("b612-range")
print(max(count.values()))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"
