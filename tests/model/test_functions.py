"""Functions from outside, roots, the state at another instant: a model with them does what its twin in symbols does."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.model.functions import Signature
from piazzi.study.ensemble import Layout, filter_runs, simulate_runs

C = 10.0  # speed of signals
WELL = """@inline
def well(x, y, data, at):
    r2 = x*x + y*y
    k = data[at]/(r2*sqrt(r2))
    return k*x, k*y


@inline
def well_partials(x, y, data, at):
    r2 = x*x + y*y
    k = data[at]/(r2*sqrt(r2))
    return k*x, k*y, k - 3.0*k*x*x/r2, -3.0*k*x*y/r2, -3.0*k*x*y/r2, k - 3.0*k*y*y/r2"""


class Well:
    """Gravity of a point in the plane, as a function from outside."""

    signature = Signature("well", 2, 2, ((0, 0), (0, 1), (1, 0), (1, 1)), code=WELL)

    def __init__(self, strength, span=None):
        self.strength, self.span = strength, span

    @property
    def checksum(self):
        return f"{self.strength}"

    def block(self, first, last):
        return np.array([self.strength])

    def value(self, x, y):
        return self.strength * x / np.hypot(x, y) ** 3, self.strength * y / np.hypot(x, y) ** 3


INSIDE = {"gx": "-x/sqrt(x**2 + y**2)**3", "gy": "-y/sqrt(x**2 + y**2)**3"}
RADAR = pz.Sensor(
    "radar", {"rho": "rho_0", "bearing": "atan2(y - 1, x - 3)"}, ["bearing"], definitions={"rho_0": "hypot(x - 3, y - 1)"}
)
DELAYED = pz.Sensor(
    "delayed",
    {"delay": "tau"},
    roots={"tau": {"root": f"rho/{C} - tau", "definitions": {"rx, ry": "at(-tau)", "rho": "sqrt((rx - 3)**2 + (ry - 1)**2)"}}},
)
QUADRATIC = pz.Sensor(
    "quadratic",
    {"delay": "tau"},
    roots={
        "tau": {
            "root": f"rho/{C} - tau",
            "definitions": {"rx, ry": "at(-tau, order=2)", "rho": "sqrt((rx - 3)**2 + (ry - 1)**2)"},
        }
    },
)
TWO_WAY = pz.Sensor(
    "two_way",
    {"range": f"{C}*(up + down)/2"},
    definitions={"px": "3 + 0.1*sin(t)"},
    roots={
        "down": {"root": f"rho/{C} - down", "definitions": {"rx, ry": "at(-down)", "rho": "hypot(rx - px, ry - 1)"}},
        "up": {
            "root": f"leg/{C} - up",
            "definitions": {"ux": "3 + 0.1*sin(t - down - up)", "leg": "hypot(rx - ux, ry - 1)"},
        },
    },
)
X = np.array([1.0, 0.1, 0.0, 1.0])


def problem(outside=True, sensors=(RADAR, DELAYED, QUADRATIC, TWO_WAY), use=("radar", "delayed"), strength=-1.0, **changes):
    model = pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "gx", "gy - drag*vy"],
        sensors,
        ["drag"],
        {"position": ["x", "y"], "velocity": ["vx", "vy"]},
        definitions={"gx, gy": "field(x, y)"} if outside else INSIDE,
        functions={"field": Well.signature} if outside else {},
    )
    stations = [pz.Station(name, name, [1e-4] * model.sensor(name).width) for name in use]
    functions = {"functions": {"field": Well(strength)}} if outside else {}
    return pz.Problem(
        model,
        pz.Gaussian(X, [1e-2] * 4),
        [0, 0, 1e-6, 1e-6],
        stations,
        {"drag": 0.05},
        pz.RungeKutta4(4),
        **functions | changes,
    )


ALL = ("radar", "delayed", "quadratic", "two_way")
QUICK = [pz.ExtendedKalmanFilter(), pz.FactorGraph()]  # the others take a kernel or two of ten seconds each
OTHERS = [
    pz.UnscentedKalmanFilter(),
    pz.SquareRootKalmanFilter(),
    pz.Smoother(),
    pz.SlidingWindow(10),
    pz.BatchLeastSquares(),
    pz.FactorGraph(loss=pz.Huber(2.0)),
]
ESTIMATORS = [*QUICK, *(pytest.param(e, marks=pytest.mark.slow) for e in OTHERS)]


def differences(f, x, h=1e-6):
    return np.stack([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=-1)


@pytest.mark.parametrize("station", ALL)
def test_a_model_with_a_function_is_its_twin_in_symbols(station, monkeypatch):
    a, b = problem(use=ALL), problem(outside=False, use=ALL)
    with monkeypatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")  # the twin, whose kernels nobody else needs
        f, F, h, H = b.dynamics(X), b.dynamics_jacobian(X), b.measure(station, X, 0.3), b.measurement_jacobian(station, X, 0.3)
    np.testing.assert_allclose(a.dynamics(X), f, rtol=1e-15)
    np.testing.assert_allclose(a.dynamics_jacobian(X), F, atol=1e-15)
    np.testing.assert_allclose(a.measure(station, X, 0.3), h, rtol=1e-14)
    np.testing.assert_allclose(a.measurement_jacobian(station, X, 0.3), H, atol=1e-13)
    np.testing.assert_allclose(H, differences(lambda x: a.measure(station, x, 0.3), X), atol=2e-9)


def test_a_delay_solves_its_equation_on_the_true_orbit():
    a = problem(use=ALL)
    tau = a.measure("delayed", X)[0]
    before, _ = a.step(X, -tau)
    assert abs(np.hypot(before[0] - 3, before[1] - 1) / C - tau) < 1e-9  # four steps of order 4
    second = X[:2] - tau * X[2:] + tau**2 / 2 * a.dynamics(X)[2:]
    tau_2 = a.measure("quadratic", X)[0]
    second = X[:2] - tau_2 * X[2:] + tau_2**2 / 2 * a.dynamics(X)[2:]
    assert abs(np.hypot(second[0] - 3, second[1] - 1) / C - tau_2) < 1e-14


def test_two_legs_are_solved_one_after_the_other():
    t = 0.7
    down = tau = 0.0
    a = problem(use=ALL)

    def place(t):
        return np.array([3 + 0.1 * np.sin(t), 1.0])

    for _ in range(60):
        at_bounce = a.step(X, -down)[0][:2] if down else X[:2]
        down = np.linalg.norm(at_bounce - place(t)) / C
    for _ in range(60):
        tau = np.linalg.norm(at_bounce - place(t - down - tau)) / C
    np.testing.assert_allclose(a.measure("two_way", X, t)[0], C * (down + tau) / 2, rtol=1e-8)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: f"{type(e).__name__}-{getattr(e, 'loss', '')}"[:40])
def test_every_estimator_takes_functions_and_roots(estimator):
    a, b = problem(sensors=(RADAR, DELAYED)), problem(outside=False, sensors=(RADAR, DELAYED))
    tracking = pz.simulate(b, np.arange(0.0, 4.0, 0.1), np.random.default_rng(1))
    ours, twin = estimator.estimate(a, tracking), estimator.estimate(b, tracking)
    assert ours.success and twin.success
    np.testing.assert_allclose(ours.mean, twin.mean, atol=1e-11)
    np.testing.assert_allclose(ours.covariance, twin.covariance, atol=1e-12)


def test_simulations_are_the_same_with_a_function():
    times = np.arange(0.0, 2.0, 0.1)
    sensors = (RADAR, DELAYED)
    a, b = (pz.simulate(problem(outside, sensors), times, np.random.default_rng(3)) for outside in (True, False))
    np.testing.assert_allclose(a.truth, b.truth, rtol=1e-13)
    np.testing.assert_allclose(a.padded(2), b.padded(2), atol=1e-12)


def test_a_live_filter_is_the_whole_run():
    a = problem(sensors=(RADAR, DELAYED))
    tracking = pz.simulate(a, np.arange(0.0, 2.0, 0.1), np.random.default_rng(5))
    whole = pz.ExtendedKalmanFilter().estimate(a, tracking)
    live = pz.ExtendedKalmanFilter().start(a)
    for k, t in enumerate(tracking.times):
        live.predict(t)
        for row in range(tracking.first_row[k], tracking.first_row[k + 1]):
            station = a.stations[tracking.stations_of(a)[row]]
            live.update(station.name, tracking.padded(2)[row][: len(station.noise)])
    np.testing.assert_array_equal(live.mean, whole.mean[-1])


def test_other_data_compile_nothing():
    a, b = problem(), problem(strength=-2.0)
    assert a.spec("transition", "rates") is b.spec("transition", "rates")
    np.testing.assert_allclose(b.dynamics(X)[2], 2 * a.dynamics(X)[2])
    assert replace(a, name="copy").functions["field"] is a.functions["field"]


def test_copies_have_the_data():
    a = problem()
    a.dynamics(X)
    for other in (copy.deepcopy(a), pickle.loads(pickle.dumps(a))):
        np.testing.assert_array_equal(other.dynamics(X), a.dynamics(X))


def test_a_call_may_stand_within_an_equation_and_is_made_once_for_its_arguments():
    code = (
        "@inline\ndef slope(u, data, at):\n    return (data[at]*u,)\n\n\n"
        "@inline\ndef slope_partials(u, data, at):\n    return data[at]*u, data[at]\n"
    )

    class Slope:
        signature = Signature("slope", 1, 1, ((0, 0),), code=code)
        span, checksum = None, "2"

        def block(self, first, last):
            return np.array([2.0])

        def value(self, u):
            return (2.0 * u,)

    model = pz.Model(["x", "y"], ["y*slope(x + y) - slope(x + y)", "-x"], functions={"slope": Slope()})
    assert len([d for d in model.definitions if d.function]) == 1
    p = pz.Problem(model, pz.Gaussian([0.5, 0.25], [1, 1]), functions={"slope": Slope()})
    x = np.array([0.5, 0.25])
    np.testing.assert_allclose(p.dynamics(x), [0.25 * 1.5 - 1.5, -0.5], rtol=1e-15)
    np.testing.assert_allclose(p.dynamics_jacobian(x), differences(p.dynamics, x), atol=1e-9)


def test_sympy_calls_are_as_good_as_text():
    import sympy as sp

    x, y, vx, vy, gx, gy, drag = sp.symbols("x y vx vy gx gy drag", real=True)
    by_symbols = pz.Model(
        [x, y, vx, vy],
        [vx, vy, gx, gy - drag * vy],
        [RADAR, DELAYED, QUADRATIC, TWO_WAY],
        ["drag"],
        {"position": ["x", "y"], "velocity": ["vx", "vy"]},
        definitions={(gx, gy): sp.Function("field")(x, y)},
        functions={"field": Well.signature},
    )
    assert by_symbols.definitions == problem().model.definitions


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"definitions": {"gx, gy": "field(x)"}}, r"field\(x\): field takes 2 arguments, got 1"),
        ({"definitions": {"gx, gy, gz": "field(x, y)"}}, "gives 2 values, not 3"),
        ({"definitions": {"gx, gy": "feild(x, y)"}}, "'feild' is not a function; did you mean 'field'"),
        ({"definitions": {"gx": "2*field(x, y)", "gy": "x"}}, "gives 2 values: name them in a definition"),
        ({"definitions": {"gx, gy": "x*y"}}, "several values, which only a function from outside gives"),
        ({"definitions": {"gx, gy": "at(1)"}}, "'at' is not a function"),
        ({"functions": {"sin": Well.signature}}, "function 'sin' cannot be used as a name: it is one of the language"),
        ({"functions": {"field": Well.signature, "at": Well.signature}}, "function 'at' has a meaning already"),
        ({"functions": {"field": 3}}, "function 'field' is 3; it must be a function"),
        ({"functions": {"field": Well.signature, "x": Well.signature}}, "function 'x' is also a state"),
    ],
)
def test_calls_that_cannot_be_are_refused(changes, message):
    given = {"definitions": {"gx, gy": "field(x, y)"}, "functions": {"field": Well.signature}} | changes
    with pytest.raises(ValueError, match=message):
        pz.Model(["x", "y"], ["gx", "gy"], **given)


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"definitions": {"a": "at(1, 3)"}}, r"write at\(offset\), or at\(offset, order=2\)"),
        ({"definitions": {"a, b, c": "at(1)"}}, "gives the 2 states, not 3 values"),
        ({"definitions": {"a": "nothing(x)"}}, "sensor 's': 'nothing' is not a function"),
        ({"roots": {"a": {"start": "0"}}}, "root 'a' has no equation"),
        ({"roots": {"a": {"root": "a - x", "begin": "0"}}}, "root 'a' has 'begin'"),
        ({"roots": {"a": {"root": "a - x", "iterations": 0}}}, "it must be a whole number from 1 to 20"),
    ],
)
def test_sensors_that_cannot_be_are_refused(sensor, message):
    with pytest.raises(ValueError, match=message):
        pz.Model(["x", "y"], ["y", "-x"], [pz.Sensor("s", ["a"], **sensor)])


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        ({}, "function 'field' of the model has no data"),
        ({"field": Well(1.0), "feild": Well(1.0)}, "function 'feild' is not one of the model's; did you mean 'field'"),
        ({"field": Well.signature}, "is a signature only"),
        ({"field": Well(-1.0, span=(10.0, 20.0))}, "'field' has values from t = 10 to 20 s, and t = "),
    ],
)
def test_data_that_cannot_be_are_refused(functions, message):
    with pytest.raises(ValueError, match=message):
        problem(functions=functions).dynamics(X, 0.0)


def test_a_root_that_is_not_found_is_no_number():
    nowhere = pz.Sensor("nowhere", ["a"], roots={"a": {"root": "a**2 + 1 + x**2", "start": "0.3"}})
    with pytest.raises(ValueError, match="root 'a' of station 'nowhere' has no solution at the prior mean"):
        problem(sensors=(nowhere,), use=("nowhere",))


def test_a_model_shows_its_calls_and_roots(capsys):
    problem().model.show()
    shown = capsys.readouterr().out
    for line in (
        "field: well, 2 arguments, 2 values",
        "gx, gy = field(x, y)",
        "∂gx/∂x, ∂gx/∂y, ∂gy/∂x, ∂gy/∂y: given by well",
        "rx, ry = at(-tau)",
        "rx, ry = at(-tau, order=2)",
        "tau solves 0.1*rho - tau = 0",
    ):
        assert f"\n  {line}\n" in shown, line
    assert "station_table" not in shown and len(max(shown.splitlines(), key=len)) < 400


@pytest.mark.slow  # kernels of eight seconds; roots in lanes have a test of their own
def test_runs_of_a_study_side_by_side_are_the_runs_one_by_one():
    times = np.arange(0.0, 2.0, 0.1)
    scaled = pz.ProcessNoise([0.0, 0.0, 1e-6, 1e-6], "second", "scaled")
    p, rng = replace(problem(sensors=(RADAR, DELAYED), use=("delayed",)), process_noise=scaled), np.random.default_rng(4)
    assert p.runs_in_ensemble
    layout = Layout(p, times)
    first = X + 0.05 * rng.standard_normal((11, 4))
    truth, z = simulate_runs(layout, p, first, rng.standard_normal((11, 20, 4)), rng.standard_normal((11, 20, 2)))
    mean, _, _ = filter_runs(layout, z, truth)
    for run in range(11):
        tracking = pz.Tracking(times, z[run], ["delayed"] * 20, truth[run])
        np.testing.assert_allclose(mean[run], pz.ExtendedKalmanFilter().estimate(p, tracking).mean[-1], atol=1e-10)


def test_a_study_tells_data_apart():
    study = {s: pz.Study(problem(strength=s), [0.0, 1.0], [pz.Smoother()], runs=2).digest for s in (-1.0, -1.01)}
    assert len(set(study.values())) == 2
