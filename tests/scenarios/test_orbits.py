"""The orbits about the Earth that are built in: every estimator follows them."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.scenarios import load_scenario


@pytest.mark.slow  # several kernels
@pytest.mark.parametrize("name", ["gps-position", "sun-sync-day"])
def test_estimators_succeed(name):
    scenario = load_scenario(name)
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(1))
    found = pz.compare(scenario.problem, tracking, ["ekf", "graph", "batch"])
    assert found.success
    position = [0, 1, 2]
    for estimate in found.estimates.values():
        error = np.linalg.norm((estimate.mean - tracking.truth)[-20:, position], axis=1)
        assert np.sqrt(np.mean(error**2)) < 3.0 * np.sqrt(scenario.problem.stations[0].noise[0, 0])


@pytest.mark.parametrize("name", ["gps-position", "sun-sync-day"])
def test_studies_vary_what_is_true(name):
    """What estimators believe stays, and so does the model: nothing is compiled for another degree."""
    study = pz.Study.of(name, runs=1)
    beliefs = [study.problems(i)[1].functions["field"].degree for i in range(2)]
    assert beliefs[0] == beliefs[1] == study.problem.functions["field"].degree
    worlds = [study.problems(i)[0] for i in range(2)]
    assert worlds[1].functions["field"].degree > worlds[0].functions["field"].degree
    assert worlds[0].model == worlds[1].model == study.problem.model
