"""Functions of the user's own: what a fragment may hold, what it gives in every mode, and derivatives that disagree."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from tests.kernels.outside import called

WELL = '''"""Gravity of a point, softened near it."""
SOFT = 0.25


def cubed(x, y):
    r2 = x*x + y*y + SOFT**2
    return r2*math.sqrt(r2)


def well(x, y, data, at):
    k = -data[at]/cubed(x, y)
    return k*x, k*y


def well_partials(x, y, data, at):
    k, r2 = -data[at]/cubed(x, y), x*x + y*y + SOFT**2
    q = 3.0*k/r2
    return k*x, k*y, k - q*x*x, -q*x*y, -q*x*y, k - q*y*y
'''
RAMP = """
def ramp(u):
    if u > 1:
        return 2*u - 1
    total = 0
    for i in range(2):
        total += u*u/2
    return total


def ramp_partials(u):
    return (u*u, 2*u) if False else (2*u - 1 if u > 1 else u*u), 2.0 if u > 1 else 2*u
"""
X = np.array([1.0, 0.1, 0.0, 1.0])


def problem(function, start=X, **changes):
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "gx", "gy"],
        [pz.Sensor("place", ["x", "y"])],
        groups={"position": ["x", "y"], "velocity": ["vx", "vy"]},
        definitions={"gx, gy": "field(x, y)"},
        functions={"field": function},
    )
    stations = pz.Station("place", "place", [1e-4, 1e-4])
    prior, noise = pz.Gaussian(start, [1e-2] * 4), [0, 0, 1e-6, 1e-6]
    return pz.Problem(model, prior, noise, stations, functions={"field": function}, **changes)


def twin():
    r = "(x**2 + y**2 + 0.0625)**1.5"
    sensor = pz.Sensor("place", ["x", "y"])
    model = pz.Model(["x", "y", "vx", "vy"], ["vx", "vy", f"-2*x/{r}", f"-2*y/{r}"], [sensor])
    return pz.Problem(model, pz.Gaussian(X, [1e-2] * 4), [0, 0, 1e-6, 1e-6], pz.Station("place", "place", [1e-4, 1e-4]))


def test_a_fragment_is_what_its_formula_is_in_estimators(monkeypatch):
    ours, symbols, estimators = (
        problem(pz.Function(WELL, 2, 2, data=[2.0])),
        twin(),
        (pz.ExtendedKalmanFilter(), pz.FactorGraph()),
    )
    with monkeypatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")  # the formula, whose kernels nobody else needs
        f, F = symbols.dynamics(X), symbols.dynamics_jacobian(X)
        tracking = pz.simulate(symbols, np.arange(0.0, 3.0, 0.1), np.random.default_rng(0))
        expected = [estimator.estimate(symbols, tracking).mean for estimator in estimators]
    assert_allclose(ours.dynamics(X), f, rtol=1e-14)
    assert_allclose(ours.dynamics_jacobian(X), F, atol=1e-14)
    for estimator, mean in zip(estimators, expected, strict=True):
        assert_allclose(estimator.estimate(ours, tracking).mean, mean, atol=1e-10)


def test_a_file_is_as_good_as_its_text_and_other_data_compile_nothing(tmp_path):
    (tmp_path / "well.py").write_text(WELL)
    one, other = pz.Function(tmp_path / "well.py", 2, 2, data=[2.0]), pz.Function(WELL, 2, 2, data=[3.0])
    assert one.signature == other.signature and one.checksum != other.checksum
    a, b = problem(one), problem(other)
    assert a.spec("transition", "rates") is b.spec("transition", "rates")
    edited = pz.Function(WELL.replace("0.25", "0.26"), 2, 2, data=[2.0])
    assert edited.signature != one.signature and edited.checksum != one.checksum
    assert problem(edited).spec("transition", "rates").digest() != a.spec("transition", "rates").digest()


def test_copies_are_whole():
    f = pz.Function(WELL, 2, 2, data=[2.0])
    for other in (copy.deepcopy(f), pickle.loads(pickle.dumps(f))):
        assert other.value(1.0, 2.0) == f.value(1.0, 2.0) and other.checksum == f.checksum
        assert not other.data.flags.writeable


@pytest.mark.parametrize("partials", [False, True])
def test_branches_and_loops_give_the_same_bits_in_lanes(partials):
    f = pz.Function(RAMP.replace("(u*u, 2*u) if False else ", ""), 1)
    u = np.linspace(-1.0, 3.0, 32)[:, None]
    with called(f.signature, partials=partials) as compiled:
        one, lanes = compiled.one(u, f.data), compiled.lanes(u, f.data)
    assert_array_equal(one, lanes)
    wanted = [np.append(f.value(*row), f.derivatives(*row) if partials else []) for row in u]
    assert_allclose(one, wanted, rtol=1e-15)


def test_helpers_of_two_fragments_may_have_one_name():
    first = "def half(u):\n    return 0.5*u\n\ndef f(u):\n    return half(u)\n\ndef f_partials(u):\n    return half(u), 0.5\n"
    second = first.replace("0.5", "0.25")
    functions = {"a": pz.Function(first, 1), "b": pz.Function(second, 1)}
    model = pz.Model(["x"], ["a(x) + b(x)"], functions=functions)
    p = pz.Problem(model, pz.Gaussian([2.0], [1.0]), functions=functions)
    assert_allclose(p.dynamics([2.0]), [1.5])


def test_a_division_by_zero_is_no_error_but_no_number():
    f = pz.Function("def f(u):\n    return 1/u\n\ndef f_partials(u):\n    return 1/u, -1/u**2\n", 1)
    assert f.value(0.0) == (np.inf,)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-q*x*y, -q*x*y", "-q*x*y, q*x*y", r"output 2 by 'x' is -?0\.\d+, but differences give -?0\.\d+, at x = 1, y = 0.1"),
        ("k - q*x*x", "k - q*x*x + 1e-3", r"output 1 by 'x' is "),
        ("k - q*y*y", "k", r"output 2 by 'y' is "),
        ("return k*x, k*y, k", "return k*x, 2*k*y, k", r"output 2 is -\S+ by well but -\S+ by well_partials"),
    ],
)
def test_derivatives_that_disagree_are_told_with_both_numbers(old, new, message):
    assert old in WELL
    with pytest.raises(ValueError, match=r"^function 'field' \(the fragment\): .*" + message) as refused:
        problem(pz.Function(WELL.replace(old, new), 2, 2, data=[2.0]))
    assert "\n" not in str(refused.value)


def test_derivatives_that_are_not_given_must_be_zero():
    text = "def f(u, v):\n    return u*u + v\n\ndef f_partials(u, v):\n    return u*u + v, 2*u\n"
    function = pz.Function(text, 2, partials=[(0, 0)])
    model = pz.Model(["x", "y"], ["f(x, y)", "0"], functions={"f": function})
    with pytest.raises(ValueError, match="output 1 by 'v' is 0, but differences give 1"):
        pz.Problem(model, pz.Gaussian([2.0, 1.0], [1.0, 1.0]), functions={"f": function})


@pytest.mark.parametrize("start", [X, [0.0, 0.0, 0.0, 0.0], [7e6, 0.0, 0.0, 0.0], [1e-8, -3.0, 0.0, 0.0]])
def test_right_derivatives_are_found_right_at_all_sizes(start):
    problem(pz.Function(WELL, 2, 2, data=[2.0]), start)


def test_calls_in_sensors_and_roots_are_checked_too():
    text = "def lag(u):\n    return u*u/10\n\ndef lag_partials(u):\n    return u*u/10, u/10\n"
    lag = pz.Function(text, 1)
    root = {"tau": {"root": "late - tau", "definitions": {"late": "lag(x - tau)"}}}
    model = pz.Model(["x"], ["-x"], [pz.Sensor("s", ["tau"], roots=root)], functions={"lag": lag})
    with pytest.raises(ValueError, match=r"function 'lag' .* output 1 by 'u' is 0\.\d+, but differences give"):
        pz.Problem(model, pz.Gaussian([1.0], [1.0]), None, pz.Station("s", "s", 1.0), functions={"lag": lag})


PAIR = "def f(u):\n    return {}\n\ndef f_partials(u):\n    return u, 1.0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import os\n" + PAIR.format("u"), "line 1: import has no place in a fragment, which holds functions and literal"),
        ("from math import sin\n" + PAIR.format("u"), "line 1: import has no place"),
        ("print(1)\n" + PAIR.format("u"), "line 1: expr has no place"),
        ("class A:\n    pass\n" + PAIR.format("u"), "line 1: classdef has no place"),
        ("K = open('x')\n" + PAIR.format("u"), "line 1: K must be a literal constant"),
        ("K = 'text'\n" + PAIR.format("u"), "line 1: K must be a literal constant"),
        (PAIR.format("open('/etc/passwd')"), "line 2: 'open' is not known here"),
        (PAIR.format("mu*u"), "line 2: 'mu' is not known here: neither an argument, nor defined above"),
        (PAIR.format("u.__class__"), "line 2: .__class__ has no place in a fragment"),
        (PAIR.format("math.floor(u)"), r"line 2: \.floor has no place .* of modules there is math, with .*sqrt"),
        (PAIR.format("os.system"), "line 2: .system has no place"),
        (PAIR.format("'a'"), "line 2: 'a' is no number"),
        (PAIR.format("(lambda: u)()"), "line 2: .* has no place|called by name"),
        (PAIR.format("[u][0]"), "line 2: list has no place"),
        (PAIR.format("sum(u for _ in range(3))"), "line 2: generatorexp has no place|line 2: 'sum' is not known"),
        (PAIR.format("f(u)"), "line 2: 'f' is not known here"),
        (PAIR.format("u, u"), "line 2: f returns 2 values; it must be 1"),
        (PAIR.format("u").replace("u, 1.0", "u"), "line 5: f_partials returns 1 values; it must be 2"),
        (PAIR.format("u").replace("f(u)", "f(u, v)"), r"line 1: f\(u, v\) must take 1 arguments, and data, at behind them"),
        (PAIR.format("u").replace("f_partials(u)", "f_partials(u, data, at)"), "f_partials"),
        (PAIR.format("u").replace("f_partials", "g"), "a fragment has one function f beside f_partials"),
        (PAIR.format("u").replace("(u)", "(sin)").replace("return u", "return sin"), "line 1: 'sin' is a function or"),
        (PAIR.format("u").replace("f(u)", "f(u=1)"), "line 1: f must be a plain function of named arguments"),
        ("@inline\n" + PAIR.format("u"), "line 2: f must be a plain function"),
        ("def g(u):\n    while u > 0:\n        u -= 1\n    return u\n\n" + PAIR.format("g(u)"), "line 2: while has no place"),
        ("def g(u):\n    for i in u:\n        pass\n    return u\n\n" + PAIR.format("g(u)"), "a loop runs over range"),
        ("def g(u, data, at):\n    data[at] = 1.0\n    return u\n\n" + PAIR.format("u"), "line 2: data are read only"),
        ("def g(u):\n    u + 1\n    return u\n\n" + PAIR.format("g(u)"), "line 2: expr has no place in a function"),
        ("def g(u):\n    pass\n\n" + PAIR.format("g(u)"), "line 1: g must end with a return"),
        ("def f(u:\n", "line 1: is not Python"),
        ("f.py", r"fragment is 'f.py'; it must be the text of functions, or Path\(...\) of a file"),
    ],
)  # fmt: skip
def test_what_is_no_arithmetic_is_refused_with_its_line(text, message):
    with pytest.raises(ValueError, match=message) as refused:
        pz.Function(text, 1)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"arguments": 0}, "arguments of a function is 0; it must be a whole number from 1 to 100"),
        ({"arguments": 1, "outputs": True}, "outputs of a function is True"),
        ({"arguments": 1, "partials": [(1, 0)]}, r"partials of a function have \(1, 0\); its outputs are 0 to 0"),
        ({"arguments": 1, "data": [1.0, np.nan]}, "data of a function must be finite; number 1 is nan"),
        ({"arguments": 1, "data": ["a"]}, "data of a function must be made of numbers"),
        ({"arguments": 1, "span": (2.0, 1.0)}, "span of a function is"),
    ],
)
def test_bad_forms_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        pz.Function(PAIR.format("u"), **given)


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(OSError, match=r"nowhere\.py"):
        pz.Function(Path("nowhere.py"), 1)


def test_times_outside_of_its_span_are_refused_before_a_run():
    push = pz.Function("def f(t):\n    return 2*t\n\ndef f_partials(t):\n    return 2*t, 2\n", 1, span=(0.0, 10.0))
    model = pz.Model(["x"], ["push(t)"], [pz.Sensor("s", ["x"])], functions={"push": push})
    p = pz.Problem(model, pz.Gaussian([0.0], [1.0]), None, pz.Station("s", "s", 1.0), functions={"push": push})
    with pytest.raises(ValueError, match="'push' has values from t = 0 to 10 s, and t = 11 s is outside"):
        pz.ExtendedKalmanFilter().estimate(p, pz.Tracking([0.0, 11.0], [[0.0], [0.0]], ["s", "s"]))


def test_a_file_cannot_keep_it_and_says_so(tmp_path):
    from piazzi.io.files import save

    p = problem(pz.Function(WELL, 2, 2, data=[2.0]))
    tracking = pz.simulate(p, [0.0, 0.1], np.random.default_rng(0))
    with pytest.raises(ValueError, match="function Function cannot be written to a file: it is known in Python only"):
        save(tmp_path / "r.nc", p, tracking)
