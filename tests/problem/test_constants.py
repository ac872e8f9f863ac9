"""Numbers of stations that are not known for certain."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.io.netcdf import read_netcdf, write_netcdf
from piazzi.scenarios import load_scenario
from tests.laws.problems import b612, b612_model
from tests.references.drawn import same_problem

UNCERTAIN = {"mx": pz.Gaussian(10.0, 0.04), "my": 0.0}


def test_an_uncertain_number_becomes_a_parameter_of_the_stations_own_sensor():
    stations = [pz.Station("DSS 14", "range", 0.01, UNCERTAIN), pz.Station("east", "range", 0.01, {"mx": 0.0, "my": -10.0})]
    problem = b612(stations=stations)
    assert problem.model.names == ("x", "y", "vx", "vy", "mx_DSS_14")
    assert [s.name for s in problem.stations] == ["DSS 14", "east"]
    assert [s.sensor for s in problem.stations] == ["range-DSS_14", "range"]
    assert problem.mean[-1] == 10.0
    assert problem.covariance[-1, -1] == 0.04
    state = np.array([11.0, 3.0, 0.0, 9.0, 10.5])
    assert problem.measure("DSS 14", state) == pytest.approx(np.hypot(0.5, 3.0))
    assert problem.measurement_jacobian("DSS 14", state)[0, 4] == pytest.approx(-0.5 / np.hypot(0.5, 3.0))
    assert problem.measurement_jacobian("east", state)[0, 4] == 0.0


def test_names_that_are_taken_get_a_number():
    model = pz.Model(["x"], ["0"], [pz.Sensor("s", ["x + b + b_a"])], ["b_a"])
    station = pz.Station("a", "s", 1.0, {"b": pz.Gaussian(0.0, 1.0)})
    problem = pz.Problem(model, pz.Gaussian(0.0, 1.0), None, [station], {"b_a": 2.0})
    assert problem.model.names == ("x", "b_a_2")
    assert problem.measure("a", [1.0, 5.0]) == 8.0


def test_considered_numbers_stay_out_of_the_state():
    problem = b612(stations=[pz.Station("radar", "range", 0.01, UNCERTAIN, considered=["mx"])])
    assert problem.model.names == ("x", "y", "vx", "vy")
    assert problem.model.given == ("mu", "mx_radar")
    with pytest.raises(ValueError, match=r"considers 'my', which must be a number given as Gaussian"):
        b612(stations=[pz.Station("radar", "range", 0.01, UNCERTAIN, considered=["my"])])


@pytest.mark.parametrize("name", ["mxx", "x", "mu"])
def test_numbers_that_the_sensor_does_not_use_are_refused(name):
    with pytest.raises(ValueError, match=rf"station 'radar' gives '{name}', which sensor 'range' does not use"):
        b612(stations=[pz.Station("radar", "range", 0.01, {"mx": 10.0, "my": 0.0, name: pz.Gaussian(0.0, 1.0)})])


def test_considered_is_a_list():
    with pytest.raises(ValueError, match="considered is 'mx'; it must be a list"):
        b612(stations=[pz.Station("radar", "range", 0.01, UNCERTAIN, considered="mx")])


def test_units_of_numbers_are_those_of_the_constants():
    sensor = pz.Sensor("range", ["sqrt((x - mx)**2 + y**2)"], number_units={"mx": "m"})
    model = pz.Model(["x", "y"], ["0", "0"], [sensor])
    problem = pz.Problem(
        model, pz.Gaussian([1.0, 1.0], np.eye(2)), None, [pz.Station("a", "range", 1.0, {"mx": pz.Gaussian(0, 1)})]
    )
    assert problem.model.unit("mx_a") == "m"
    with pytest.raises(ValueError, match="number_units names 'my', which no equation uses"):
        pz.Sensor("range", ["x - mx"], number_units={"my": "m"})


def test_a_file_keeps_them(tmp_path):
    problem = b612(stations=[pz.Station("radar", "range", 0.01, UNCERTAIN)])
    tracking = pz.Tracking([0.0, 1.0], [1.0, 2.0])
    write_netcdf(tmp_path / "a.nc", problem, tracking)
    again, _ = read_netcdf(tmp_path / "a.nc")
    assert same_problem(again, problem)
    assert again.model.names == problem.model.names


SCENARIO = """
units = "km, deg"
states = {{ x = "km", v = "km/s" }}
dynamics = {{ x = "v", v = "0" }}
sensors.range.numbers = {{ place = "km" }}
sensors.range.components.range = {{ equation = "x - place", unit = "km" }}
prior = {{ mean = [1.0, 0.0], sigma = [1.0, 1.0] }}
times = {{ step = 1.0, count = 5 }}
truth = {{ parameters = {{ {truth} }} }}
[[stations]]
name = "a"
sensor = "range"
noise = {{ sigma = 0.1 }}
numbers = {{ place = {place} }}
"""


def test_scenario_in_other_units(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO.format(place="{ value = 2.0, sigma = 0.5 }", truth="place_a = 2.25"))
    problem = load_scenario(path).problem
    assert problem.model.names == ("x", "v", "place_a")
    assert problem.mean[-1] == 2000.0
    assert problem.covariance[-1, -1] == 250000.0
    assert problem.model.unit("place_a") == "km" or problem.model.unit("place_a") == "m"
    assert problem.truth.parameters == {"place_a": 2250.0}


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("{ sigma = 0.5 }", "stations[0].numbers.place.value: is missing"),
        ("{ value = 2.0 }", "stations[0].numbers.place: needs one of sigma, variance"),
        ("{ value = 2.0, sigma = 0.5, role = 'guessed' }", "stations[0].numbers.place.role"),
        ("{ value = 2.0, sigma = -0.5 }", "stations[0].numbers.place.sigma"),
        ("{ value = 2.0, sgima = 0.5 }", "did you mean 'sigma'"),
    ],
)
def test_faults_are_told_with_their_place(tmp_path, place, told):
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO.format(place=place, truth=""))
    with pytest.raises(ValueError, match=r".") as error:
        load_scenario(path)
    assert told in "\n".join(map(str, getattr(error.value, "faults", [error.value])))


def test_the_model_that_was_given_is_left_alone():
    before = b612_model()
    b612(stations=[pz.Station("radar", "range", 0.01, UNCERTAIN)])
    assert b612_model() is before
    assert before.names == ("x", "y", "vx", "vy")
