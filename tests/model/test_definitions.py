"""Definitions: the same model said with names and said in full, in every function that is made of it; and what is refused."""

import pickle
import re

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.kernels.generate import model_source
from piazzi.model.derivation import derive

NAMES = {"states": ["x", "y", "vx", "vy"], "parameters": ["mu", pz.Parameter("k", "estimated")]}
GROUPS = {"position": ["x", "y"], "velocity": ["vx", "vy"]}
FULL = pz.Model(
    dynamics=[
        "vx",
        "vy",
        "-mu*x/(x**2 + y**2)**1.5 - k*sqrt(vx**2 + vy**2)*vx",
        "-mu*y/(x**2 + y**2)**1.5 - k*sqrt(vx**2 + vy**2)*vy",
    ],
    sensors=[pz.Sensor("radar", ["sqrt((x - mx)**2 + (y - my)**2)", "atan2(y - my, x - mx)*exp(k*cos(t))"])],
    groups=GROUPS,
    **NAMES,
)
NAMED = pz.Model(
    definitions={"pull": "-mu/r**3", "brake": "k*sqrt(vx**2 + vy**2)", "r": "sqrt(x**2 + y**2)", "wave": "exp(k*cos(t))"},
    dynamics=["vx", "vy", "pull*x - brake*vx", "pull*y - brake*vy"],
    sensors=[
        pz.Sensor("radar", ["rho", "atan2(dy, dx)*wave"], definitions={"rho": "hypot(dx, dy)", "dx": "x - mx", "dy": "y - my"})
    ],
    groups=GROUPS,
    **NAMES,
)


def problem(model: pz.Model, **changes) -> pz.Problem:
    given = {
        "prior": pz.Gaussian.from_sigma([11.0, 0.5, 0.3, 9.5], [0.3, 0.3, 0.3, 0.3]),
        "process_noise": pz.ProcessNoise([0.0, 0.0, 1e-3, 2e-3]),
        "stations": [pz.Station("one", "radar", noise=np.diag([1e-2, 1e-4]), numbers={"mx": 8.0, "my": -2.0})],
        "parameters": {"mu": 1000.0, "k": pz.Gaussian(0.02, 1e-4)},
        "integrator": pz.RungeKutta4(5),
    }
    return pz.Problem(model, **(given | changes))


# ---- the same model in other words ---------------------------------------------------------------------------------------


@pytest.fixture
def uncompiled(monkeypatch):
    """The same source as compiled, without the wait."""
    monkeypatch.setenv("PIAZZI_JIT", "0")


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize(
    "integrator",
    [
        pytest.param(pz.RungeKutta4(3), id="rk4"),
        pytest.param(pz.Taylor(3), id="taylor", marks=pytest.mark.slow),
        pytest.param(pz.DormandPrince(), id="dp", marks=pytest.mark.slow),
    ],
)
def test_rates_steps_measurements_and_their_derivatives_are_those_of_the_model_in_full(integrator):
    full, named = problem(FULL, integrator=integrator), problem(NAMED, integrator=integrator)
    rng = np.random.default_rng(0)
    x = np.column_stack([rng.normal(11, 2, (9, 2)), rng.normal(0, 5, (9, 2)), rng.normal(0.02, 0.01, 9)])
    for of in (
        lambda p: p.dynamics(x, 0.7),
        lambda p: p.dynamics_jacobian(x, 0.7),
        lambda p: p.step(x, 0.2, 0.7)[0],
        lambda p: p.step(x, 0.2, 0.7)[1],
        lambda p: p.measure("one", x, 0.7),
        lambda p: p.measurement_jacobian("one", x, 0.7),
    ):
        assert_allclose(of(named), of(full), rtol=1e-13, atol=1e-13)


def test_partials_are_those_of_central_differences():
    p, x, h = problem(NAMED), np.array([11.0, -3.0, 1.0, 9.0, 0.03]), 1e-6
    differences = np.column_stack([(p.dynamics(x + h * e, 0.4) - p.dynamics(x - h * e, 0.4)) / (2 * h) for e in np.eye(5)])
    assert_allclose(p.dynamics_jacobian(x, 0.4), differences, rtol=1e-8, atol=1e-8)
    differences = np.column_stack(
        [(p.measure("one", x + h * e, 0.4) - p.measure("one", x - h * e, 0.4)) / (2 * h) for e in np.eye(5)]
    )
    assert_allclose(p.measurement_jacobian("one", x, 0.4), differences, rtol=1e-8, atol=1e-8)


