"""A model is its equations as text: names have one meaning, errors say what is wrong and what was near, SymPy is welcome."""

import copy
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace

import pytest
import sympy as sp

import piazzi as pz
from piazzi.model.derivation import derive, derive_sensor

RANGE = pz.Sensor("range", ["hypot(x - mx, y)"])


def model(**changes):
    given = {"states": ["x", "y"], "dynamics": ["y", "-k*x"], "sensors": [RANGE], "parameters": ["k"]}
    return pz.Model(**(given | changes))


def refused(match, **changes):
    with pytest.raises(ValueError, match=match) as error:
        model(**changes)
    assert "\n" not in str(error.value)


# ---- names -----------------------------------------------------------------------------------------------------------

BAD_NAMES = [
    "",
    "1x",
    "x y",
    "x-y",
    "_x",
    "x__y",
    "__class__",
    "lambda",
    "sin",
    "pi",
    "x.y",
    "x)",
    "import",
    "x\n",
    "ﬁ",
    "x²",
    " x",
    "None",
]


@pytest.mark.parametrize("name", BAD_NAMES)
def test_names_that_cannot_stand_in_an_equation_are_refused(name):
    refused("state .* cannot be used as a name", states=[name, "y"])
    refused("parameter .* cannot be used as a name", parameters=[name])
    if name != "x-y":  # a sensor is never part of an equation, and may have a hyphen
        with pytest.raises(ValueError, match=r"sensor .* cannot be used as a name"):
            pz.Sensor(name, ["x"])


def test_greek_names_are_names():
    m = pz.Model(["θ", "ω"], ["ω", "-μ*sin(θ)"], [pz.Sensor("angle", ["θ"])], ["μ"])
    assert m.names == ("θ", "ω")
    assert derive(m).F[1, 0] == -sp.Symbol("μ", real=True) * sp.cos(sp.Symbol("θ", real=True))


def test_names_that_generated_source_uses_are_free():
    """A state may be called R and a parameter x0: sources use names of their own."""
    names = ["R", "h", "c0", "q0", "F0_0", "P", "Q", "N", "K1", "substep"]
    parameters = ["p", "x0", "t0", "LANES", "h_step", "nan", "inf"]
    rates = [f"-{p}*{s}" for p, s in zip([*parameters, *parameters], names, strict=False)]
    m = pz.Model(names, rates, [pz.Sensor("s", ["R*s0 + h*nu"])], parameters)
    values = {p: 0.1 * (i + 1) for i, p in enumerate(parameters)}
    prior = pz.Gaussian([1.0] * 10, [1.0] * 10)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        for integrator in (pz.Taylor(1), pz.RungeKutta4(1)):
            problem = pz.Problem(m, prior, None, pz.Station("a", "s", 1.0, {"s0": 2.0, "nu": 3.0}), values, integrator)
            expected = [-v for v, _ in zip([*values.values(), *values.values()], names, strict=False)]
            assert problem.dynamics(problem.mean) == pytest.approx(expected)
            assert problem.measure("a", problem.mean) == pytest.approx([5.0])
            x, Phi = problem.step(problem.mean, 0.01)
            assert x == pytest.approx([1 + 0.01 * e for e in expected], abs=1e-4)
            assert Phi[4, 4] == pytest.approx(1 + 0.01 * expected[4], abs=1e-4)


def test_every_name_has_one_meaning():
    refused("state 'x' is also a state", states=["x", "x"])
    refused("parameter 'x' is also a state", parameters=["x"])
    refused("parameter 'k' is also a parameter", parameters=["k", "k"])
    refused("state 't' is also the time", states=["t", "y"])
    refused("parameter 'dt' is also the length of a step", parameters=["dt"])
    refused("two sensors are called 'range'", sensors=[RANGE, RANGE])


