"""What is written of a determination says what was measured, and no more."""

from dataclasses import replace

import numpy as np

import piazzi as pz
from piazzi.determination.products import scheduled
from piazzi.scenarios import load_scenario


def test_a_problem_is_simulated_where_its_stations_measured():
    """Two passes of one station and one of another: rows of the simulation are those of the tracking."""
    problem = load_scenario("b612-range").problem
    one = problem.stations[0]
    problem = replace(problem, stations=[one, replace(one, name="two"), replace(one, name="idle")])
    t = np.array([0.0, 1.0, 2.0, 7.0, 8.0, 9.0, 9.5])
    names = np.array([one.name] * 3 + ["two"] * 3 + [one.name])
    values = np.ones((7, 1))
    values[-1] = np.nan  # a row that is missing extends no pass
    found = scheduled(problem, pz.Tracking(t, values, names))
    assert [(s.schedule.start, s.schedule.until) for s in found.stations[:2]] == [(0.0, 2.0), (7.0, 9.0)]
    assert found.stations[2].schedule is None  # nothing is known of one that never measured
    simulated = pz.simulate(found, t, np.random.default_rng(1))
    rows = simulated.row_stations[np.isfinite(simulated.values).any(axis=1)]
    assert (rows == "two").sum() == 3 and (rows == one.name).sum() == 3


def test_a_station_that_measured_at_all_times_has_no_schedule():
    problem = load_scenario("b612-range").problem
    t = np.array([0.0, 1.0, 2.0])
    tracking = pz.Tracking(t, np.ones((3, 1)), np.array([problem.stations[0].name] * 3))
    assert [s.schedule for s in scheduled(problem, tracking).stations] == [s.schedule for s in problem.stations] == [None]
    assert scheduled(problem, pz.Tracking(t, np.ones((3, 1)))) is problem
