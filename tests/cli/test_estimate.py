"""``piazzi estimate`` and ``piazzi compare``: contracts, files and statuses."""

import csv
import json
import os
import re
import sys
import tempfile

import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.output import check_place
from piazzi.scenarios import show

SCENARIO = "b612-range"


@pytest.fixture(scope="module")
def ekf():
    return pz.ExtendedKalmanFilter().estimate(*pz.load(SCENARIO))


def test_json_of_one_estimate(call, ekf):
    result = call("estimate", SCENARIO, "--json")
    document = result.document
    assert (result.status, result.said) == (0, [])
    assert document["schema"] == "piazzi.estimate/1"
    assert (document["source"], document["epochs"], document["states"]) == (SCENARIO, 100, ["x", "y", "vx", "vy"])
    assert document["units"] == {"x": "m", "y": "m", "vx": "m/s", "vy": "m/s"}
    (row,) = document["rows"]
    assert (row["estimator"], row["view"], row["success"], row["diverged"]) == ("ekf", "realtime", True, False)
    assert row["final"]["time"] == ekf.times[-1]
    assert row["final"]["mean"] == ekf.mean[-1].tolist()
    assert row["final"]["sigma"] == pytest.approx(np.sqrt(np.diagonal(ekf.covariance[-1])))
    length = np.linalg.norm((ekf.mean - ekf.tracking.truth)[:, :2], axis=1)
    assert row["position_rmse"] == pytest.approx(np.sqrt(np.mean(length**2)))


def test_json_of_a_comparison(call):
    result = call("compare", SCENARIO, "--with", "ekf", "--with", "window:10x2", "--with", "graph", "--json")
    document = result.document
    assert document["schema"] == "piazzi.compare/1"
    assert [(r["estimator"], r["view"]) for r in document["rows"]] == [
        ("ekf", "realtime"),
        ("window:10x2", "realtime"),
        ("window:10x2", "delayed"),
        ("graph", "delayed"),
    ]
    assert all("final" not in r for r in document["rows"])


def test_the_seed_is_the_draw(call):
    one, same, other = (call("estimate", SCENARIO, "--json", "--seed", s).document["rows"][0] for s in (1, 1, 2))
    assert one["position_rmse"] == same["position_rmse"] != other["position_rmse"]


def test_the_founding_recording(call, data_dir):
    """Figures of an independent C program."""
    result = call("compare", data_dir / "satellite" / "slide_example.npz", "--with", "ekf", "--json")
    document = result.document
    (row,) = document["rows"]
    assert document["source"] == "slide_example.npz"
    assert row["position_rmse"] == pytest.approx(616655.46, rel=1e-6)
    assert row["velocity_rmse"] == pytest.approx(142.2416, rel=1e-6)
    assert row["position_rmse_last_half"] == pytest.approx(13985.43, rel=1e-6)
    assert row["velocity_rmse_last_half"] == pytest.approx(6.72672, rel=1e-5)


def test_both_updates_run_on_both_experiments(call):
    for scenario in ("b612-range", "b612-range-q0"):
        rows = call("compare", scenario, "--with", "ekf:joint", "--with", "ekf:components", "--json").document["rows"]
        assert all(r["success"] for r in rows)
        assert rows[0]["position_rmse"] == pytest.approx(rows[1]["position_rmse"], rel=1e-6)


def test_people_get_the_state_the_table_and_a_sentence(call):
    result = call("estimate", SCENARIO)
    assert result.status == 0
    assert "100 epochs over 9.90 s, 100 measurements by radar, truth known, prior at 0 s" in result.out
    assert "State at t = 9.9 s, ekf" in result.out
    assert "position error of ekf is" in result.out
    assert "\x1b" not in result.out  # no colours where nobody looks