ESTIMATORS = [
    *(pz.ExtendedKalmanFilter(), pz.UnscentedKalmanFilter(), pz.SquareRootKalmanFilter(), pz.Smoother()),
    *(pz.FactorGraph(), pz.SlidingWindow(10), pz.SlidingWindow(10, loss="huber"), pz.BatchLeastSquares()),
]


@pytest.mark.usefixtures("uncompiled")
@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_every_estimator_gives_the_same_with_names_and_in_full(estimator):
    full, named = problem(FULL, integrator=pz.RungeKutta4(1)), problem(NAMED, integrator=pz.RungeKutta4(1))
    tracking = pz.simulate(full, np.arange(15) * 0.1, np.random.default_rng(3))
    one, other = estimator.estimate(full, tracking), estimator.estimate(named, tracking)
    assert one.success and other.success
    sigma = np.sqrt(np.diagonal(one.covariance, axis1=1, axis2=2))
    assert np.abs((one.mean - other.mean) / sigma).max() < 1e-6
    assert_allclose(other.covariance, one.covariance, rtol=1e-6, atol=1e-9)


@pytest.mark.usefixtures("uncompiled")
def test_simulated_tracking_is_the_same():
    one, other = (pz.simulate(problem(m), np.arange(30) * 0.1, np.random.default_rng(5)) for m in (FULL, NAMED))
    assert_allclose(one.values, other.values, rtol=1e-12)


def test_uncompiled_source_gives_the_same(monkeypatch):
    compiled = problem(NAMED).dynamics_jacobian(np.array([11.0, -3.0, 1.0, 9.0, 0.03]), 0.4)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    assert_allclose(problem(NAMED).dynamics_jacobian(np.array([11.0, -3.0, 1.0, 9.0, 0.03]), 0.4), compiled, rtol=1e-14)


@pytest.mark.usefixtures("uncompiled")
def test_an_explicit_step_may_use_definitions_of_the_length_of_the_step():
    named = pz.Model(["x", "v"], ["x + move", "v - dt*k*x"], parameters=["k"], definitions={"move": "dt*v"}, discrete=True)
    full = pz.Model(["x", "v"], ["x + dt*v", "v - dt*k*x"], parameters=["k"], discrete=True)
    steps = [
        pz.Problem(m, pz.Gaussian([0.0, 0.0], np.eye(2)), parameters={"k": 2.0}, integrator=pz.Discrete()).step(
            [1.0, 2.0], 0.1, 0.0
        )
        for m in (full, named)
    ]
    for one, other in zip(*steps, strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-15)


@pytest.mark.usefixtures("uncompiled")
def test_a_number_of_a_station_that_is_estimated_is_found_in_definitions():
    stations = [
        pz.Station("one", "radar", noise=np.diag([1e-2, 1e-4]), numbers={"mx": pz.Gaussian(8.0, 0.1), "my": -2.0}),
        pz.Station("two", "radar", noise=np.diag([1e-2, 1e-4]), numbers={"mx": 1.0, "my": 12.0}),
    ]
    full, named = problem(FULL, stations=stations), problem(NAMED, stations=stations)
    assert named.model.names == full.model.names == ("x", "y", "vx", "vy", "k", "mx_one")
    x = np.array([11.0, -3.0, 1.0, 9.0, 0.03, 8.1])
    assert_allclose(named.measurement_jacobian("one", x, 0.0), full.measurement_jacobian("one", x, 0.0), rtol=1e-13, atol=1e-14)
    assert_allclose(named.measurement_jacobian("two", x, 0.0), full.measurement_jacobian("two", x, 0.0), rtol=1e-13, atol=1e-14)


