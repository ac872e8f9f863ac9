"""Gauss-Markov accelerations in files: the problem that `with_gauss_markov` makes, in the units of the file."""

import tomllib

import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.scenarios import show
from piazzi.scenarios.loader import read_scenario
from piazzi.scenarios.table import Faults

TEMPLATE = show().replace('units = "m, rad, s, kg"', 'units = "km, rad, min"')
SECTION = "[gauss_markov]\nsigma = 0.6\ntime_constant = 5.0\n"


def read(section):
    faults = Faults()
    return read_scenario(tomllib.loads(TEMPLATE + section), "mine", faults), list(faults)


@pytest.mark.parametrize("section", [SECTION, SECTION.replace("0.6", "{ v = 0.6 }"), SECTION + 'states = ["v"]'])
def test_a_file_says_what_python_says(section):
    plain, _ = read("")
    found, faults = read(section)
    assert not faults
    # 0.6 km/min per min is 600 m over 3600 s^2
    expected = pz.with_gauss_markov(plain.problem, 600 / 3600, 300.0)
    assert found.problem.model == expected.model
    assert found.problem.model.names == ("x", "v", "gm_v", "k")
    assert_allclose(found.problem.mean, expected.mean, rtol=1e-15)
    assert_allclose(found.problem.covariance, expected.covariance, rtol=1e-14)
    assert_allclose(found.problem.process_noise.covariance, expected.process_noise.covariance, rtol=1e-14)
    assert found.problem.parameters["tau"] == 300.0


def test_the_template_shows_it():
    text = show()
    lines = [line for line in text.splitlines() if line.startswith(("# [gauss_markov]", "# sigma = 0.01", "# time_constant"))]
    assert len(lines) == 3
    for line in lines:
        text = text.replace(line, line.removeprefix("# "))
    faults = Faults()
    assert "gm_v" in read_scenario(tomllib.loads(text), "mine", faults).problem.model.names
    assert not list(faults)


@pytest.mark.parametrize(
    ("section", "path", "says"),
    [
        ("[gauss_markov]\nsigma = 1", "gauss_markov.time_constant", "is missing"),
        ("[gauss_markov]\ntime_constant = 1", "gauss_markov.sigma", "is missing"),
        (SECTION.replace("0.6", "-1"), "gauss_markov.sigma", "must be positive"),
        (SECTION.replace("0.6", "[1, 2]"), "gauss_markov.sigma", "it needs 1 (v)"),
        (SECTION.replace("0.6", "[0]"), "gauss_markov", "must be positive"),
        (SECTION.replace("0.6", "true"), "gauss_markov.sigma", "must be a finite number"),
        (SECTION.replace("5.0", "0"), "gauss_markov.time_constant", "must be positive"),
        (SECTION + 'states = "velocty"', "gauss_markov.states", "did you mean 'velocity'"),
        (SECTION + 'states = ["k"]', "gauss_markov", "'k' is not a state"),
        (SECTION + "tau = 3", "gauss_markov.tau", "unknown key"),
    ],
)
def test_faults_have_their_place(section, path, says):
    scenario, faults = read(section)
    assert scenario is None
    assert any(f.path == path and says in f.message for f in faults), faults


def test_it_is_read_although_something_else_is_wrong():
    faults = Faults()
    read_scenario(tomllib.loads(TEMPLATE.replace('"camera"', '"camra"') + "[gauss_markov]\n"), "mine", faults)
    assert {"gauss_markov.sigma", "gauss_markov.time_constant"} <= {f.path for f in faults}
