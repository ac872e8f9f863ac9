"""`piazzi determine --follow`: an orbit carried on while its rows are being written, in a pipe or a file that grows."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.determine import _row_by_row
from piazzi.determination.case import Case
from tests.determination.fixing import EPOCH, truth
from tests.waiting import HANGS, until

T = np.arange(0.0, 36000.0, 300.0)
FIRST = 30  # rows by which an orbit is known
PIAZZI = [sys.executable, "-m", "piazzi", "determine"]


@pytest.fixture(scope="module")
def table():
    """A table of fixes, line by line: two of a header, one a row, one of them 5 km off and one of no number."""
    path = truth(T)[:, :3] + 10.0 * np.random.default_rng(1).standard_normal((len(T), 3))
    path[60] += 5e3
    lines = ["# frame = GCRF\n", "time[UTC],x[m],y[m],z[m],sigma x[m],sigma y[m],sigma z[m]\n"]
    for t, r in zip(T, path.tolist(), strict=True):
        lines.append(",".join([(EPOCH + t).to("UTC").split()[0], *map(repr, r), "10,10,10\n"]))
    lines.insert(82, "2015-05-05T06:39:00,nothing,0,0,10,10,10\n")
    return lines


class Running:
    """The command with its lines of output as they come."""

    def __init__(self, folder, *arguments):
        self.tool = subprocess.Popen(
            [*PIAZZI, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder
        )
        self.out, self.err = [], []
        self.threads = [
            threading.Thread(target=lambda: self.out.extend(iter(self.tool.stdout.readline, ""))),
            threading.Thread(target=lambda: self.err.extend(iter(self.tool.stderr.readline, ""))),
        ]
        for thread in self.threads:
            thread.start()

    def end(self):
        if not self.tool.stdin.closed:
            self.tool.stdin.close()
        status = self.tool.wait(timeout=HANGS)
        for thread in self.threads:
            thread.join()
        self.tool.stdout.close()
        self.tool.stderr.close()
        return status


@pytest.mark.slow
def test_a_pipe_is_answered_row_by_row_and_ends_with_the_orbit(tmp_path, table):
    run = Running(tmp_path, "-", "--follow", "--json", "-o", "last.oem", "-o", "last.json")
    run.tool.stdin.writelines(table[: 2 + FIRST])
    run.tool.stdin.flush()
    until(lambda: len(run.out) >= FIRST)
    for k, line in enumerate(table[2 + FIRST : 100], start=FIRST + 1):
        run.tool.stdin.write(line)
        run.tool.stdin.flush()
        bad = k > 80
        until(lambda: len(run.out) >= k - bad)  # noqa: B023  # would wait for ever if it were held back
    run.tool.stdin.close()
    assert run.end() == 0, run.err
    rows = [json.loads(line) for line in run.out]
    assert len(rows) == 97 and [k for k, row in enumerate(rows) if not row["used"]] == [60]
    assert list(rows[60]) == ["time", "station", "residuals", "used", "reason", "sigma"]
    assert rows[60]["reason"] == "beyond the gate" and abs(rows[60]["residuals"]["px"]) > 100.0
    assert rows[0]["time"] == "2015-05-05T00:00:00 UTC" and list(rows[0]["sigma"]) == ["R", "T", "N"]
    assert any("standard input: line 83: " in text and text.endswith("; skipped\n") for text in run.err)
    facts = json.loads((tmp_path / "last.json").read_text())
    assert facts["determined"] and facts["epoch"] == rows[-1]["time"] and len(facts["rejected"]) == 3
    arc = pz.read_ephemeris(tmp_path / "last.oem").arcs[0]
    np.testing.assert_allclose(arc.position[-1], facts["mean"][:3], rtol=0, atol=1e-3)
    error = (np.array(facts["mean"][:6]) - truth(T[[0, 96]])[1]) / facts["sigma"][:6]
    assert np.abs(error).max() < 5.0


@pytest.mark.slow
def test_a_file_that_grows_is_followed_until_ctrl_c(tmp_path, table):
    (tmp_path / "grows.csv").write_text("".join(table[: 2 + FIRST]))
    run = Running(tmp_path, "grows.csv", "--follow", "--with", "window:3h", "-o", "last.opm")
    until(lambda: len(run.out) >= FIRST)
    with open(tmp_path / "grows.csv", "a") as file:
        file.write("".join(table[2 + FIRST : 52])[:-20])  # a line that is not whole yet
        file.flush()
        until(lambda: len(run.out) >= 49)
        assert len(run.out) == 49
        file.write("".join(table[2 + FIRST : 52])[-20:])
        file.flush()
        until(lambda: len(run.out) >= 50)
    run.tool.send_signal(signal.SIGINT)
    assert run.end() == 0, run.err
    assert len(run.out) == 52 and "used" in run.out[0] and " sigma " in run.out[0]  # and what it was, and what was written
    assert "determined" in run.out[-2] and run.out[-1] == "Wrote last.opm\n"
    assert len(pz.read_ephemeris(tmp_path / "last.opm").arcs[0].covariance) == 1


@pytest.mark.slow
def test_an_orbit_of_before_takes_the_first_row_at_once(tmp_path, table):
    (tmp_path / "first.csv").write_text("".join(table[:50]))
    (tmp_path / "more.csv").write_text("".join([*table[:2], *table[50:56]]))
    done = subprocess.run([*PIAZZI, "first.csv", "-o", "first.json"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "more.csv") as rows:
        done = subprocess.run(
            [*PIAZZI, "-", "--follow", "--prior", "first.json", "--json"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            stdin=rows,
        )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(told) == 6 and all(row["used"] for row in told) and "looked for" not in done.stderr
    assert max(told[0]["sigma"].values()) < 30.0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["-", "--follow", "--with", "graph"], "--follow with graph: it takes one that goes row by row"),
        (["-", "--follow", "--with", "ekf", "--with", "ukf"], "--follow with ekf, ukf"),
        (["-", "--follow", "--estimate", "cd/12h"], "cd/12h is of a whole run: write cd, or cd~12h"),
        (["-", "--follow", "--estimate", "bias.range/pass=1m"], "bias.range/pass is of a whole run"),
        (["-", "--follow", "--consider", "cr=0.1"], "--consider cr=0.1 needs a whole run"),
        (["-", "--follow", "--epoch", "2026-11-03T00:00:00Z"], "--epoch is of a whole run"),
        (["-", "--follow", "--hold", "last"], "--hold is of a whole run"),
        (["-", "--follow", "-o", "nowhere/last.oem"], "no folder"),
        (["missing.csv", "--follow"], "No such file"),
        (["-"], "standard input is followed: add --follow"),
    ],
)
def test_what_cannot_be_followed_is_refused_in_one_line(tmp_path, call, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    assert says in call("determine", *arguments).refused()
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize(
    ("text", "status", "says"),
    [
        ("", 3, "not determined: there are no measurements yet"),
        ("<xml/>\n", 2, "a TDM (KVN) or a table (CSV) is followed"),
        ("time[UTC],x[m],y[m],z[m]\n2015-05-05T00:00:00,7e6,0,0\n", 2, "--frame ITRF"),
        ("# frame = GCRF\ntime[UTC],x[m],y[m],z[m]\n2015-05-05T00:00:00,7e6,0,0\n", 2, "--sigma"),
    ],
)
def test_what_a_stream_leaves_open_is_asked_for(tmp_path, text, status, says):
    command = [*PIAZZI, "-", "--follow"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, input=text, timeout=HANGS)
    assert done.returncode == status and says in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
    assert done.stdout == "" and not Path(tmp_path, "last.oem").exists()


def test_a_case_of_whole_runs_is_followed_by_what_goes_row_by_row(capsys):
    for given, kept, said in (
        (("graph",), None, "followed by ekf:gate, not by graph of the case"),
        (("graph", "window:6h", "ekf"), ("window:6h",), "followed by window:6h, not by graph, ekf of the case"),
        (("ukf",), ("ukf",), ""),
        (None, None, ""),
    ):
        assert _row_by_row(Case(with_=given)).with_ == kept
        assert said in capsys.readouterr().err