@pytest.mark.usefixtures("uncompiled")
def test_a_rule_of_the_truth_may_use_definitions():
    truth = pz.Truth(accept=("r - 11",))
    p = problem(NAMED, truth=truth)
    radii = []
    for seed in range(20):
        tracking = pz.simulate(p, [0.0, 0.1], np.random.default_rng(seed))
        radii.append(np.hypot(*tracking.truth[0][:2]))
    assert min(radii) > 11.0
    with pytest.raises(ValueError, match="unknown name 'wave'"):  # it changes with time, and a rule is of the first state
        pz.simulate(problem(NAMED, truth=pz.Truth(accept=("wave",))), [0.0, 0.1], np.random.default_rng(0))


def test_kepler_knows_two_body_motion_said_with_definitions():
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "pull*x", "pull*y"],
        parameters=["mu"],
        groups=GROUPS,
        definitions={"pull": "-mu/hypot(x, y)**3"},
    )
    prior = pz.Gaussian([7e6, 0.0, 0.0, 7500.0], np.eye(4))
    pz.Problem(model, prior, parameters={"mu": 3.986e14}, integrator=pz.Kepler("mu"))


# ---- how it is derived and printed ---------------------------------------------------------------------------------------


def test_nothing_is_substituted():
    d = derive(NAMED)
    assert sp.Symbol("r", real=True) not in d.f.free_symbols and sp.Symbol("pull", real=True) in d.f.free_symbols
    source = model_source(NAMED, pz.RungeKutta4(1).scheme, 1)
    rates = source.partition("def scalar_f(")[2].partition("\n\n")[0]
    assert rates.count("x0*x0") == 1


def test_source_and_derivation_grow_with_the_number_of_definitions():
    """Substituted, each would double the one before it."""

    def chain(length: int) -> pz.Model:
        steps = {"d0": "x*y"} | {f"d{i}": f"sin(d{i - 1})*d{i - 1} + x" for i in range(1, length)}
        return pz.Model(["x", "y"], [f"d{length - 1}", "-x"], definitions=steps)

    short, long = (len(model_source(chain(n), pz.RungeKutta4(1).scheme, 1)) for n in (20, 40))
    fixed = len(model_source(pz.Model(["x", "y"], ["y", "-x"]), pz.RungeKutta4(1).scheme, 1))
    assert long - fixed < 2.5 * (short - fixed)


def test_a_model_shows_its_definitions(capsys):
    NAMED.show()
    shown = capsys.readouterr().out
    assert "\ndefinitions\n" in shown and "\n  pull = -mu/r**3\n" in shown
    assert "\nderivatives of definitions\n" in shown and "∂pull/∂x = 3*mu*∂r/∂x/r**4\n" in shown
    assert "\ndefinitions of radar\n" in shown


def test_models_with_definitions_are_values():
    again = pickle.loads(pickle.dumps(NAMED))
    assert again == NAMED and hash(again) == hash(NAMED) and NAMED != FULL
    assert [name for name, _ in NAMED.definitions] == ["brake", "r", "wave", "pull"]  # by need


def test_sympy_definitions_are_as_good_as_text():
    x, y = sp.symbols("x y", real=True)
    model = pz.Model([x, y], [y, sp.Symbol("g", real=True)], definitions={sp.Symbol("g"): -x / (x**2 + y**2)})
    assert dict(model.definitions) == {"g": "-x/(x**2 + y**2)"}


# ---- what is refused -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("definitions", "message"),
    [
        ({"a": "b", "b": "c", "c": "a"}, "definitions: 'a' and 'b' and 'c' need each other"),
        ({"a": "a + x"}, "definitions: 'a' and itself need each other"),
        ({"a": "x", "b": "y"}, "definition 'b' is used by no equation"),
        ({"a": "x", "x": "y"}, "definition 'x' is also a state: every name has one meaning"),
        ({"a": "z"}, "definition 'a' uses 'z', which is neither a state nor a parameter"),
        ({"a b": "x"}, "definition 'a b' cannot be used as a name"),
        ({"a": "__import__('os')"}, "."),
        ({"a": "x", "t": "y"}, "definition 't' is also the time"),
    ],
)
def test_definitions_that_cannot_be_are_refused_by_name(definitions, message):
    with pytest.raises(ValueError, match=message) as refused:
        pz.Model(["x", "y"], ["a", "x"], definitions=definitions)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("definitions", "message"),
    [
        ({"rho": "hypot(x, y)", "u": "x"}, "sensor 's': definition 'u' is used by no equation"),
        ({"rho": "rho2**0.5", "rho2": "rho**2"}, "sensor 's': 'rho' and 'rho2' need each other"),
    ],
)
def test_definitions_of_sensors_that_cannot_be_are_refused(definitions, message):
    with pytest.raises(ValueError, match=message):
        pz.Sensor("s", ["rho"], definitions=definitions)


