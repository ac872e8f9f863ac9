"""The command line as a program: streams, pipes, signals, imports, and files from somewhere else."""

import fcntl
import os
import signal
import subprocess
import sys
import termios
import zipfile

import numpy as np
import pytest

from tests.waiting import HANGS, until

SCENARIO = "b612-range"
PIAZZI = [sys.executable, "-m", "piazzi"]


def test_stdout_holds_json_and_nothing_else_while_compiling_in_a_folder_of_last_resort(program):
    result = program("estimate", SCENARIO, "--json", env={**os.environ, "PIAZZI_CACHE": "/proc/nowhere", "PIAZZI_JIT": "1"})
    assert result.document["rows"][0]["success"]
    lines = result.err.splitlines()
    assert sum(line.startswith("piazzi: warning: no private, writable folder") for line in lines) == 1
    assert sum(line.startswith("piazzi: compiling") for line in lines) == len(lines) - 1 == 1  # however many kernels


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["estimate", "--nothing"]])
def test_help_imports_no_heavy_module(arguments):
    code = f"import sys; from piazzi.cli.main import main; main({arguments}); print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    assert not loaded & {"numpy", "rich", "sympy", "numba", "matplotlib", "xarray", "h5py", "scipy"}


def test_a_warm_estimate_imports_only_what_it_needs(program):
    program("estimate", SCENARIO, "--json")
    code = f"import sys; from piazzi.cli.main import main; main(['estimate', '{SCENARIO}', '--json']); print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())
    assert "numpy" in loaded
    assert not loaded & {"rich", "sympy", "numba", "matplotlib", "xarray", "h5py", "scipy"}


def test_commands_are_joined_by_pipes(program):
    rows = program("simulate", SCENARIO, "--seed", 9, "-o", "-")
    assert rows.out.startswith("time,range")
    piped = program("estimate", "-", "--scenario", SCENARIO, "--json", input=rows.out.encode())
    direct = program("estimate", SCENARIO, "--seed", 9, "--json")
    assert piped.document["source"] == "-"
    assert piped.document["rows"][0]["position_rmse"] == direct.document["rows"][0]["position_rmse"]


def test_archives_and_scenarios_come_through_stdin(program, tmp_path):
    text = program("scenarios", "show", SCENARIO).out
    assert program("estimate", "-", "--json", input=text.encode()).document["epochs"] == 100
    assert program("simulate", SCENARIO, "-o", tmp_path / "t.nc").status == 0
    assert program("estimate", "-", "--json", input=(tmp_path / "t.nc").read_bytes()).document["epochs"] == 100


@pytest.mark.parametrize("data", [b"", b"hello\n", b"PK\x03\x04 broken", b"\x89HDF broken", bytes(range(256)), b"\x00" * 1000])
def test_stdin_that_holds_nothing_useful_is_refused(program, data):
    line = program("estimate", "-", input=data).refused()
    assert "standard input" in line
    assert "/tmp" not in line


@pytest.mark.parametrize(
    "arguments", [["estimate", SCENARIO], ["estimate", SCENARIO, "--json"], ["--help"], ["simulate", SCENARIO, "-o", "-"]]
)
def test_a_closed_pipe_ends_quietly(arguments):
    reader, writer = os.pipe()
    os.close(reader)  # before anything can be written, however long the start takes
    try:
        done = subprocess.run([*PIAZZI, *arguments], stdout=writer, stderr=subprocess.PIPE, text=True, timeout=HANGS)
    finally:
        os.close(writer)
    assert done.returncode == 141
    assert [line for line in done.stderr.splitlines() if "compiling" not in line] == []


def test_a_full_device_is_said(program):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*PIAZZI, "estimate", SCENARIO, "--json"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


INTERRUPTING = """
import os, signal, sys
from piazzi.cli.main import main
moment, *arguments = sys.argv[1:]

class Interrupt:
    def find_spec(name, path=None, target=None):
        if name == moment:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt)
sys.exit(main(arguments))
"""


@pytest.mark.parametrize("moment", ["piazzi.cli.commands", "piazzi.cli.estimate", "numpy", "piazzi.loading"])
def test_ctrl_c_while_it_starts_ends_at_once(moment):
    """At an import: the first of all, that of the command, a heavy one, and one that the command makes when it runs."""
    command = [sys.executable, "-c", INTERRUPTING, moment, "estimate", "-"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=HANGS)
    assert done.returncode == 130
    assert done.stdout == ""
    assert done.stderr.split() == ["piazzi:", "interrupted"]


