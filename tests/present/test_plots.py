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


NAMED = "<script>alert(1)</script>"


def test_notebooks_show_tables_short_and_escaped(results):
    from dataclasses import replace

    problem = replace(results["problem"], name=NAMED)
    estimate = replace(results["estimate"], problem=problem)
    things = [problem, problem.model, estimate, results["tracking"], results["study"], results["study"].summary]
    for thing in [*things, results["comparison"], pz.earth.Epoch("2026-11-03T10:00:00 UTC")]:
        html = thing._repr_html_()
        assert "<table" in html and "<script" not in html, type(thing)
        assert len(html) < 6000, (type(thing), len(html))
    assert "&lt;script&gt;" in problem._repr_html_()


def cells(html: str) -> list[list[str]]:
    import re

    rows = re.findall(r"<tr>(.*?)</tr>", html)
    return [re.findall(r"<t[hd]>(.*?)</t[hd]>", row) for row in rows]


def test_tables_of_notebooks_say_what_is_so(results):
    problem, tracking = results["problem"], results["tracking"]
    prior = {row[0]: row[1:] for row in cells(problem._repr_html_()) if len(row) == 4}
    i = problem.model.names.index("vx")
    assert float(prior["vx"][0]) * {"km/s": 1e3, "m/s": 1.0}[prior["vx"][2]] == pytest.approx(problem.mean[i], abs=1e-6)
    (row,) = [r for r in cells(tracking._repr_html_()) if r[0] != "station"]
    assert row[1] == f"{len(tracking.row_times):,}" and row[2] == "0"
    equations = {row[0]: row[1] for row in cells(problem.model._repr_html_())}
    assert equations["dx/dt"] == "vx"
    scales = dict(cells(pz.earth.Epoch("2017-01-01T00:00:00 UTC")._repr_html_())[1:])
    assert scales["TAI"] == "2017-01-01T00:00:37" and scales["TT"] == "2017-01-01T00:01:09.184"


def test_every_table_is_latex_too(results):
    for name in (*DRAWN, "summary"):
        thing = results["study"].summary if name == "summary" else results[name]
        text = thing.to_latex()
        assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") >= 1, name
        widths = {line.count(" & ") for line in text.splitlines() if line.endswith(r"\\")}
        assert len(widths) <= text.count(r"\begin{tabular}"), name