@pytest.mark.parametrize("width", [40, 80, 132])
def test_no_line_is_wider_than_the_terminal(call, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    assert max(map(len, call("compare", SCENARIO, "--with", "ekf", "--with", "window:10").out.splitlines())) <= width


@pytest.mark.parametrize("width", ["0", "", "wide", "\N{SUPERSCRIPT TWO}"])
def test_a_width_that_is_none_does_not_count(call, monkeypatch, width):
    """Some shells and editors say 0 where they do not know."""
    monkeypatch.setenv("COLUMNS", width)
    assert "position error of ekf is" in call("estimate", SCENARIO).out


# ---- files ---------------------------------------------------------------------------------------------------------------


def test_an_estimate_is_written_in_each_format(call, ekf, tmp_path):
    for ending in ("json", "csv", "npz", "nc"):
        assert call("estimate", SCENARIO, "-o", tmp_path / f"e.{ending}").status == 0
    series = json.loads((tmp_path / "e.json").read_text())["series"]
    assert series["mean"] == ekf.mean.tolist()
    assert series["covariance"] == ekf.covariance.tolist()
    with np.load(tmp_path / "e.npz", allow_pickle=False) as arrays:
        assert (arrays["mean"] == ekf.mean).all()
    from piazzi.io import load_estimate

    assert (load_estimate(tmp_path / "e.nc").mean == ekf.mean).all()
    with open(tmp_path / "e.csv", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert [float(r["x"]) for r in rows] == ekf.mean[:, 0].tolist()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["e.csv", "e.json", "e.nc", "e.npz"]


def test_dash_is_json_on_stdout_and_nothing_else(call):
    plain, with_json = call("estimate", SCENARIO, "-o", "-"), call("estimate", SCENARIO, "-o", "-", "--json")
    assert len(plain.document["series"]["times"]) == len(with_json.document["series"]["times"]) == 100


def test_rows_of_a_comparison_are_written(call, tmp_path):
    assert call("compare", SCENARIO, "--with", "window:10", "-o", tmp_path / "c.csv", "--json").document["epochs"] == 100
    with open(tmp_path / "c.csv", newline="") as file:
        assert [r["view"] for r in csv.DictReader(file)] == ["realtime", "delayed"]
    assert call("compare", SCENARIO, "--with", "ekf", "-o", tmp_path / "c.json").status == 0
    assert json.loads((tmp_path / "c.json").read_text())["schema"] == "piazzi.compare/1"


@pytest.mark.parametrize("command", ["estimate", "compare", "simulate"])
@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("{}/absent/e.csv", "there is no folder"),
        ("{}/e.txt", "the file must end in"),
        ("{}/folder.csv", "it is a folder"),
        ("{}/file.csv/e.csv", "there is no folder"),
        ("/proc/e.csv", "cannot be written"),
    ],
)
def test_output_that_cannot_be_written_is_refused_before_anything_runs(call, monkeypatch, tmp_path, command, target, message):
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "file.csv").write_text("kept")
    monkeypatch.setattr("piazzi.cli.sources.load_source", None)  # reading the source would be an error of another kind
    assert message in call(command, SCENARIO, "-o", target.format(tmp_path)).refused()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file.csv", "folder.csv"]
    assert (tmp_path / "file.csv").read_text() == "kept"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="files without a name are Linux's")
def test_to_try_an_output_makes_no_name(monkeypatch, tmp_path):
    """A command that is killed meanwhile leaves nothing."""
    real, seen = tempfile.TemporaryFile, []

    def tried(**where):
        file = real(**where)
        seen.append(os.listdir(where["dir"]))
        return file

    monkeypatch.setattr(tempfile, "TemporaryFile", tried)
    check_place(os.fspath(tmp_path / "e.csv"))
    assert seen == [[]]


def test_a_failed_run_leaves_the_old_file(call, tmp_path):
    (tmp_path / "e.json").write_text("kept")
    call("estimate", "nowhere.npz", "-o", tmp_path / "e.json").refused()
    assert [p.read_text() for p in tmp_path.iterdir()] == ["kept"]


def test_several_estimates_do_not_fit_one_file(call, tmp_path):
    line = call("estimate", SCENARIO, "--with", "ekf", "--with", "window:5", "-o", tmp_path / "e.json").refused()
    assert "-o writes one estimate" in line


# ---- estimators that do not succeed ---------------------------------------------------------------------------------------


def test_an_estimator_that_raises_keeps_its_row_and_the_others_theirs(call, monkeypatch):
    def fail(self, problem, tracking):
        raise RuntimeError("out of luck")

    monkeypatch.setattr(pz.FactorGraph, "estimate", fail)
    result = call("compare", SCENARIO, "--with", "graph", "--with", "ekf", "--json")
    assert result.status == 3
    graph, ekf = result.document["rows"]
    assert (graph["success"], graph["view"], graph["position_rmse"], graph["seconds"]) == (False, "delayed", None, None)
    assert "out of luck" in graph["message"]
    assert ekf["success"]
    assert "graph did not succeed" in call("compare", SCENARIO, "--with", "graph", "--with", "ekf").out
    assert call("estimate", SCENARIO, "--with", "graph").status == 3


