"""Functions from outside and roots in scenarios: tables, files beside it, faults with their place, files that keep them."""

import tomllib

import numpy as np
import pytest

import piazzi as pz
from piazzi.earth.celestial import Asteroid
from piazzi.io.files import save
from piazzi.io.scenario_text import scenario_text
from piazzi.outside.table import Table
from piazzi.scenarios.earth_sensors import _place_of, write_place
from piazzi.scenarios.functions import read_functions, write_function
from piazzi.scenarios.loader import load_scenario
from piazzi.scenarios.table import Faults, ScenarioError
from piazzi.scenarios.table import Table as Keys
from piazzi.scenarios.write import problem_from_tables

TEXT = """title = "A pushed oscillator, seen with a delay"
[states]
x = "m"
vx = "m/s"
[functions]
push = { kind = "table", file = "push.csv" }
[definitions]
a = "push(t)"
[dynamics]
x = "vx"
vx = "a - x + 0.5*push(t + 1)"
[sensors.radar.components]
rho = "x + tau"
[sensors.radar.roots.tau]
root = "d/10 - tau"
[sensors.radar.roots.tau.definitions]
r = "at(-tau)"
d = "sqrt((r - 3)**2 + 1)"
[[stations]]
name = "a"
sensor = "radar"
noise = { sigma = 0.001 }
[prior]
mean = [1, 0]
sigma = [0.1, 0.1]
[process_noise]
variance = [0, 1e-8]
per = "second"
[times]
start = 0
stop = 5
step = 0.1
"""


def push(t):
    return np.sin(0.3 * t)


@pytest.fixture
def scenario(tmp_path):
    times = np.arange(-2.0, 12.0, 0.25)
    rows = "".join(f"{t!r},{float(push(t))!r}\n" for t in times.tolist())
    (tmp_path / "push.csv").write_text("t,a\n" + rows)

    def make(text=TEXT):
        (tmp_path / "s.toml").write_text(text)
        return tmp_path / "s.toml"

    return make


def test_a_table_beside_the_scenario_is_a_function_of_it(scenario):
    problem = load_scenario(scenario()).problem
    for t in (0.3, 4.71):
        want = [0.2, push(t) - 1.0 + 0.5 * push(t + 1)]
        np.testing.assert_allclose(problem.dynamics([1.0, 0.2], t), want, atol=1e-7)
    tau = problem.measure("a", [1.0, 0.2], 1.0)[0] - 1.0
    before = problem.step([1.0, 0.2], -tau, 1.0)[0][0]
    np.testing.assert_allclose(np.hypot(before - 3, 1) / 10, tau, rtol=1e-9)


def test_estimators_compare_on_it(scenario):
    problem = load_scenario(scenario()).problem
    tracking = pz.simulate(problem, np.arange(0.0, 5.0, 0.1), np.random.default_rng(2))
    graph = pz.FactorGraph().estimate(problem, tracking)
    smoother = pz.Smoother().estimate(problem, tracking)
    assert graph.success and smoother.success
    sigma = np.sqrt(np.diagonal(graph.covariance, axis1=1, axis2=2))
    assert np.abs((graph.mean - tracking.truth) / sigma).max() < 5
    np.testing.assert_allclose(graph.mean[-1], smoother.mean[-1], atol=0.05 * sigma[-1].max())


def test_a_recording_keeps_functions_and_roots(scenario, tmp_path):
    problem = load_scenario(scenario()).problem
    tracking = pz.simulate(problem, np.arange(0.0, 2.0, 0.1), np.random.default_rng(2))
    save(tmp_path / "r.nc", problem, tracking)
    loaded, _ = pz.load(tmp_path / "r.nc")
    assert loaded.model == problem.model
    assert loaded.functions["push"].checksum == problem.functions["push"].checksum
    np.testing.assert_array_equal(loaded.dynamics([1.0, 0.2], 0.7), problem.dynamics([1.0, 0.2], 0.7))