def test_one_text_is_not_a_list_of_letters():
    refused("states is 'xy'; it must be a list", states="xy")
    refused("dynamics is 'y'; it must be a list", dynamics="y")
    refused("parameters is 'mu'; it must be a list", parameters="mu")
    with pytest.raises(ValueError, match="angles is 'azimuth'; it must be a list"):
        pz.Sensor("azimuth", ["x"], angles="azimuth")
    refused("sensors has 'range'; it must be a Sensor", sensors=["range"])


# ---- equations -------------------------------------------------------------------------------------------------------


def test_unknown_names_are_told_with_the_nearest():
    refused("dynamics of 'y' uses 'kk', which is neither a state nor a parameter; did you mean 'k'", dynamics=["y", "-kk*x"])
    refused("uses 'dt'", dynamics=["y", "-k*x*dt"])
    refused("sensor 'a' uses 'dt'", sensors=[pz.Sensor("a", ["x*dt"])])
    refused("group 'position' names 'z', which is not a state", groups={"position": ["x", "z"]})
    refused("units names 'velocity'", units={"velocity": "m/s"})


def test_counts_must_agree():
    refused(r"dynamics has 1 equations for 2 states \(x, y\)", dynamics=["y"])
    refused("at least one state", states=[], dynamics=[])
    refused("has no equation for state 'y'", dynamics={"x": "y"})
    refused("has an equation for 'z', which is not a state", dynamics={"x": "y", "y": "x", "z": "0"})


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "x.real",
        "x[0]",
        "lambda: x",
        "x if y else 0",
        "open('f')",
        "y = 2",
        "",
        "x +",
        "k^2",
        "9**9**9",
        "1/0",
    ],
)
def test_equations_outside_the_language_are_refused(text):
    refused("column", dynamics=["y", text])
    with pytest.raises(ValueError, match="column"):
        pz.Sensor("s", [text])


def test_mapping_in_any_order():
    assert model(dynamics={"y": "-k*x", "x": "y"}) == model()


def test_step_knows_its_length():
    m = pz.Model(["x", "y"], ["x + dt*y", "y"], discrete=True)
    d = derive(m)
    assert sp.Matrix([[1, d.dt], [0, 1]]) == d.F


# ---- SymPy -----------------------------------------------------------------------------------------------------------


def from_symbols():
    x, y, k, mx = sp.symbols("x y k mx")
    return pz.Model([x, y], sp.Matrix([y, -k * x]), [pz.Sensor("range", [sp.sqrt((x - mx) ** 2 + y**2)])], [k])


def test_sympy_and_text_are_the_same_model():
    m = from_symbols()
    assert all(isinstance(e, str) for e in m.dynamics)
    text = pz.Model(["x", "y"], list(m.dynamics), [pz.Sensor("range", list(m.sensors[0].equations))], ["k"])
    assert m == text
    assert hash(m) == hash(text)
    assert m == from_symbols()
    assert derive(m).F == derive(model()).F
    assert derive_sensor(m, m.sensors[0]).H == derive_sensor(model(), RANGE).H


def test_models_are_values():
    m = model(groups={"position": ["x"]}, units={"x": "m"})
    assert pickle.loads(pickle.dumps(m)) == m == copy.deepcopy(m) == replace(m)
    assert len({m, copy.deepcopy(m), model()}) == 2
    assert replace(m, parameters=["k", "c"]).parameter_names == ("k", "c")
    with pytest.raises(FrozenInstanceError):
        m.states = ("a",)
    sensor = pz.Sensor("radar", {"d": "x", "a": "atan2(y, x)"}, angles=["a"], units={"d": "m"})
    assert replace(sensor, equations={"d": "2*x", "a": "y"}).components == ("d", "a")
    assert pickle.loads(pickle.dumps(sensor)) == sensor
    assert hash(sensor) == hash(copy.deepcopy(sensor))


