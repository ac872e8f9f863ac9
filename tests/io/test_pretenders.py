"""What has the name of a file and is none: a pipe or a device is refused by every reader, and a pipe for writing, at once."""

import os
import subprocess
import sys

import pytest

import piazzi as pz
from piazzi.earth.eop import read_eop
from piazzi.earth.fields import read_gravity
from piazzi.io.archive import read_arrays
from piazzi.io.atomic import atomic_path
from piazzi.io.files import load_estimate
from piazzi.scenarios import check, load_scenario, show
from piazzi.study import read_store
from piazzi.study.execute import kept_runs
from piazzi.study.log import ENDING, Log
from piazzi.tables.cells import read_cells
from tests.waiting import HANGS

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
READERS = {
    "recording.npz": pz.load,
    "recording.nc": pz.load,
    "recording.csv": lambda path: pz.load(path, scenario="b612-range"),
    "cells.csv": read_cells,
    "scenario.toml": load_scenario,
    "faults.toml": check,
    "estimate.nc": load_estimate,
    "store.nc": read_store,
    "checkpoint.npz": lambda path: read_arrays(path, ["mark"], ["mark"]),
    "field.gfc": read_gravity,
    "eop.txt": read_eop,
    "s.nc.runs": Log.open,
}


@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
@pytest.mark.parametrize("name", READERS)
def test_readers_refuse_at_once(tmp_path, name, what):
    path = tmp_path / name
    os.mkfifo(path) if what == "pipe" else os.symlink(what, path)
    with pytest.raises((OSError, ValueError), match="is a pipe or a device"):
        READERS[name](path)


@pytest.mark.parametrize("what", ["pipe", "/dev/zero"])
def test_runs_beside_a_store_are_none(tmp_path, what):
    path = tmp_path / f"s.nc{ENDING}"
    os.mkfifo(path) if what == "pipe" else os.symlink(what, path)
    assert kept_runs(tmp_path / "s.nc") == 0


def test_a_pipe_is_not_written_to(tmp_path):
    path = tmp_path / "out.csv"
    os.mkfifo(path)
    with pytest.raises(OSError, match=r"cannot write .*out.csv: it is a pipe"), atomic_path(path) as work:
        work.write_text("x")
    assert os.listdir(tmp_path) == ["out.csv"]


@pytest.mark.parametrize("command", [["estimate", "b612-range", "-o"], ["simulate", "b612-range", "-o"]])
def test_commands_refuse_a_pipe_that_nobody_reads(tmp_path, command):
    os.mkfifo(tmp_path / "out.csv")
    command = [sys.executable, "-m", "piazzi", *command, "out.csv"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=HANGS, check=False)
    assert (done.returncode, done.stderr) == (2, "piazzi: cannot write out.csv: it is a pipe, not a file\n")


def test_a_scenario_may_come_from_a_pipe_of_the_shell():
    """`piazzi simulate <(sed ...)`: a pipe under the name of no file is read as far as a scenario can go."""
    source, sink = os.pipe()
    with open(sink, "w") as file:
        file.write(show("b612-range"))
    try:
        assert load_scenario(f"/dev/fd/{source}").problem.model == load_scenario("b612-range").problem.model
    finally:
        os.close(source)