def test_ctrl_c_while_it_waits_ends_at_once():
    """What was written into its input is gone from the pipe: it reads, and there is no more to read."""
    process = subprocess.Popen(
        [*PIAZZI, "estimate", "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdin.write(b"time")
    process.stdin.flush()
    until(lambda: unread(process.stdin) == 0, process)
    process.send_signal(signal.SIGINT)
    assert process.wait(HANGS) == 130  # with its input still open
    out, error = process.communicate()
    assert out == b""
    assert error.decode().split() == ["piazzi:", "interrupted"]


def unread(pipe):
    """Bytes that a pipe holds."""
    return int.from_bytes(fcntl.ioctl(pipe, termios.FIONREAD, bytes(4)), sys.byteorder)


def test_debug_shows_where(program):
    quiet = program("estimate", "nowhere.npz")
    loud = program("estimate", "nowhere.npz", env={**os.environ, "PIAZZI_DEBUG": "1"})
    assert "Traceback" not in quiet.err
    assert "Traceback" in loud.err
    assert loud.err.splitlines()[-1] == quiet.err.splitlines()[-1]


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_terminals_of_any_encoding_get_a_table(program, encoding):
    result = subprocess.run(
        [*PIAZZI, "estimate", SCENARIO], env={**os.environ, "PYTHONIOENCODING": encoding}, capture_output=True, check=True
    )
    assert "position" in result.stdout.decode(encoding)


@pytest.mark.parametrize(
    ("wishes", "styled", "coloured"),
    [({}, False, False), ({"FORCE_COLOR": "1"}, True, True), ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, True, False)],
)
def test_colours_are_for_terminals_that_want_them(wishes, styled, coloured):
    """A failed row is red."""
    code = (
        "import sys, piazzi as pz; from piazzi.cli.main import main\n"
        "pz.ExtendedKalmanFilter.estimate = lambda self, problem, tracking: 1 / 0\n"
        f"sys.exit(main(['compare', '{SCENARIO}', '--with', 'ekf']))"
    )
    bare = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    env = bare | wishes | {"TERM": "xterm-256color", "COLUMNS": "200"}
    text = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=False).stdout.decode()
    assert "FAILED" in text
    assert ("\x1b[" in text) is styled
    assert ("31mFAILED" in text) is coloured


# ---- hostile recordings --------------------------------------------------------------------------------------------------


class Evil:
    """Unpickling this would create a file."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


@pytest.fixture
def arrays():
    n = 30
    truth = np.column_stack([np.full(n, 0.0), np.full(n, 2e7), np.full(n, 4500.0), np.zeros(n)])
    Q = np.diag([0.01, 0.01, 0.0025, 0.0025])
    P0 = np.diag([1e12, 9e12, 640000.0, 640000.0])
    return {"R": 1e-5, "Q": Q, "dt": 15.0, "meas": np.full(n, 1.5), "x0": truth[0], "P0": P0, "truth": truth}


def corrupted(arrays):
    """Names and changes of recordings that must be refused, each with what the message must name."""
    P0, Q, x0, meas = (arrays[k] for k in ("P0", "Q", "x0", "meas"))
    return {
        "r-negative": ({"R": -1.0}, "'R'"),
        "q-asymmetric": ({"Q": Q + np.triu(np.ones((4, 4)), 1)}, "'Q'"),
        "p0-indefinite": ({"P0": -P0}, "'P0'"),
        "x0-nan": ({"x0": np.where(np.arange(4) == 1, np.nan, x0)}, "'x0'"),
        "x0-short": ({"x0": x0[:3]}, "'x0'"),
        "dt-zero": ({"dt": 0.0}, "'dt'"),
        "dt-negative": ({"dt": -15.0}, "'dt'"),
        "meas-empty": ({"meas": np.zeros(0), "truth": np.zeros((0, 4))}, "'meas'"),
        "meas-infinite": ({"meas": np.where(np.arange(30) == 5, np.inf, meas)}, "'meas'"),
        "origin": ({"x0": np.zeros(4)}, "no finite value"),
        "text": ({"x0": np.array(["a", "b", "c", "d"])}, "'x0'"),
    }


CASES = [
    "r-negative",
    "q-asymmetric",
    "p0-indefinite",
    "x0-nan",
    "x0-short",
    "dt-zero",
    "dt-negative",
    "meas-empty",
    "meas-infinite",
]


@pytest.mark.parametrize("case", [*CASES, "origin", "text"])
def test_wrong_numbers_are_refused_by_name(call, arrays, tmp_path, case):
    changes, named = corrupted(arrays)[case]
    np.savez(tmp_path / f"{case}.npz", **(arrays | changes))
    line = call("estimate", tmp_path / f"{case}.npz", "--json").refused()
    assert named in line
    assert f"{case}.npz" in line


def test_nothing_is_unpickled(call, arrays, tmp_path):
    trap = tmp_path / "sprung"
    np.savez(tmp_path / "pickled.npz", **(arrays | {"meas": np.array([Evil(trap)], dtype=object)}))
    assert "'meas'" in call("estimate", tmp_path / "pickled.npz").refused()
    assert not trap.exists()


def test_files_that_are_no_recordings_are_refused(call, arrays, tmp_path):
    np.savez(tmp_path / "good.npz", **arrays)
    raw = (tmp_path / "good.npz").read_bytes()
    for name, data in {
        "half.npz": raw[: len(raw) // 2],
        "empty.npz": b"",
        "text.npz": b"hello",
        "h.nc": b"\x89HDF\r\n",
    }.items():
        (tmp_path / name).write_bytes(data)
        assert name in call("estimate", tmp_path / name).refused()
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meas.npy", bytes(10**8))
    assert "bomb.npz" in call("estimate", tmp_path / "bomb.npz").refused()
    assert "missing.npz" in call("estimate", tmp_path / "missing.npz").refused()
    assert "directory" in call("estimate", tmp_path).refused().lower()
    (tmp_path / "line\nbreak \x1b[31m.npz").write_bytes(b"x")
    line = call("estimate", tmp_path / "line\nbreak \x1b[31m.npz").refused()
    assert "\x1b" not in line
