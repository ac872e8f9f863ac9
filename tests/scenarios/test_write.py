"""A problem as tables, and back: nothing changes, not a bit."""

import json

import pytest
from hypothesis import given

import piazzi as pz
from piazzi.scenarios import load_scenario, names
from piazzi.scenarios.write import problem_from_tables, problem_to_tables
from tests.references.drawn import problems, same_problem


@given(problems())
def test_tables_give_the_problem_back(problem):
    tables = json.loads(json.dumps(problem_to_tables(problem), allow_nan=False))
    assert same_problem(problem_from_tables(tables, problem.name, "here"), problem)


@pytest.mark.parametrize("name", [*names(), "template"])
def test_tables_give_the_built_in_problems_back(name):
    problem = load_scenario(name).problem
    again = problem_from_tables(problem_to_tables(problem), name, "here")
    assert same_problem(again, problem)
    assert problem_from_tables(problem_to_tables(again), name, "here").model is again.model


def test_an_integrator_without_a_name_is_refused():
    class Own(pz.RungeKutta4):
        pass

    problem = load_scenario("b612-range").problem
    own = pz.Problem(problem.model, problem.prior, None, problem.stations, problem.parameters, Own())
    with pytest.raises(ValueError, match="integrator Own cannot be written"):
        problem_to_tables(own)


def test_a_bias_that_a_sensor_names_among_its_numbers_is_a_parameter():
    """Instruments say units of all that they use; what is estimated among it is no number of a station."""
    sensor = pz.Sensor("s", {"z": "x + bias + gain"}, (), {}, {"bias": "m", "gain": "m"})
    model = pz.Model(["x"], ["0"], [sensor], [pz.Parameter("bias", "estimated", "m")])
    station = pz.Station("a", "s", 1.0, {"gain": 0.25})
    problem = pz.Problem(model, pz.Gaussian([0.0], [1.0]), None, station, {"bias": pz.Gaussian(0.5, 1.0)})
    found = problem_from_tables(json.loads(json.dumps(problem_to_tables(problem))), "", "here")
    assert found.model.names == ("x", "bias") and found.measure("a", [1.0, 0.5], 0.0) == [1.75]