def test_a_session_goes_on_where_the_data_were_not_yet_wanted(scenario):
    times = np.arange(-90000.0, 300000.0, 3600.0)
    table = Table(times, np.sin(times / 30000.0))
    model = pz.Model(["x"], ["1e-4*push(t) - 1e-5*x"], [pz.Sensor("s", ["x"])], functions={"push": table})
    problem = pz.Problem(model, pz.Gaussian([0.0], 1.0), [1e-9], pz.Station("s", "s", 1e-2), functions={"push": table})
    tracking = pz.simulate(problem, np.arange(0.0, 250000.0, 5000.0), np.random.default_rng(1))
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    other = pz.Problem(model, pz.Gaussian([0.0], 1.0), [1e-9], pz.Station("s", "s", 1e-2), functions={"push": table})
    live = pz.ExtendedKalmanFilter().start(other)
    for k, t in enumerate(tracking.times):
        live.update("s", tracking.values[k, 0], t)
        np.testing.assert_array_equal(live.mean, whole.mean[k])
    with pytest.raises(ValueError, match=r"'push' has values from t = -90000 to 2988"):
        live.predict(400000.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "table"', 'kind = "tabel"', r"functions\.push\.kind.*no kind of function.*table"),
        ('kind = "table", ', "", r"functions\.push\.kind.*is missing"),
        ('file = "push.csv"', 'file = "nothing.csv"', "nothing.csv"),
        ('file = "push.csv"', 'file = "push.csv", code = "x.py"', r"functions\.push\.code.*unknown key"),
        ('file = "push.csv"', "times = [0, 1]", "has no samples"),
        ("push(t)", "push(t, x)", r"push takes 1 argument, got 2"),
        ("push(t)", "pusj(t)", r"'pusj' is not a function; did you mean 'push'"),
        ("push(t)", "push(z)", r"definitions\.a.*unknown name 'z'"),
        ("push(t)", "push(t_value)", r"definitions\.a.*unknown name 't_value'"),
        ("d/10 - tau", "d/10 - tua", r"roots\.tau\.root.*unknown name 'tua'"),
        ('root = "d/10 - tau"', 'iterations = 3', r"roots\.tau\.root.*is missing"),
        ("at(-tau)", "at(-tau, order=3)", r"write at\(offset\), or at\(offset, order=2\)"),
        ("start = 0\n", "start = 11\n", "'push' has values|t \\+ 1"),
    ],
)  # fmt: skip
def test_faults_have_their_place(scenario, old, new, message):
    assert old in TEXT
    with pytest.raises((ScenarioError, ValueError, OSError), match=message):
        found = load_scenario(scenario(TEXT.replace(old, new, 1).replace("stop = 5", "stop = 15")))
        pz.simulate(found.problem, np.arange(11.0, 15.0), np.random.default_rng(1))


EARTH = """epoch = "2016-02-13T16:00:00 UTC"
[states]
x = "m"
y = "m"
z = "m"
vx = "m/s"
vy = "m/s"
vz = "m/s"
[functions]
field = { kind = "gravity", model = "EGM2008", degree = 8 }
fixed = { kind = "rotation", from = "GCRF", to = "ITRF" }
free = { kind = "rotation", from = "ITRF", to = "GCRF" }
sun = { kind = "body", body = "sun" }
[definitions]
"bx, by, bz" = "fixed(t, x, y, z)"
"gx, gy, gz" = "field(bx, by, bz)"
"ax, ay, az" = "free(t, gx, gy, gz)"
"sx, sy, sz" = "sun(t)"
[dynamics]
x = "vx"
y = "vy"
z = "vz"
vx = "ax + 1e-30*sx"
vy = "ay + 1e-30*sy"
vz = "az + 1e-30*sz"
[sensors.fix.components]
x_seen = "x"
[[stations]]
name = "a"
sensor = "fix"
noise = { sigma = 1.0 }
[prior]
mean = [7e6, 0, 0, 0, 5.3e3, 5.3e3]
sigma = [10, 10, 10, 0.1, 0.1, 0.1]
[times]
start = 0
stop = 600
step = 60
"""


def test_the_earth_of_a_scenario_is_that_of_python(scenario, tmp_path):
    problem = load_scenario(scenario(EARTH)).problem
    x, t = problem.prior.mean, 431.0
    W = pz.earth.rotation("GCRF", "ITRF", problem.epoch + t)
    want = W.T @ np.array(problem.functions["field"].value(*(W @ x[:3])))
    np.testing.assert_allclose(problem.dynamics(x, t)[3:], want, rtol=1e-10, atol=1e-12)
    tracking = pz.simulate(problem, np.arange(0.0, 300.0, 60.0), np.random.default_rng(2))
    save(tmp_path / "r.nc", problem, tracking)
    loaded, _ = pz.load(tmp_path / "r.nc")
    np.testing.assert_array_equal(loaded.dynamics(x, t), problem.dynamics(x, t))


def test_the_earth_needs_dates(scenario):
    with pytest.raises(ScenarioError, match="needs dates: give the scenario an epoch"):
        load_scenario(scenario(EARTH.replace('epoch = "2016-02-13T16:00:00 UTC"\n', "")))


