"""Manoeuvres in files: in the units of the file, on a group or on states by name."""

import tomllib

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from piazzi.scenarios import show
from piazzi.scenarios.loader import read_scenario
from piazzi.scenarios.table import Faults


def read(text, units="km, min"):
    faults = Faults()
    tables = tomllib.loads(show("b612-range").replace("m, rad", units) + text)
    return read_scenario(tables, "mine", faults), faults


def test_a_manoeuvre_is_in_the_units_of_the_file():
    scenario, faults = read("[[manoeuvres]]\ntime = 2.0\ndelta_v = [0.0, 0.6]\nsigma = [0.06, 0.03]\n")
    assert not faults
    (manoeuvre,) = scenario.problem.manoeuvres
    assert manoeuvre.time == 120.0
    assert manoeuvre.states == ("vx", "vy")
    assert_allclose(manoeuvre.delta_v, [0, 10], rtol=1e-15)
    assert_allclose(manoeuvre.covariance, np.diag([1.0, 0.25]), rtol=1e-14)


def test_states_by_name_and_a_truth_without_the_manoeuvre():
    scenario, faults = read('[[manoeuvres]]\ntime = 2\nstates = ["vy"]\ndelta_v = { vy = 3 }\n', "m")
    assert not faults
    assert scenario.problem.manoeuvres[0].states == ("vy",)
    assert_array_equal(scenario.problem.manoeuvres[0].covariance, [[0.0]])
    assert scenario.problem.truth.manoeuvres is None
    plain = tomllib.loads(show("b612-range"))
    plain["manoeuvres"] = [{"time": 2.0, "delta_v": [1, 1]}]
    plain["truth"]["manoeuvres"] = []
    assert list(read_scenario(plain, "mine", Faults()).problem.truth.manoeuvres) == []


@pytest.mark.parametrize(
    ("text", "path", "says"),
    [
        ("delta_v = [1, 1]", "manoeuvres[0].time", "is missing"),
        ("time = 1", "manoeuvres[0].delta_v", "is missing"),
        ("time = 1\ndelta_v = [1]", "manoeuvres[0].delta_v", "it needs 2 (vx, vy)"),
        ("time = 1\ndelta_v = [1, 1]\nstates = 'velocty'", "manoeuvres[0].states", "did you mean 'velocity'"),
        ("time = 1\ndelta_v = [1, 1]\nstates = ['vx', 'vz']", "manoeuvres[0].states", "'vz', which is not a state"),
        ("time = 1\ndelta_v = [1, 1]\nsigma = [-1, 0]", "manoeuvres[0].sigma", "must not be negative"),
        ("time = 1\ndelta_v = [1, 1]\ndv = 3", "manoeuvres[0].dv", "unknown key"),
        ("time = 0\ndelta_v = [1, 1]", "manoeuvres", "is not after the prior"),
    ],
)
def test_faults_are_told(text, path, says):
    scenario, faults = read(f"[[manoeuvres]]\n{text}\n", "m")
    assert scenario is None
    assert [(f.path, says in f.message) for f in faults] == [(path, True)]
