"""Dates at the command line: rows with dates in, dates where results are shown, and bad ones refused in one line."""

import json
import re
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.figure
import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.simulate import to_dict
from piazzi.present.figures.measured import measurements
from tests.io.test_dates import scenario
from tests.waiting import HANGS

ROWS = "2016-12-31T23:59:59,1\n2016-12-31T23:59:60,2\n2017-01-01T00:00:00.25,3\n"
PIAZZI = [str(Path(sys.executable).with_name("piazzi"))]


@pytest.fixture
def dated(tmp_path):
    path = scenario(tmp_path)
    (tmp_path / "rows.csv").write_text("time,z\n" + ROWS)
    return path


def test_rows_with_dates_are_estimated_and_shown_with_dates(call, dated):
    rows = dated.with_name("rows.csv")
    found = call("estimate", rows, "--scenario", dated, "--scale", "utc", "--json").document
    assert found["epoch"] == "2016-12-31T23:00:00 UTC"
    assert found["rows"][0]["final"]["time"] == 3601.25
    shown = call("estimate", rows, "--scenario", dated, "--scale", "UTC").out
    assert "from 2016-12-31T23:59:59 UTC" in shown
    assert "(2017-01-01T00:00:00.25 UTC)" in shown
    ahead = call("estimate", rows, "--scenario", dated, "--scale", "UTC", "--predict", "10min").out
    assert "Predicted from t = 3601.25 s (2017-01-01T00:00:00.25 UTC)" in ahead


@pytest.mark.parametrize(
    ("arguments", "text", "message"),
    [
        ((), "time,z\n" + ROWS, "line 2: date '2016-12-31T23:59:59' has no time scale"),
        (("--scale", "XYZ"), "time,z\n" + ROWS, "'XYZ' is not one of"),
        ((), "time[UTC],z\n1959-12-31,1\n", "line 2: .* there is no UTC before 1960"),
        ((), "time[UTC],z\n2017-01-01T23:59:60,1\n", "line 2: .* that day did not end with a leap second"),
        ((), "time[UTC],z\n2021-01-01,1\n", "line 2: .* give a nearer epoch"),
        ((), "time,z\n2017-01-01 UTC,1\n2017-01-02 GPS,1\n", "line 3: .* is in GPS, those before in UTC"),
    ],
)
def test_bad_dates_are_refused_in_one_line(call, dated, arguments, text, message):
    rows = dated.with_name("rows.csv")
    rows.write_text(text)
    assert re.search(message, call("estimate", rows, "--scenario", dated, *arguments).refused())


def test_a_scenario_with_a_bad_epoch_is_refused_in_one_line(call, tmp_path):
    refused = call("simulate", scenario(tmp_path, "2016-02-13T16:00:00")).refused()
    assert "epoch: date '2016-02-13T16:00:00' has no time scale: add one of UTC" in refused


def test_a_stream_of_dates_is_followed(dated):
    follow = [*PIAZZI, "estimate", str(dated), "--follow", "-"]
    done = subprocess.run([*follow, "--scale", "UTC"], input="time,z\n" + ROWS, capture_output=True, text=True, timeout=HANGS)
    lines = done.stdout.splitlines()
    assert (done.returncode, lines[0], lines[1]) == (0, "# epoch = 2016-12-31T23:00:00 UTC", "time,x,v,sigma_x,sigma_v")
    assert [float(line.split(",")[0]) for line in lines[2:]] == [3599.0, 3600.0, 3601.25]
    done = subprocess.run([*follow, "--json"], input="time[UTC],z\n" + ROWS, capture_output=True, text=True, timeout=HANGS)
    assert [json.loads(line)["date"] for line in done.stdout.splitlines()][1] == "2016-12-31T23:59:60 UTC"


def test_pictures_and_objects_have_dates(dated):
    problem, tracking = pz.load(dated)
    ax = matplotlib.figure.Figure().add_subplot()
    measurements(ax, problem, tracking)
    assert ax.get_xlabel() == "time [UTC]"
    assert ax.get_xticklabels()[0].get_text().startswith("23:00:00")
    later = pz.simulate(problem, np.arange(3) * 7200.0, np.random.default_rng(0))
    measurements(ax, problem, later)
    assert "00:00\n2017-01-01" in [label.get_text() for label in ax.get_xticklabels()]
    assert to_dict(problem, tracking, "", 0, None)["epoch"] == "2016-12-31T23:00:00 UTC"


def test_a_report_has_dates_on_its_axes(call, dated):
    page = dated.with_name("page.html")
    assert call("report", dated, "--with", "ekf", "-o", page).status == 0
    (found,) = re.findall(r'"calendar":(\{[^}]*\})', page.read_text())
    calendar = json.loads(found)
    assert calendar["scale"] == "UTC" and calendar["zero"] == 1e3 * datetime(2016, 12, 31, 23, tzinfo=UTC).timestamp()
    assert calendar["leaps"] == [3600.0]  # the second before midnight is twice as long as it looks


def test_a_study_keeps_the_epoch(call, dated):
    store = dated.with_name("study.nc")
    found = call("study", dated, "--runs", "2", "--with", "ekf", "--workers", "0", "--json", "-o", store)
    assert found.document["epoch"] == "2016-12-31T23:00:00 UTC"
