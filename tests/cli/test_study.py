"""``piazzi study``."""

import json
import os
import resource
import signal
import subprocess
import sys

import pytest

from tests.waiting import HANGS, until

FAST = ["--runs", 6, "--workers", 0]


def test_table_and_json(call, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")
    arguments = [
        "study",
        "b612-range",
        "--with",
        "ekf",
        "--with",
        "window",
        "--vary",
        "lag=5,20",
        "--vary",
        "R.scale=1,4",
        *FAST,
    ]
    result = call(*arguments, "-o", tmp_path / "s.nc")
    assert result.status == 0
    assert result.said == ["2 points x 6 runs x 3 estimators = 36 estimates of 100 epochs"]
    lines = result.out.splitlines()
    assert lines[0] == "b612-range: 6 runs of 100 epochs at 2 points, seed 0"
    assert lines[-1] == f"Wrote {tmp_path / 's.nc'}"
    assert sum("window:20" in line for line in lines) == 4
    document = call(*arguments, "-o", tmp_path / "s.nc", "--resume", "--json").document
    assert document["schema"] == "piazzi.study/1"
    assert [(r["point"]["R.scale"], r["estimator"], r["view"]) for r in document["rows"]][:3] == [
        (1, "ekf", "realtime"), (1, "window:5", "realtime"), (1, "window:5", "delayed"),
    ]  # fmt: skip


@pytest.mark.parametrize("columns", [20, 80, 120])
def test_narrow_terminals_lose_no_row(call, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    out = call("study", "b612-range", "--with", "ekf", "--with", "window:5", *FAST).out
    assert out.count("window:5") == 2
    assert "diverged" in out
    if columns > 20:
        assert max(map(len, out.splitlines())) <= columns


def test_without_a_file_nothing_is_left(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("study", "b612-range", *FAST).status == 0
    assert os.listdir(tmp_path) == []


def test_a_failed_run_is_a_row_and_status_3(call, tmp_path):
    text = tmp_path / "s.toml"
    shown = call("scenarios", "show", "b612-range").out
    text.write_text(
        shown.replace("[truth] ", "study.runs = 2\n[truth] ").replace("[picture]", "[study]\nruns = 2\n\n[picture]")
    )
    text.write_text(text.read_text().replace("study.runs = 2\n", "").replace("[truth] ", "[truth]\naccept = '-1 - x**2'\n"))
    result = call("study", text, "--workers", 0)
    assert result.status == 3
    assert "none of 1000 truths drawn for a run is accepted: -1 - x**2 > 0" in result.out
    assert result.said == ["2 runs x 1 estimator = 2 estimates of 100 epochs"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--vary", "lag"], "write NAME=VALUE,VALUE"),
        (["--vary", "lag=1,,2"], "write NAME=VALUE,VALUE"),
        (["--vary", "R.scale=1", "--vary", "R.scale=2"], "a name is given twice"),
        (["--vary", "R.scala=1"], "did you mean 'R.scale'?"),
        (["--with", "efk"], "unknown estimator 'efk'"),
        (["--resume"], "--resume needs -o FILE"),
        (["-o", "-"], "a study goes into a .nc file"),
        (["-o", "study.csv"], "must end in .nc"),
        (["-o", "no/such/folder/s.nc"], "no such folder"),
        (["--runs", "0"], "0 is not in the range"),
        (["--runs", "999999999999"], "999,999,999,999 estimates; at most"),
    ],
)
def test_refusals(call, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    found = call("study", "b612-range", *arguments).refused()
    assert said in found or said == "no such folder"
    assert os.listdir(tmp_path) == []


def test_a_grid_of_millions_says_how_many_and_does_not_start(call):
    values = ",".join(str(1 + i / 1000) for i in range(1500))
    line = call("study", "b612-range", "--vary", f"R.scale={values}", "--vary", f"Q.scale={values}").refused()
    assert "1500 x 1500 has 2,250,000 points" in line


def test_unknown_scenarios_have_the_nearest(call):
    assert "did you mean 'founding-study'?" in call("study", "founding-stud").refused()


def test_scenario_files_say_what_is_studied(call, tmp_path):
    shown = call("scenarios", "show", "b612-range").out
    path = tmp_path / "mine.toml"
    study = '[study]\nruns = 3\nestimators = ["ekf", "window:5"]\nvary = { "R.scale" = [1, 2.5], lag = [5, 6] }\n\n[picture]'
    path.write_text(shown.replace("[picture]", study))
    document = call("study", path, "--workers", 0, "--json").document
    assert (document["runs"], document["axes"]) == (3, {"R.scale": [1, 2.5]})
    assert [r["estimator"] for r in document["rows"]][:5] == ["ekf", "window:5", "window:5", "window:6", "window:6"]


@pytest.mark.parametrize(
    ("section", "fault"),
    [
        ("runs = 0", "study.runs: must be a whole number"),
        ("estimators = 3", "study.estimators: must be text"),
        ("vary = { lag = [] }", "study.vary.lag: must be a list of numbers or texts"),
        ("vary = { lag = [true] }", "study.vary.lag"),
        ("rums = 1", "study.rums: unknown key"),
    ],
)
def test_faults_of_the_section(call, tmp_path, section, fault):
    path = tmp_path / "mine.toml"
    path.write_text(call("scenarios", "show", "b612-range").out.replace("[picture]", f"[study]\n{section}\n\n[picture]"))
    result = call("scenarios", "check", path)
    assert result.status == 2
    assert fault in result.err


def test_pictures(call, tmp_path):
    result = call("study", "b612-range", *FAST, "--with", "ekf", "--with", "window:5", "--figures", tmp_path / "figures")
    assert result.status == 0
    names = ["study-cost.png", "study-errors.png", "study-nees.png"]
    assert sorted(os.listdir(tmp_path / "figures")) == names
    assert all((tmp_path / "figures" / name).read_bytes().startswith(b"\x89PNG") for name in names)


def test_report_page(call, tmp_path):
    """The whole grid and each point, with every line of the table; a hostile name is text; --title is the page's."""
    path = tmp_path / "<b>.toml"
    path.write_text(call("scenarios", "show", "b612-range").out.replace("Probe around", "<script>"))
    arguments = ["--with", "ekf", "--with", "window:5", "--vary", "R.scale=1,4", "--report", tmp_path / "page"]
    result = call("study", path, *FAST, *arguments)
    assert result.status == 0, result.err
    assert result.out.splitlines()[-1] == f"Wrote {tmp_path / 'page' / 'report.html'}"
    page = (tmp_path / "page" / "report.html").read_text()
    assert page.count('<article class="tab"') == 3
    assert '<select data-axis="0"><option value="1">1</option><option value="4">4</option></select>' in page
    assert "R.scale = 4" in page
    assert page.count("window:5") >= 4
    assert "<script> B612" not in page
    assert "&lt;script&gt; B612" in page
    named = call("study", "b612-range", *FAST, "--title", "Mine & yours", "--report", tmp_path / "other.html")
    assert named.status == 0
    assert "<title>Mine &amp; yours</title>" in (tmp_path / "other.html").read_text()


@pytest.mark.slow
def test_interrupt_leaves_a_store_that_goes_on(tmp_path):
    """Ctrl-C reaches the whole group of processes, as it does in a terminal."""
    command = [sys.executable, "-m", "piazzi", "study", "b612-range", "--runs", "100000", "--with", "graph", "--workers", "2"]
    process = subprocess.Popen(
        [*command, "--chunk", "50", "-o", tmp_path / "s.nc"],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    beside = tmp_path / "s.nc.runs"
    until(lambda: beside.exists() and beside.stat().st_size > 100_000, process)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=HANGS)
    assert process.returncode == 130
    assert out == ""
    lines = [line for line in err.splitlines() if line and "compiling" not in line]
    assert lines[1].startswith("piazzi: ")
    assert "of 100,000 runs are kept beside" in lines[1]
    assert lines[2] == "piazzi: interrupted"
    assert len(lines) == 3


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="no limits of file sizes here")
def test_a_file_that_cannot_grow_ends_with_a_clear_error_and_goes_on(tmp_path):
    """The limit of the size of files stands for a full disk: writes fail in the middle of a record."""
    study = ["study", "b612-range", "--runs", "600", "--with", "ekf", "--workers", "0"]
    command = [sys.executable, "-m", "piazzi", *study]
    limited = (
        "import resource, signal, sys; from piazzi.cli.main import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, resource.RLIM_INFINITY))\n"
        "sys.exit(main(sys.argv[1:]))"
    )
    options = {"capture_output": True, "text": True, "check": False, "timeout": HANGS}
    first = subprocess.run([sys.executable, "-c", limited, *study, "-o", tmp_path / "s.nc"], **options)
    assert first.returncode == 2
    assert "File too large" in first.stderr.splitlines()[-1]
    assert "Traceback" not in first.stderr
    assert os.listdir(tmp_path) == ["s.nc.runs"]
    again = subprocess.run([*command, "-o", tmp_path / "s.nc", "--resume", "--json"], **options)
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["rows"][0]["failed"] == 0
    subprocess.run([*command, "-o", tmp_path / "whole.nc"], **options)
    from piazzi.study import same_results

    assert same_results(tmp_path / "s.nc", tmp_path / "whole.nc") == []