def test_an_interpolation_beside_the_scenario_is_a_function_of_it(scenario, tmp_path, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    rows = [(t, x, np.sin(0.3 * t) * np.cos(x)) for t in np.arange(-2.0, 12.0, 0.25) for x in np.arange(-1.0, 3.01, 0.25)]
    (tmp_path / "wind.csv").write_text("t,x,w\n" + "".join(f"{t},{x},{w}\n" for t, x, w in rows))
    wind = 'wind = { kind = "interpolation", file = "wind.csv", outside = ["refuse", "clamp"] }'
    text = TEXT.replace("[definitions]", f"{wind}\n[definitions]")
    problem = load_scenario(scenario(text.replace('a = "push(t)"', 'a = "push(t) + wind(t, x)"'))).problem
    for x in (0.3, 1.7, 3.5):
        want = push(1.3) + np.sin(0.3 * 1.3) * np.cos(min(x, 3.0)) - x + 0.5 * push(2.3)
        np.testing.assert_allclose(problem.dynamics([x, 0.2], 1.3)[1], want, atol=1e-4)
    tracking = pz.simulate(problem, np.arange(0.0, 2.0, 0.1), np.random.default_rng(2))
    save(tmp_path / "r.nc", problem, tracking)
    again = pz.load(tmp_path / "r.nc")[0]
    assert again.checksums == problem.checksums
    np.testing.assert_array_equal(again.dynamics([1.0, 0.2], 0.7), problem.dynamics([1.0, 0.2], 0.7))


DAY = pz.Epoch("2024-03-10T00:00:00 UTC")
LOW = [6.8e6, 0.0, 0.0, 0.0, 5.4e3, 5.4e3]


def posed(forces, functions):
    """A problem of forces about the Earth or the Sun, whose numbers are all one."""
    model = forces.model(pz.Sensor("fix", ["x"]), functions=functions)
    parameters = {p.name: 1.0 for p in model.parameters}
    prior, station = pz.Gaussian(LOW, np.eye(6)), pz.Station("s", "fix", 1.0)
    return pz.Problem(model, prior, None, station, parameters, epoch=DAY, functions=functions)


def again(problem):
    """The problem that its tables give, by way of TOML."""
    tables = tomllib.loads(scenario_text(problem))
    own = {key: value for key, value in tables.items() if key not in ("times", "title", "study")}
    return problem_from_tables(own, problem.name, "here")


@pytest.mark.filterwarnings("ignore:places of planets by series")
@pytest.mark.parametrize(
    "words",
    [
        pytest.param({"degree": 4, "drag": "harris-priester"}, id="harris-priester", marks=pytest.mark.slow),
        pytest.param(
            {"degree": 4, "tides": ("solid", "k1", "pole"), "relativity": ("schwarzschild", "lense-thirring", "de-sitter")},
            id="tides, relativity",
            marks=pytest.mark.slow,
        ),
        pytest.param({"about": "sun"}, id="sun"),
    ],
)
def test_all_data_of_forces_are_written(words):
    forces = pz.earth.Forces(**words)
    problem = posed(forces, forces.functions(DAY))
    found = again(problem)
    assert found.checksums == problem.checksums
    x = [1.6e11, 2e10, 1e9, 1e3, 2e4, 1e3] if "about" in words else LOW
    np.testing.assert_array_equal(found.dynamics(x, 431.0), problem.dynamics(x, 431.0))


def read_back(function):
    faults = Faults()
    found = read_functions(Keys({"f": write_function(function)}, "functions", faults), DAY)
    assert not faults, list(faults)
    return found["f"]


def test_data_of_files_are_written_by_whole_paths(tmp_path, monkeypatch):
    kernel, weather = tmp_path / "few.bsp", tmp_path / "SW-All.csv"
    kernel.write_bytes(b"DAF/SPK ".ljust(1024, b"\0"))
    rows = ["DATE,BSRN,ND,KP1,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,F10.7_OBS,F10.7_DATA_TYPE,F10.7_OBS_CENTER81"]
    rows += [f"2024-03-{day:02},1,1,20,{','.join('4' * 8)},4,150,OBS,150" for day in range(1, 12)]
    weather.write_text("\n".join(rows) + "\n")
    air = pz.earth.Thermosphere(DAY, LOW, weather, 60.0)
    asteroid, moon = Asteroid(4, DAY, kernel), pz.earth.Body("moon", DAY, str(kernel), "sun", "TDB")
    monkeypatch.chdir(tmp_path)
    near = pz.earth.Body("moon", DAY, "few.bsp", "sun", "TDB")
    monkeypatch.chdir("/")
    assert [read_back(f).checksum for f in (air, asteroid, moon)] == [f.checksum for f in (air, asteroid, moon)]
    monkeypatch.chdir(tmp_path)
    assert write_function(near)["kernel"] == str(kernel)
    kernel.unlink()
    with pytest.raises(ValueError, match=r"kernel of .*few\.bsp' cannot be written to a file: there is no such file"):
        write_function(moon)


@pytest.mark.parametrize("about", ["earth", "sun"])
def test_places_say_what_they_are_seen_from(about):
    site = pz.earth.Station.geodetic("A", 0.4, 0.3, 100.0)
    for station in (site, None):
        place = pz.earth.Place(station, DAY, about=about)
        assert _place_of(write_place(place), DAY).checksum == place.checksum
