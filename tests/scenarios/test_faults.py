"""Faults: all of them at once, each with its place and, where a name is wrong, the nearest one."""

import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piazzi.expressions import time_limit
from piazzi.scenarios import ScenarioError, check, load_scenario, show
from piazzi.scenarios.loader import MAX_BYTES, read_scenario
from piazzi.scenarios.table import Faults

GOOD = """
[states]
x = "m"
v = "m/s"
[dynamics]
x = "v"
v = "-k*x"
[parameters]
k = { value = 2.0, unit = "1/s**2" }
[sensors.radar.components]
range = { equation = "x", unit = "m" }
[[stations]]
name = "a"
sensor = "radar"
noise = { sigma = 0.1 }
[[stations]]
name = "b"
noise = { variance = 0.01 }
[prior]
mean = [1.0, 0.0]
sigma = [1.0, 1.0]
[process_noise]
variance = { v = 0.1 }
[times]
step = 1.0
count = 10
"""


@pytest.fixture
def checked(tmp_path):
    def run(text):
        path = tmp_path / "mine.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return check(path)

    return run


def test_a_good_file_has_no_faults(checked):
    assert checked(GOOD) == []


@pytest.mark.parametrize(
    ("old", "new", "path", "says"),
    [
        ("[states]", "titel = 'x'\n[states]", "titel", "did you mean 'title'"),
        ("[states]", "units = 'km'\n[states]\ny = 3", "states.y", "must be text"),
        ('x = "m"', 'x = "meter"', "states.x", "unknown unit 'meter'"),
        ('v = "m/s"\n', 'v = "m/s"\n2x = "m"\n', "states.2x", "cannot be used as a name"),
        ('v = "m/s"\n', 'v = "m/s"\n_y = "m"\n', "states._y", "cannot be used as a name"),
        ('v = "-k*x"', 'v = "-kk*x"', "dynamics.v", "did you mean 'k'"),
        ('v = "-k*x"', 'v = "-k*x +"', "dynamics.v", "column"),
        ('v = "-k*x"', "v = \"__import__('os').system('true')\"", "dynamics.v", "column"),
        ('v = "-k*x"', "v = [1]", "dynamics.v", "must be an equation"),
        ('v = "-k*x"\n', "", "dynamics", "has no equation for state 'v'"),
        ('v = "-k*x"', 'v = "-k*x"\nw = "1"', "dynamics.w", "unknown key"),
        ("[dynamics]", '[step]\nx = "v"\n[dynamics]', "dynamics", "not both"),
        ("value = 2.0,", "valeu = 2.0,", "parameters.k.valeu", "did you mean 'value'"),
        ("value = 2.0,", "", "parameters.k.value", "is missing"),
        ("value = 2.0,", "value = 2.0, role = 'estimated',", "parameters.k", "needs one of sigma, variance"),
        ("value = 2.0,", "value = 2.0, role = 'guessed',", "parameters.k.role", "known: fixed, estimated, considered"),
        ("value = 2.0,", "value = 2.0, sigma = 1.0,", "parameters.k.sigma", "this one is fixed"),
        ("value = 2.0,", "value = inf,", "parameters.k.value", "must be a finite number, not inf"),
        ('k = { value = 2.0, unit = "1/s**2" }', "x = 1.0\nk = 2.0", "parameters.x", "is also a state"),
        ('range = { equation = "x", unit = "m" }', 'range = "atan2(x, v)"', "sensors.radar.components.range", "wraps"),
        ('range = { equation = "x", unit = "m" }', 'range = "mx"', "sensors.radar.components.range", "each station's own"),
        (
            "[sensors.radar.components]",
            "[sensors.radar]\nnumbers = ['mx']\n[sensors.radar.components]",
            "sensors.radar.numbers",
            "'mx'",
        ),
        ('sensor = "radar"', 'sensor = "radr"', "stations[0].sensor", "did you mean 'radar'"),
        ('sensor = "radar"', "nubmers = {}", "stations[0].nubmers", "did you mean 'numbers'"),
        ("noise = { variance = 0.01 }", "noise = 0.01", "stations[1].noise", "must be a table, such as { sigma = 1.0 }"),
        (
            "noise = { variance = 0.01 }",
            "noise = { variance = 0.0 }",
            "stations[1].noise.variance",
            "must be positive definite",
        ),
        ("noise = { variance = 0.01 }", "noise = { sigma = -1 }", "stations[1].noise.sigma", "must not be negative"),
        ("noise = { variance = 0.01 }", "noise = { variance = 1, sigma = 1 }", "stations[1].noise", "has sigma and variance"),
        (
            "noise = { variance = 0.01 }",
            "noise = { sigma = { rnge = 1 } }",
            "stations[1].noise.sigma.rnge",
            "did you mean 'range'",
        ),
        ("noise = { variance = 0.01 }", "", "stations[1].noise", "must be a table"),
        ('name = "b"', 'name = "a"', "stations[1].name", "is also the name of another station"),
        ('name = "b"', "", "stations[1].name", "is missing"),
        ("mean = [1.0, 0.0]", "mean = [1.0]", "prior.mean", "has 1 value; it needs 2 (x, v)"),
        ("mean = [1.0, 0.0]", "mean = { x = 1.0 }", "prior.mean", "has no value for 'v'"),
        ("mean = [1.0, 0.0]", "mean = [1.0, true]", "prior.mean[1]", "must be a finite number, not True"),
        ("mean = [1.0, 0.0]", 'mean = "truth"', "prior.mean", "truth.state must give numbers"),
        ("sigma = [1.0, 1.0]", "covariance = [[1.0, 0.5], [0.4, 1.0]]", "prior.covariance", "is not symmetric"),
        ("sigma = [1.0, 1.0]", "covariance = [[1.0, 2.0], [2.0, 1.0]]", "prior.covariance", "must be positive semidefinite"),
        ("sigma = [1.0, 1.0]", "covariance = [[1.0, nan], [2.0, 1.0]]", "prior.covariance[0][1]", "must be a finite number"),
        ("sigma = [1.0, 1.0]", "covariance = [[1.0], [2.0, 1.0]]", "prior.covariance", "must be 2 lists of 2 numbers"),
        ("sigma = [1.0, 1.0]", "", "prior", "needs one of sigma, variance, covariance"),
        ("variance = { v = 0.1 }", "variance = { v = 0.1 }\nper = 'hour'", "process_noise.per", "known: second, step"),
        ("[times]", "[integrator]\nmethod = 'rk44'\n[times]", "integrator.method", "did you mean 'rk4'"),
        ("[times]", "[integrator]\nmethod = 'rk4'\nsubsteps = 0\n[times]", "integrator", "substeps is 0"),
        ("[times]", "[integrator]\nmethod = 'rk4'\nsteps = 3\n[times]", "integrator.steps", "did you mean 'substeps'"),
        ("[times]", "[integrator]\nmethod = 'discrete'\n[times]", "", "does not fit"),
        ("count = 10", "count = 100\n[integrator]\nmethod = 'rk4'\nsubsteps = 1000000000", "integrator", "steps in all"),
        ("step = 1.0", "step = 0", "times.step", "must be positive"),
        ("count = 10", "", "times", "needs a step and either count or stop"),
        ("count = 10", "stop = -1.0", "times.stop", "before the start"),
        ("count = 10", "count = 1000000000", "times", "at most"),
        ("step = 1.0\ncount = 10", "list = [0.0, 2.0, 1.0]", "times", "must increase"),
        ("step = 1.0\ncount = 10", "list = [-1e308, 1e308]", "times", "time 1 is at 1e+308 s, too far after -1e+308 s"),
        ("step = 1.0\ncount = 10", "start = 1e308\nstep = 1e308\ncount = 3", "times", "time 1 is inf s; it must be finite"),
        ("step = 1.0\ncount = 10", "list = []", "times.list", "is empty"),
        ("[times]", "[truth]\nstate = 'drown'\n[times]", "truth.state", "did you mean 'drawn'"),
        ("[times]", "[truth]\nparameters = { kk = 1 }\n[times]", "truth.parameters.kk", "did you mean 'k'"),
        ("[times]", "[truth]\nmeasurement_noise = 1\n[times]", "truth.measurement_noise", "must be true or false"),
        ("[times]", "[truth]\nprocess_noise = { sigma = [1.0] }\n[times]", "truth.process_noise.sigma", "it needs 2"),
        ("[times]", "[groups]\nposition = ['y']\n[times]", "groups.position", "is not a state"),
        ("[times]", "[picture]\nplanet_radius = -1\n[times]", "picture.planet_radius", "must be positive"),
        ("mean = [1.0, 0.0]", "mean = [1.0, 0.0]\ntime = 5.0", "prior.time", "after the first measurement"),
        ("mean = [1.0, 0.0]", "mean = [1.0, 0.0]\ntime = 'frist'", "prior.time", "did you mean 'first'"),
    ],
)
def test_a_fault_is_told_with_its_place(checked, old, new, path, says):
    assert old in GOOD
    faults = checked(GOOD.replace(old, new, 1))
    assert any(f.path == path and says in f.message for f in faults), faults
    assert all(len(str(f).splitlines()) == 1 for f in faults)


