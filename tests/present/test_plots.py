"""`plot` of results: on axes of one's own or on new ones, and what it refuses; short words for each result."""

import numpy as np
import pytest
import xarray

import piazzi as pz

pytestmark = pytest.mark.usefixtures("closed")


@pytest.fixture
def closed():
    from matplotlib import pyplot

    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    problem, tracking = pz.load("satellite-bearing")
    tracking = pz.simulate(problem, tracking.times[:40], np.random.default_rng(0))
    study = pz.Study(problem, tracking.times, ["ekf", "smoother"], runs=4)
    return {
        "tracking": tracking,
        "problem": problem,
        "estimate": pz.ExtendedKalmanFilter().estimate(problem, tracking),
        "comparison": pz.compare(problem, tracking, ["ekf", "graph"]),
        "trade": pz.windows(problem, tracking, [1, 5]),
        "observability": pz.observability(problem, tracking, twins=False),
        "study": study.run(tmp_path_factory.mktemp("study") / "s.nc", workers=0),
    }


DRAWN = ("tracking", "estimate", "comparison", "trade", "observability", "study")


@pytest.mark.parametrize("name", DRAWN)
def test_every_result_draws_itself(results, name):
    from matplotlib import pyplot

    own = pyplot.subplots()[1]
    assert results[name].plot(own) is own
    assert own.lines or own.collections
    new = results[name].plot()
    assert new is not own and new.get_ylabel()


def test_what_is_drawn_can_be_chosen(results):
    ax = results["tracking"].plot(problem=results["problem"])
    assert ax.get_ylabel() == "bearing [deg]"
    assert "vx" in results["estimate"].plot(state="vx").get_ylabel()
    assert "velocity" in results["comparison"].plot(group="velocity").get_ylabel()
    assert "velocity" in results["study"].plot(group="velocity").get_ylabel()


def test_without_truth_the_state_itself_is_drawn(results):
    from dataclasses import replace

    blind = replace(results["tracking"], truth=None)
    found = pz.ExtendedKalmanFilter().estimate(results["problem"], blind)
    ax = found.plot(state="x")
    (line,) = ax.lines
    assert ax.get_ylabel() == "x [m]"
    np.testing.assert_array_equal(line.get_ydata(), found.mean[:, 0])


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("estimate", {"state": "xx"}, "unknown state 'xx'; known: x, y, vx, vy; did you mean 'x'"),
        ("comparison", {"group": "spin"}, "unknown group 'spin'; known: position, velocity"),
        ("tracking", {"component": 3}, "component is 3; there are 1"),
        ("study", {"point": 1}, "point is 1; there are 1"),
    ],
)
def test_what_there_is_not_is_refused(results, name, options, said):
    with pytest.raises(ValueError, match=said):
        results[name].plot(**options)


@pytest.mark.parametrize("name", [*DRAWN, "problem"])
def test_results_are_short_in_a_terminal(results, name):
    assert len(repr(results[name])) < 300


def test_variables_are_no_methods_of_datasets(results):
    for name in ("estimate", "comparison", "trade", "observability"):
        assert not [v for v in results[name].to_dataset().variables if hasattr(xarray.Dataset, v)]


def test_a_tracking_is_a_dataset_and_a_table(results, tmp_path):
    problem, tracking = results["problem"], results["tracking"]
    data = tracking.to_dataset(problem)
    np.testing.assert_array_equal(data["value"].values, tracking.values)
    assert not [v for v in data.variables if hasattr(xarray.Dataset, v)]
    tracking.to_csv(tmp_path / "t.csv", problem)
    pz.save(tmp_path / "same.csv", problem, tracking)
    assert (tmp_path / "t.csv").read_bytes() == (tmp_path / "same.csv").read_bytes()
    import pandas as pd

    assert len(pd.read_csv(tmp_path / "t.csv")) == len(tracking.row_times)


def test_built_in_scenarios_by_name():
    found = pz.scenarios()
    assert found["satellite-bearing"] == "Satellite in a plane, seen by its bearing"
    assert list(found) == pz.scenarios.names()