def test_an_estimate_that_is_not_finite_is_status_3_and_still_strict_json(call, tmp_path, monkeypatch):
    """The motion x' = x^3 from x = 1 reaches infinity at t = 1/2."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    (tmp_path / "burst.toml").write_text(
        """
        states = { x = "length" }
        dynamics = { x = "x**3" }
        sensors.ruler.components.place = { equation = "x", unit = "length" }
        stations = [{ name = "wall", sensor = "ruler", noise = { sigma = 1.0 } }]
        prior = { mean = [1.0], sigma = [0.1] }
        times = { step = 1.0, count = 3 }
        """
    )
    (tmp_path / "rows.csv").write_text("time,place\n0,1\n1,1\n2,1\n")
    arguments = (tmp_path / "rows.csv", "--scenario", tmp_path / "burst.toml")
    result = call("estimate", *arguments, "--json", "-o", tmp_path / "burst.json")
    (row,) = result.document["rows"]
    assert (result.status, row["success"]) == (3, False)
    assert row["message"].startswith("the estimate is not finite from epoch 1 (t = 1 s)")
    written = json.loads((tmp_path / "burst.json").read_text(), parse_constant=pytest.fail)
    assert written["rows"][0]["final"]["mean"] == [None]
    assert [v[0] is None for v in written["series"]["mean"]] == [False, True, True]


def test_long_steps_are_warned_of_in_one_line(call, tmp_path):
    """On a recording, and where the truth has steps of its own; not where it was simulated with the same ones."""
    text = show(SCENARIO).replace("substeps = 10", "substeps = 1").replace("step = 0.1", "step = 0.8")
    coarse, fine = tmp_path / "coarse.toml", tmp_path / "fine.toml"
    coarse.write_text(text)
    fine.write_text(text + '\n[truth.integrator]\nmethod = "rk4"\nsubsteps = 40\n')
    assert call("simulate", fine, "-o", tmp_path / "rows.csv").status == 0
    for arguments in ([fine], [tmp_path / "rows.csv", "--scenario", coarse]):
        name = arguments[0].name
        wanted = rf"piazzi: warning: {re.escape(name)}: the integrator's steps are too long: \d+ times as many move '.*"
        for estimator in ("ekf", "graph", "window:5", "smoother"):
            for command in ("estimate", "compare"):
                result = call(command, *arguments, "--with", estimator, "--json")
                (line,) = result.said
                assert re.fullmatch(wanted, line)
                assert result.document["rows"][0]["success"]
        page = tmp_path / "page.html"
        assert re.search(wanted, call("report", *arguments, "--with", "smoother", "-o", page).err)
        assert "steps are too long" in page.read_text()
    assert call("estimate", coarse, "--json").said == []


def test_the_rows_of_a_comparison_with_a_gate_are_one_table(call, tmp_path):
    """The column of rejected rows is there for all, whoever comes first."""
    result = call("compare", SCENARIO, "--with", "ekf", "--with", "ekf:gate=0.9", "-o", tmp_path / "rows.csv")
    assert result.status == 0
    plain, gated = csv.DictReader((tmp_path / "rows.csv").read_text().splitlines())
    assert plain["rejected"] == ""
    assert f"The gate of ekf:gate=0.9 rejected {gated['rejected']} of 100 measurements." in result.out


def test_an_optimisation_tells_how_it_ended(call):
    """Solver, start, cost, gradient and defect: for a reader, and in numbers."""
    graph = pz.FactorGraph().estimate(*pz.load(SCENARIO))
    details = call("estimate", SCENARIO, "--with", "graph", "--json").document["rows"][0]["details"]
    assert (details["solver"], details["start"], details["cost"]) == ("chain", "ekf", graph.details["cost"])
    assert details.keys() >= {"gradient_norm", "defect"}
    (line,) = [s for s in call("estimate", SCENARIO, "--with", "graph").out.splitlines() if s.startswith("Solver")]
    assert line.startswith(f"Solver chain, started from ekf: {graph.iterations} iterations, cost {graph.details['cost']:.6g},")
    assert "Solver" not in call("estimate", SCENARIO).out


def test_every_output_says_where_the_prior_stands(call, tmp_path):
    scenario, rows = tmp_path / "late.toml", tmp_path / "rows.csv"
    scenario.write_text(show("b612-range"))
    text = "".join(f"{0.1 * k:.1f},8.9\n" for k in range(5, 25))
    rows.write_text("time,range\n" + text)
    arguments = (rows, "--scenario", scenario)
    assert "prior at 0 s, 500 ms before the first epoch" in call("estimate", *arguments).out
    assert call("estimate", *arguments, "--json").document["prior_time"] == 0.0
    page = tmp_path / "page"
    assert call("compare", *arguments, "--with", "ekf", "--report", page).status == 0
    assert "prior at 0 s, 500 ms before the first epoch" in next(page.glob("*.html")).read_text()
    early = show("b612-range-q0").replace("\n[times]", "\n[times]\nstart = 1.0 ")
    scenario.write_text(early)
    assert call("scenarios", "check", scenario).out == f"{scenario}: nothing wrong; prior at 1 s\n"
    found = call("estimate", *arguments)
    assert "prior at 0.5 s" in found.out
    assert "rows.csv: begins at 0.5 s, before the prior at 1 s, which was propagated back" in found.err
    scenario.write_text(early.replace("[prior]", "[prior]\ntime = 'first'"))
    assert call("scenarios", "check", scenario).out.endswith("the prior is at the first measurement, whenever that is\n")