def test_all_faults_are_told_at_once(checked):
    text = GOOD
    for old, new in {
        '"m/s"': '"m/sec"',
        '"-k*x"': '"-q*x"',
        "value = 2.0": "value = 'two'",
        "sigma = 0.1": "sigma = -0.1",
        "[1.0, 0.0]": "[1.0]",
        "v = 0.1": "w = 0.1",
        "step = 1.0": "step = -1.0",
    }.items():
        text = text.replace(old, new, 1)
    assert {f.path for f in checked(text)} >= {
        "states.v",
        "dynamics.v",
        "parameters.k.value",
        "stations[0].noise.sigma",
        "prior.mean",
        "process_noise.variance.w",
        "times.step",
    }


def test_one_fault_does_not_make_others(checked):
    """A wrong number is one fault: nothing that depends on it is reported as well."""
    assert len(checked(GOOD.replace("mean = [1.0, 0.0]", "mean = [1.0, nan]"))) == 1
    assert len(checked(GOOD.replace('"-k*x"', '"-k*"'))) == 1


def test_a_file_in_other_units_says_the_unit_of_everything(checked):
    text = 'units = "km"\n' + GOOD.replace('{ value = 2.0, unit = "1/s**2" }', "2.0").replace(
        '{ equation = "x", unit = "m" }', '"x"'
    )
    assert {f.path for f in checked(text)} == {"parameters.k", "sensors.radar.components.range"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = ", "line 1, column 5: is not TOML"),
        ("[states]\nx = 1\nx = 2", "line 3"),
        (b"# caf\xe9\n", "line 1: is not UTF-8 text: byte 0xe9"),
        (b"a = 1\n\0", "is not TOML"),
        ("", "states: is missing"),
        ("x = " + "[" * 5000, "nested too deep"),
        ("x = " + "9" * 5000, "is not TOML"),
        ("#" * (MAX_BYTES + 1), "is longer than"),
        ("\n" + "a." * 40 + "b = 1", "line 2: has a dotted key of more than 30 parts"),
        ('"\\u001b[31m" = 1', "\\x1b[31m"),
    ],
)
def test_what_is_no_scenario_is_told_on_one_line(checked, text, says):
    faults = checked(text)
    assert says in " | ".join(map(str, faults))
    assert all(str(f).isprintable() for f in faults)


