"""What an event may be, what is told of it, and how a scenario has it."""

import pytest

import piazzi as pz
from piazzi.cli.main import main
from piazzi.present.equations import equations
from piazzi.scenarios.loader import load_scenario
from piazzi.scenarios.table import ScenarioError
from piazzi.scenarios.write import problem_from_tables, problem_to_tables

DEFINITIONS = {"edge": "x - limit", "far": "2*edge"}


def model(events, definitions=DEFINITIONS, **changes):
    settings = {
        "dynamics": {"x": "v", "v": "-sign(edge)"},
        "sensors": pz.Sensor("ruler", {"seen": "gap"}, definitions={"gap": "x - 3"}),
        "parameters": ["limit"],
    }
    return pz.Model(states=["x", "v"], definitions=definitions, events=events, **settings | changes)


def test_events_are_named_or_have_the_names_of_their_definitions():
    assert model({"wall": "edge", "post": "far"}).events == (("wall", "edge"), ("post", "far"))
    assert model(["edge", "far"]).events == (("edge", "edge"), ("far", "far"))
    assert hash(model(["edge", "far"])) != hash(model(["far", "edge"]))


def test_a_definition_that_only_an_event_needs_is_used():
    assert model(["far"]).definitions
    with pytest.raises(ValueError, match="definition 'far' is used by no equation"):
        model(["edge"])


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ({"wall": "egde"}, "event 'wall' names 'egde', which is no definition; did you mean 'edge'"),
        ({"wall": "x"}, "event 'wall' names 'x', which is no definition"),
        ({"wall": "gap"}, "event 'wall' names 'gap', which sensor 'ruler' defines; it must be a definition of the model"),
        ({"wall": "edge", "door": "edge"}, "events 'wall' and 'door' both name 'edge'"),
        ({"wall": 3.0}, "event 'wall' is 3.0; it must be the name of a definition"),
        ({"a wall": "edge"}, "event 'a wall' cannot be used as a name"),
    ],
)
def test_faults(events, message):
    with pytest.raises(ValueError, match=message):
        model(events, DEFINITIONS | {"far": "2*x"})


def test_an_event_has_to_depend_on_the_orbit():
    with pytest.raises(ValueError, match="event 'far': 'far' is constant: it depends on no state and no time"):
        model(["far"], {"edge": "x", "far": "2*limit"})
    with pytest.raises(ValueError, match="event 'far': a model that is a step has no orbit between its epochs"):
        model(["far"], discrete=True)


def test_show_has_events_and_the_equations_as_written(capsys):
    model({"wall": "edge", "post": "far"}).show()
    shown = capsys.readouterr().out
    assert "events g: wall, post" in shown
    assert "dg/d(x, t)" in shown
    assert "side" not in shown


SCENARIO = """title = "A cart between two walls"
[states]
x = "m"
v = "m/s"
[definitions]
edge = "abs(x) - 1"
[events]
wall = "edge"
[dynamics]
x = "v"
v = "-4*x*(1 + sign(edge))/2"
[sensors.ruler.components]
seen = "x"
[[stations]]
name = "a"
sensor = "ruler"
noise = { sigma = 0.001 }
[prior]
mean = [0, 1]
sigma = [0.1, 0.1]
[process_noise]
variance = [0, 1e-8]
per = "second"
[integrator]
method = "rk4"
[times]
step = 0.1
count = 20
"""


def test_a_scenario_names_events_and_keeps_them(tmp_path):
    path = tmp_path / "walls.toml"
    path.write_text(SCENARIO)
    problem = load_scenario(path).problem
    assert problem.model.events == (("wall", "edge"),)
    again = problem_from_tables(problem_to_tables(problem), "walls", "a test")
    assert again.model == problem.model
    assert "# steps end where\nedge = 0    # wall" in equations(problem)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('wall = "egde"', "event 'wall' names 'egde', which is no definition"),
        ("wall = 3", "events.wall"),
    ],
)
def test_a_scenario_with_a_wrong_event_is_refused_with_its_place(tmp_path, wrong, message):
    path = tmp_path / "walls.toml"
    path.write_text(SCENARIO.replace('wall = "edge"', wrong))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    assert message in str(caught.value)


def test_the_program_ends_with_2(tmp_path, capsys):
    path = tmp_path / "walls.toml"
    path.write_text(SCENARIO.replace('wall = "edge"', 'wall = "egde"'))
    assert main(["scenarios", "check", str(path)]) == 2
    assert "event 'wall' names 'egde'" in "".join(capsys.readouterr())


EARTH = """title = "Sunlight in low orbit"
epoch = "2016-02-13T16:00:00 UTC"
[earth]
degree = 4
radiation = "cannonball"
shadow_edges = true
[parameters]
cr_a_m = 0.02
[sensors.place.components]
px = "x"
[[stations]]
name = "a"
sensor = "place"
noise = { sigma = 1.0 }
[prior]
mean = [7e6, 0, 0, 0, 5e3, 5e3]
sigma = [1, 1, 1, 1, 1, 1]
[process_noise]
variance = [0, 0, 0, 0, 0, 0]
per = "second"
[integrator]
method = "rk8"
[times]
step = 60
count = 10
"""


def test_the_section_earth_brings_events(tmp_path):
    path = tmp_path / "leo.toml"
    path.write_text(EARTH)
    assert load_scenario(path).problem.model.events == (("sunlit", "sunlit"), ("half_lit", "half_lit"))
    path.write_text(EARTH + '[events]\nhalf_way = "shadow"\n')
    assert ("half_way", "shadow") in load_scenario(path).problem.model.events
