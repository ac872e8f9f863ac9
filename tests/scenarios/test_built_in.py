"""The founding problems, number by number, and the files that state them."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from piazzi import kernels
from piazzi.scenarios import check, load_scenario, names, show

FOUNDING = ["b612-range", "b612-range-q0", "satellite-bearing"]
STUDIES = ["founding-study", "founding-study-mismatched"]
ORBITS = ["geo-optical", "gps-position", "gto-radar", "lageos2-laser", "leo-radar", "sun-sync-day"]


def test_these_problems_are_built_in():
    assert names() == sorted(FOUNDING + STUDIES + ORBITS)


@pytest.mark.parametrize("name", [*FOUNDING, *STUDIES, *ORBITS, "template"])
def test_every_shipped_file_passes_its_own_check(name):
    assert check(name) == []
    assert show(name).startswith("#")


def test_satellite_bearing_has_the_numbers_of_the_founding_text():
    scenario = load_scenario("satellite-bearing")
    problem = scenario.problem
    assert problem.model.states == ("x", "y", "vx", "vy")
    assert dict(problem.parameters) == {"mu": 3.986e14}
    assert_array_equal(problem.prior.mean, [0.0, 2e7, 4500.0, 0.0])
    assert_array_equal(problem.prior.covariance, np.diag([1e6, 3e6, 800.0, 800.0]) ** 2)
    assert_array_equal(problem.process_noise.covariance, np.diag([0.01, 0.01, 0.0025, 0.0025]))
    assert (problem.process_noise.per, problem.process_noise.method) == ("second", "scaled")
    assert problem.stations[0].noise[0, 0] == (0.2 * np.pi / 180) ** 2
    assert problem.integrator == kernels.Taylor(15)
    assert_array_equal(scenario.times, np.arange(1441) * 15.0)
    assert problem.truth.state is None
    assert problem.truth.process_noise is None
    assert scenario.picture.planet_radius == 6.371e6
    sensor = problem.model.sensor("bearing")
    assert sensor.equations == ("atan2(y, x)",)
    assert sensor.angles == ("bearing",)


@pytest.mark.parametrize(("name", "noise"), [("b612-range", [0, 0, 0.01, 0.01]), ("b612-range-q0", [0, 0, 0, 0])])
def test_b612_has_the_numbers_of_the_notebook(name, noise):
    scenario = load_scenario(name)
    problem = scenario.problem
    assert dict(problem.parameters) == {"mu": 1000.0}
    assert problem.stations[0].numbers == {"mx": 10.0, "my": 0.0}
    assert problem.stations[0].noise[0, 0] == 0.1**2
    assert_array_equal(problem.prior.mean, [12.0, 0.0, 0.0, 9.0])
    assert_array_equal(problem.prior.covariance, np.eye(4))
    assert_array_equal(problem.process_noise.covariance, np.diag(noise))
    assert problem.process_noise.per == "step"
    assert problem.integrator == kernels.RungeKutta4(10)
    assert_array_equal(problem.truth.state, [11.0, 0.0, 0.0, 10.0])
    assert not np.any(problem.truth.process_noise.covariance)
    assert_array_equal(scenario.times, np.arange(100) * 0.1)
    assert scenario.picture.planet_radius == 10.0


def test_groups_and_units_are_those_of_the_states():
    model = load_scenario("satellite-bearing").problem.model
    assert model.group_indices == {"position": (0, 1), "velocity": (2, 3)}
    assert [model.unit(s) for s in (*model.states, "mu")] == ["m", "m", "m/s", "m/s", "m^3/s^2"]


def test_equal_models_are_one_object(tmp_path):
    """What is derived from a model, and compiled for it, is found again by identity."""
    mine = tmp_path / "mine.toml"
    mine.write_text(show("b612-range"))
    assert load_scenario("b612-range") is load_scenario("b612-range")
    assert load_scenario(mine).problem.model is load_scenario("b612-range").problem.model


def test_loading_imports_nothing_heavy():
    code = (
        "import sys; from piazzi.scenarios import load_scenario, names; [load_scenario(n) for n in names()];"
        "heavy = ('sympy', 'numba', 'llvmlite', 'pandas', 'xarray', 'h5py', 'matplotlib');"
        "print([m for m in heavy if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.strip() == "[]"


@pytest.mark.parametrize("name", STUDIES)
def test_founding_studies_are_of_satellite_bearing(name):
    study, single = load_scenario(name), load_scenario("satellite-bearing")
    assert study.problem.model == single.problem.model
    assert_array_equal(study.times, single.times)
    for what in ("mean", "covariance", "station_noise"):
        assert_array_equal(getattr(study.problem, what), getattr(single.problem, what))
    assert {"ekf", "iekf", "ukf", "window:10", "window:50", "window:100", "window:200", "smoother", "graph"} == {
        *study.study.estimators
    }
