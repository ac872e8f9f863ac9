"""Tables show what was estimated, in units that suit it."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.present.tables import state_table, summary, truth_table
from piazzi.scenarios import load_scenario


@pytest.fixture(scope="module")
def estimate():
    scenario = load_scenario("b612-range")
    tracking = pz.simulate(scenario.problem, scenario.times, np.random.default_rng(0))
    return pz.ExtendedKalmanFilter().estimate(scenario.problem, tracking)


def rendered(part) -> str:
    from rich.console import Console

    console = Console(width=100, color_system=None)
    with console.capture() as captured:
        console.print(part)
    return captured.get()


def test_states_come_with_sigma_error_and_unit(estimate):
    lines = rendered(state_table("ekf", estimate)).splitlines()
    assert lines[0].startswith("State at t = 9.9 s, ekf")
    for i, line in enumerate(lines[3:]):
        name, value, sigma, error, unit = line.split()
        assert name == estimate.names[i]
        assert float(value) == pytest.approx(estimate.mean[-1, i], abs=0.01)
        assert float(sigma) == pytest.approx(np.sqrt(estimate.covariance[-1, i, i]), rel=0.06)
        assert float(error) == pytest.approx(estimate.mean[-1, i] - estimate.tracking.truth[-1, i], abs=0.01)
        assert unit == estimate.problem.model.unit(name)


def test_without_truth_there_is_no_column_of_errors(estimate):
    from dataclasses import replace

    assert "error" not in rendered(state_table("ekf", replace(estimate, tracking=replace(estimate.tracking, truth=None))))


def test_a_summary_counts(estimate):
    text = summary(estimate.problem, estimate.tracking, "here")
    assert text == "here: 100 epochs over 9.90 s, 100 measurements by radar, truth known, prior at 0 s"
    sparse = pz.Tracking([0.0, 1.0, 2.0], [1.0, np.nan, 3.0])
    assert (
        summary(estimate.problem, sparse, "x")
        == "x: 3 epochs over 2.00 s, 2 measurements by radar, 1 missing, truth not known, prior at 0 s"
    )
    assert summary(estimate.problem, pz.Tracking([0.0], [1.0]), "x").startswith("x: 1 epoch, 1 measurement by")


def test_the_truth_is_shown_at_both_ends(estimate):
    text = rendered(truth_table(estimate.problem, estimate.tracking))
    assert "t = 0 s" in text
    assert "t = 9.9 s" in text
    assert "11.0000" in text


def test_control_characters_in_names_do_not_reach_the_terminal(estimate):
    from dataclasses import replace

    stations = [replace(estimate.problem.stations[0], name="ra\x1b[31mdar")]
    assert "\x1b" not in summary(replace(estimate.problem, stations=stations), estimate.tracking, "a\x07b")