def test_a_name_means_one_thing_in_model_and_sensor():
    sensor = pz.Sensor("s", ["r + q"], definitions={"r": "x", "q": "y"})
    with pytest.raises(ValueError, match="sensor 's' defines 'r', which is also a definition"):
        pz.Model(["x", "y"], ["r", "x"], [sensor], definitions={"r": "y"})


def test_no_measurement_has_a_length_of_a_step():
    with pytest.raises(ValueError, match="sensor 's' uses 'dt'"):
        pz.Model(["x"], ["x + move"], [pz.Sensor("s", ["move"])], definitions={"move": "dt*x"}, discrete=True)


# ---- in scenarios --------------------------------------------------------------------------------------------------------

SCENARIO = """
states = ["x", "v"]
[parameters]
k = 2.0
[definitions]
pull = "-k*stretch"
stretch = "x - 1"
[dynamics]
x = "v"
v = "pull"
[sensors.eye]
numbers = ["far"]
[sensors.eye.definitions]
rho = "sqrt(stretch**2 + far**2)"
[sensors.eye.components]
range = "rho"
[[stations]]
name = "a"
sensor = "eye"
noise = { sigma = 0.1 }
numbers = { far = 3.0 }
[prior]
mean = [0.0, 1.0]
sigma = [1.0, 1.0]
[integrator]
method = "rk4"
[times]
step = 0.1
count = 20
"""


def test_scenarios_have_definitions(tmp_path):
    file = tmp_path / "spring.toml"
    file.write_text(SCENARIO)
    problem, tracking = pz.load(file)
    assert dict(problem.model.definitions) == {"stretch": "x - 1", "pull": "-k*stretch"}
    assert pz.FactorGraph().estimate(problem, tracking).success


def test_a_recording_keeps_definitions(tmp_path):
    from piazzi.io.netcdf import write_netcdf

    file, recording = tmp_path / "spring.toml", tmp_path / "spring.nc"
    file.write_text(SCENARIO)
    problem, tracking = pz.load(file)
    write_netcdf(recording, problem, tracking)
    assert pz.load(recording)[0].model == problem.model


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('stretch = "x - 1"', 'stretch = "y - 1"', r"definitions\.stretch.*unknown name 'y'"),
        ('stretch = "x - 1"', 'stretch = "pull"', "need each other"),
        ('stretch = "x - 1"', 'stretch = "x - 1"\nk = "3"', r"definitions\.k.*is also a state or a parameter"),
        ('stretch = "x - 1"', 'stretch = "x - 1"\nmore = "3"', "definition 'more' is used by no equation"),
        ('stretch = "x - 1"', "stretch = [1]", r"definitions\.stretch.*must be an equation in quotes"),
        ('rho = "sqrt', 'far = "1"\nrho = "sqrt', r"sensors\.eye\.definitions.*names 'far', which has a meaning already"),
        ('rho = "sqrt', 'pull = "1"\nrho = "sqrt', r"sensors\.eye\.definitions.*names 'pull', which has a meaning already"),
        ('range = "rho"', 'range = "rhoo"', r"unknown name 'rhoo'.*did you mean 'rho'"),
    ],
)
def test_faults_of_definitions_have_their_place(tmp_path, old, new, message):
    file = tmp_path / "spring.toml"
    assert old in SCENARIO
    file.write_text(SCENARIO.replace(old, new))
    with pytest.raises(ValueError) as refused:
        pz.load(file)
    assert re.search(message, str(refused.value)), refused.value