def test_loading_a_faulty_file_tells_the_first_and_keeps_all(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace("0.0]", "nan]").replace("step = 1.0", "step = 0"))
    with pytest.raises(ScenarioError, match=r"mine.toml: prior.mean\[1\]: .*\(and 1 more") as error:
        load_scenario(path)
    assert len(error.value.faults) == 2


def test_unknown_names_and_missing_files(tmp_path):
    with pytest.raises(ValueError, match="did you mean 'b612-range'"):
        load_scenario("b612-rang")
    with pytest.raises(ValueError, match="did you mean 'satellite-bearing'"):
        show("satelite-bearing")
    with pytest.raises(FileNotFoundError):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(OSError, match="directory"):
        check(tmp_path)


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.just([]),
    st.just({}),
    st.lists(st.floats(), max_size=4),
    st.lists(st.lists(st.integers(-2, 2), min_size=2, max_size=2), min_size=2, max_size=2),
    st.dictionaries(st.text(max_size=3), st.integers()),
    st.sampled_from(
        ["x", "v", "k", "length", "1/time", "drawn", "truth", "mean", "estimated", "atan2(x, v)", "-k*x", "sigma", "rk4"]
    ),
)


def places(node, path=()):
    """Every place in nested tables and lists."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


@settings(max_examples=100)
@given(st.data())
def test_no_change_to_a_file_brings_down_its_reader(data):
    tables = tomllib.loads(data.draw(st.sampled_from([GOOD, show("template"), show("b612-range")])))
    for _ in range(data.draw(st.integers(1, 4))):
        *path, last = data.draw(st.sampled_from(list(places(tables))))
        node = tables
        for key in path:
            node = node[key]
        match data.draw(st.sampled_from(["replace", "remove", "rename"])), node:
            case "remove", _:
                del node[last]
            case "rename", dict():
                node[data.draw(st.text(max_size=5))] = node.pop(last)
            case _:
                node[last] = data.draw(JUNK)
        if not tables:
            break
    faults = Faults()
    scenario = read_scenario(tables, "changed", faults)
    assert (scenario is None) == bool(faults)
    assert all(str(f).isprintable() for f in faults)


def test_equations_that_keep_sympy_busy_are_found(tmp_path, monkeypatch):
    """They are right as text; `check` said that nothing was wrong, and the first estimate never came."""
    slow = "1"
    for _ in range(26):
        slow = f"({slow}+pi)**(1/3)"
    text, path = show("b612-range"), tmp_path / "slow.toml"
    assert "sqrt((x - mx)**2" in text
    path.write_text(text.replace("sqrt((x - mx)**2", f"{slow} + sqrt((x - mx)**2"))
    monkeypatch.setattr(time_limit, "SECONDS", 0.3)
    (fault,) = check(path)
    assert fault.path == "sensors.range"
    assert "SymPy needs more than 0.3 s for this" in fault.message
