"""A disk that is full, or a file that may not grow: one line with the file's name, nothing left, and the process lives on."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import HANGS

PROGRAM = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # else the system ends the process
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
"""
TWICE = """
import os
from piazzi.cli.main import main
sys.argv = {words}
assert main() == 0  # kernels are made now, if they are not there
os.remove(sys.argv[-1])
print("AGAIN", file=sys.stderr)
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
sys.exit(main())
"""
COMMANDS = {
    "simulate": ["simulate", "b612-range", "-o", "full.nc"],
    "csv": ["simulate", "b612-range", "-o", "full.csv"],
    "npz": ["simulate", "satellite-bearing", "-o", "full.npz"],
    "estimate": ["estimate", "b612-range", "-o", "full.nc"],
    "report": ["report", "b612-range", "-o", "full.html"],
}


def limited(limit: int, code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", PROGRAM.format(limit=limit) + code], cwd=folder, capture_output=True, text=True, timeout=HANGS
    )


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="a limit of file sizes is POSIX")
@pytest.mark.parametrize("what", COMMANDS)
def test_commands_say_which_file_could_not_be_written_and_leave_nothing(what, tmp_path):
    run = limited(2**40, TWICE.format(words=["piazzi", *COMMANDS[what]]), tmp_path)
    assert run.returncode == 2, run.stderr
    name, said = COMMANDS[what][-1], run.stderr.partition("AGAIN\n")[2]
    assert said.strip().count("\n") == 0 and name in said and "too large" in said.lower()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="a limit of file sizes is POSIX")
def test_kernels_that_cannot_be_kept_run_all_the_same(tmp_path):
    code = "import os\nos.environ['PIAZZI_CACHE'] = 'cache'\nfrom piazzi.cli.main import main\n"
    code += "sys.argv = ['piazzi', 'estimate', 'b612-range', '--with', 'ekf', '--json']\nsys.exit(main())"
    run = limited(5_000, code, tmp_path)
    assert (run.returncode, run.stdout[:1]) == (0, "{"), run.stderr
    assert "kernels are not kept" in run.stderr


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="a limit of file sizes is POSIX")
def test_a_notebook_lives_on_and_keeps_the_old_file(tmp_path):
    (tmp_path / "old.nc").write_bytes(b"old")
    code = """
import numpy as np, piazzi as pz
from piazzi.io.netcdf import write_netcdf
problem, tracking = pz.load("b612-range")
try:
    write_netcdf("old.nc", problem, tracking)
except OSError as error:
    print("told", error.filename)
print("alive")
"""
    run = limited(1000, code, tmp_path)
    assert (run.returncode, run.stdout.split()) == (0, ["told", "old.nc", "alive"]), run.stderr
    assert [f.name for f in tmp_path.iterdir()] == ["old.nc"] and (tmp_path / "old.nc").read_bytes() == b"old"


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="a limit of file sizes is POSIX")
def test_a_store_that_does_not_fit_leaves_its_log_to_resume_from(tmp_path):
    command = ["study", "b612-range", "--runs", "20", "--with", "ekf", "--workers", "0", "-o", "s.nc"]
    code = f"from piazzi.cli.main import main\nsys.argv = ['piazzi', *{command!r}]\nsys.exit(main())"
    free = limited(2**30, code, tmp_path)
    assert free.returncode == 0, free.stderr
    size = (tmp_path / "s.nc").stat().st_size
    (tmp_path / "s.nc").unlink()
    run = limited(size - 1, code, tmp_path)
    assert run.returncode == 2 and "s.nc" in run.stderr, run.stderr
    assert [f.name for f in tmp_path.iterdir()] == ["s.nc.runs"]
    again = limited(2**30, code.replace("'s.nc'", "'s.nc', '--resume'"), tmp_path)
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "s.nc").stat().st_size == size