def test_a_model_of_text_needs_no_sympy():
    code = (
        "import sys, piazzi as pz; pz.Model(['x'], ['-k*x'], [pz.Sensor('s', ['x**2'])], ['k']); print('sympy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "False\n"


# ---- parameters and sensors ------------------------------------------------------------------------------------------


def test_roles_sort_the_parameters():
    m = model(parameters={"k": "fixed", "a": "estimated", "b": "considered", "c": "estimated"})
    assert m.names == ("x", "y", "a", "c")
    assert m.given == ("k", "b")
    assert m.n == 4
    assert model(parameters=[pz.Parameter("k", "estimated", "1/s"), "c"]).unit("k") == "1/s"
    refused("parameter 'k' has role 'unknown'; roles are fixed, estimated, considered", parameters={"k": "unknown"})


def test_jacobians_include_the_estimated_constants():
    m = model(parameters={"k": "estimated"}, sensors=[pz.Sensor("s", ["k*x"])])
    x, _, k = derive(m).x
    assert sp.Matrix([[0, 1, 0], [-k, 0, -x]]) == derive(m).F
    assert sp.Matrix([[k, 0, x]]) == derive_sensor(m, m.sensors[0]).H


def test_free_names_of_a_sensor_are_numbers_of_its_stations():
    m = model(sensors=[pz.Sensor("s", {"a": "x*zeta + k*t", "b": "beta - y*alpha"})])
    assert m.numbers(m.sensors[0]) == ("alpha", "beta", "zeta")
    assert m.width == 2


def test_components_and_their_names():
    assert pz.Sensor("range-rate", ["x"]).components == ("range_rate",)
    assert pz.Sensor("radar", ["x", "y"]).components == ("radar_0", "radar_1")
    assert pz.Sensor("camera", ["x", "y"], angles=["ra", "dec"]).components == ("ra", "dec")
    assert pz.Sensor("camera", "x + y").equations == ("x + y",)
    sensor = pz.Sensor("radar", {"d": "x", "a": "atan2(y, x)"}, angles=["a"], units={"d": "m"})
    assert sensor.is_angle == (False, True)
    assert sensor.units == (("d", "m"), ("a", "rad"))


def test_bad_sensors():
    for match, arguments in [
        ("has no equations", {"equations": {}}),
        ("angles names 'azimut'; its components are azimuth", {"equations": {"azimuth": "x"}, "angles": ["azimut"]}),
        ("units names 'range'; its components are azimuth", {"equations": {"azimuth": "x"}, "units": {"range": "m"}}),
        ("angles names 'a'; its components are s_0, s_1", {"equations": ["x", "y"], "angles": ["a", "a"]}),
        ("component 'a b' cannot be used", {"equations": {"a b": "x"}}),
    ]:
        with pytest.raises(ValueError, match=match):
            pz.Sensor("s", **arguments)


def test_unknown_sensor_is_told_with_the_nearest():
    with pytest.raises(ValueError, match="unknown sensor 'rang'; did you mean 'range'"):
        model().sensor("rang")


def test_groups_and_units():
    m = model(groups={"position": ["x"], "all": ["y", "x"]}, units={"x": "m"})
    assert m.group_indices == {"position": (0,), "all": (1, 0)}
    assert m.unit("x") == "m"
    assert m.unit("y") == ""


# ---- derivatives of everything the language has ----------------------------------------------------------------------


def test_jacobian_of_magnitudes_is_real():
    """Also of a logarithm or an arc sine, which SymPy takes for possibly complex."""
    m = pz.Model(["x", "y"], ["abs(log(x)*y) + sign(asin(x))*y", "abs(x**y) + max(abs(x - y), sqrt(x))"])
    F = derive(m).F
    assert not F.has(sp.re, sp.im, sp.arg, sp.Derivative, sp.DiracDelta, sp.Subs)
    x, y = derive(m).x
    at = {x: sp.Float(0.3), y: sp.Float(0.8)}
    h = sp.Float("1e-8", 40)
    for i, v in enumerate((x, y)):
        moved = [derive(m).f.evalf(40, subs={**at, v: at[v] + s * h}) for s in (1, -1)]
        numeric = [float(v) for v in (moved[0] - moved[1]) / (2 * h)]
        assert [float(v) for v in F[:, i].evalf(30, subs=at)] == pytest.approx(numeric, rel=1e-9)
