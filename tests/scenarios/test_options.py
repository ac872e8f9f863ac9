"""The simulation options: what they change in a simulation, and that they change nothing else."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.scenarios import load_scenario, vary

FIXED, DRAWN = "b612-range", "satellite-bearing"


def simulated(problem, name, seed=3):
    return pz.simulate(problem, load_scenario(name).times[:20], np.random.default_rng(seed))


@pytest.mark.parametrize("name", [FIXED, DRAWN])
def test_noiseless_observations_are_those_of_the_truth(name):
    problem = vary(load_scenario(name).problem, noiseless=True)
    tracking = simulated(problem, name)
    station = problem.stations[0].name
    assert_array_equal(tracking.values, problem.measure(station, tracking.truth, tracking.times))
    assert_array_equal(tracking.truth, simulated(load_scenario(name).problem, name).truth)


@pytest.mark.parametrize("name", [FIXED, DRAWN, "template"])
def test_a_perfect_guess_is_the_first_true_state(name):
    problem = vary(load_scenario(name).problem, perfect_guess=True)
    assert_array_equal(simulated(problem, name).truth[0], problem.mean)
    assert_array_equal(problem.covariance, load_scenario(name).problem.covariance)


def test_a_fixed_truth_starts_at_one_place_and_a_drawn_one_does_not():
    satellite = load_scenario(DRAWN).problem
    fixed, drawn = vary(satellite, truth="fixed"), vary(load_scenario(FIXED).problem, truth="drawn")
    assert_array_equal([simulated(fixed, DRAWN, seed).truth[0] for seed in (1, 2)], [satellite.mean] * 2)
    assert_array_equal(simulated(vary(load_scenario(FIXED).problem, truth="fixed"), FIXED).truth[0], [11, 0, 0, 10])
    assert not np.array_equal(*(simulated(drawn, FIXED, seed).truth[0] for seed in (1, 2)))


def test_without_options_a_simulation_stays_as_it_is():
    problem = load_scenario(FIXED).problem
    assert_array_equal(simulated(vary(problem), FIXED).values, simulated(problem, FIXED).values)


def test_other_truths_are_refused():
    with pytest.raises(ValueError, match="'fixed' or 'drawn'"):
        vary(load_scenario(FIXED).problem, truth="floating")
