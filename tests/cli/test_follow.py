"""`piazzi estimate SCENARIO --follow`: a tracker in a pipe, that survives bad lines and being killed."""

import json
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.estimate.registry import parse
from tests.waiting import HANGS, until

PIAZZI = [str(Path(sys.executable).with_name("piazzi"))]
FOLLOW = [*PIAZZI, "estimate", "b612-range", "--follow"]


def run(*arguments, text=""):
    return subprocess.run([*FOLLOW, *map(str, arguments)], input=text, capture_output=True, text=True, timeout=HANGS)


@pytest.fixture(scope="module")
def measurements():
    """The scenario's problem, its measurements, and the same as lines of text."""
    problem, tracking = pz.load("b612-range", seed=3)
    lines = [f"{t!r},{z!r}" for t, z in zip(tracking.times.tolist(), tracking.values[:, 0].tolist(), strict=True)]
    return problem, tracking, ["time,range", *lines]


@pytest.mark.parametrize("name", ["ekf", "ukf", "srekf"])
def test_the_estimates_are_those_of_the_whole_run(measurements, name):
    problem, tracking, lines = measurements
    done = run("-", "--with", name, text="\n".join(lines) + "\n")
    assert done.returncode == 0
    rows = np.array([[float(v) for v in line.split(",")] for line in done.stdout.splitlines()[1:]])
    whole = parse(name).estimate(problem, tracking)
    np.testing.assert_array_equal(rows[:, 0], tracking.times)
    np.testing.assert_array_equal(rows[:, 1:5], whole.mean)
    assert "100 measurements taken" in done.stderr


def test_each_estimate_is_there_before_the_next_measurement_comes(measurements):
    _, _, lines = measurements
    with subprocess.Popen(
        [*FOLLOW, "-", "--json"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as tool:
        tool.stdin.write(lines[0] + "\n")
        for line in lines[1:4]:
            tool.stdin.write(line + "\n")
            tool.stdin.flush()
            answer = json.loads(tool.stdout.readline())  # would block for ever if it were held back
            assert answer["time"] == float(line.split(",")[0])
            assert len(answer["mean"]) == len(answer["sigma"]) == 4
        tool.stdin.close()
        assert tool.stdout.read() == ""
        assert tool.wait(timeout=HANGS) == 0


def test_bad_lines_are_reported_and_skipped(measurements):
    problem, tracking, lines = measurements
    bad = [*lines[:3], "nonsense", "0.15,inf", "# a remark", "", "0.17", *lines[3:], "0.05,11.0"]
    done = run("-", text="\n".join(bad) + "\n")
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    for expected in ("line 4", "line 5", "line 8", f"line {len(bad)}: time 0.05 s is before", "4 lines skipped"):
        assert expected in done.stderr
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert [float(v) for v in done.stdout.splitlines()[-1].split(",")][1:5] == whole.mean[-1].tolist()


@pytest.mark.parametrize(
    ("arguments", "text", "message"),
    [
        (("-",), "", "there are no measurements"),
        (("-",), "time,rang\n0,1\n", "did you mean 'range'"),
        (("nowhere.csv",), "", "nowhere.csv"),
        (("-", "--with", "graph"), "time,range\n", "goes forward"),
        (("-", "--with", "ekf", "--with", "window:3"), "time,range\n", "one estimator"),
    ],
)
def test_what_cannot_be_followed_is_one_clear_line(arguments, text, message):
    done = run(*arguments, text=text)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not done.stdout


def test_a_checkpoint_of_something_else_is_refused(measurements, tmp_path):
    _, _, lines = measurements
    text = "\n".join(lines) + "\n"
    state = tmp_path / "state.npz"
    assert run("-", "--checkpoint", state, text=text).returncode == 0
    other = run("-", "--with", "window:5", "--checkpoint", state, text=text)
    assert other.returncode == 2
    assert "another problem or estimator" in other.stderr
    state.write_bytes(state.read_bytes()[:100])
    damaged = run("-", "--checkpoint", state, text=text)
    assert damaged.returncode == 2
    assert "Traceback" not in damaged.stderr


@pytest.mark.parametrize(
    ("estimator", "key", "change", "words"),
    [
        ("ekf", "session_mean", lambda a: np.where(np.arange(4) == 2, np.nan, a), "'mean' is nan at 2; it must be finite"),
        ("ekf", "session_x_pred", lambda a: a[:3], "'x_pred' has shape (3,); this problem needs (4,)"),
        ("ekf", "session_covariance", lambda a: a + 9.0 * np.eye(4, k=1), "'covariance' is not symmetric: (x, y) is "),
        ("ekf", "session_base_covariance", lambda a: -a, "'base_covariance' is not positive semidefinite: the variance of "),
        ("window:5", "session_station", lambda a: a + 7, "'station' is 7 at 0; it must be a whole number from 0 to 0"),
        ("window:5", "session_x", lambda a: a * np.inf, "'x' is "),
        ("ukf", "session_clock", lambda a: a[::-1], "'clock' has an epoch at "),
        ("ekf", "progress_lines", lambda a: np.nan, "progress 'lines' is nan; it must be a whole number, not below zero"),
        ("ekf", "progress_written", lambda a: [1, 2], "progress 'written' is an array of shape (2,)"),
        ("ekf", "progress_opening", lambda a: a[:7], "progress 'opening' has shape (7,) and type uint8; it is no digest"),
    ],
)
def test_a_checkpoint_that_was_changed_is_one_clear_line(measurements, tmp_path, estimator, key, change, words):
    _, _, lines = measurements
    text, state, out = "\n".join(lines[:30]) + "\n", tmp_path / "state.npz", tmp_path / "out.csv"
    command = ("-", "--with", estimator, "--checkpoint", state, "-o", out)
    assert run(*command, text=text).returncode == 0
    with np.load(state) as archive:
        arrays = dict(archive)
    np.savez(state, **arrays | {key: change(arrays[key])})
    before = state.read_bytes(), out.read_bytes()
    done = run(*command, text=text)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith(f"piazzi: {state}: the checkpoint's {words}")
    assert (state.read_bytes(), out.read_bytes()) == before


def test_a_stream_that_goes_on_is_taken_whole(measurements, tmp_path):
    """The first half, then the second half as a stream of its own: what a restarted sensor sends."""
    problem, tracking, lines = measurements
    state, first, second = tmp_path / "state.npz", lines[:51], [lines[0], *lines[51:]]
    assert run("-", "--checkpoint", state, text="\n".join(first) + "\n").returncode == 0
    done = run("-", "--checkpoint", state, text="\n".join(second) + "\n")
    whole = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    assert [float(v) for v in done.stdout.splitlines()[-1].split(",")][1:5] == whole.mean[-1].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["ekf", "window:8", "ukf"])
def test_killed_at_random_moments_it_resumes_to_the_same_bytes(measurements, tmp_path, estimator):
    """SIGKILL ten times for each estimator, each at a random moment after its first new estimate."""
    problem, _, _ = measurements
    tracking = pz.simulate(problem, np.arange(4000) * 0.1, np.random.default_rng(5))
    pairs = zip(tracking.times.tolist(), tracking.values[:, 0].tolist(), strict=True)
    lines = ["time,range", *(f"{t!r},{z!r}" for t, z in pairs)]
    rows, whole, out, state = (tmp_path / name for name in ("rows.csv", "whole.csv", "out.csv", "state.npz"))
    rows.write_text("\n".join(lines) + "\n")
    settings = ["--with", estimator]
    assert run(rows, *settings, "-o", whole).returncode == 0
    moments, sizes = random.Random(7), [0]
    for turn in range(10):
        command = [*FOLLOW, "-", *settings, "-o", str(out), "--checkpoint", str(state)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0) as tool:
            # Each time 390 lines more than the last, then silence: how far it comes is not a matter of speed
            feeder = threading.Thread(target=trickle, args=(tool.stdin, lines[: 390 * (turn + 1)]), daemon=True)
            feeder.start()
            until(lambda: out.exists() and out.stat().st_size > sizes[-1], tool)
            time.sleep(moments.uniform(0.0, 0.25))
            tool.kill()
            feeder.join()
        assert tool.returncode == -signal.SIGKILL  # it was still there
        sizes.append(out.stat().st_size)
    assert sizes[1] > 0
    assert sizes[-1] < whole.stat().st_size
    assert run(rows, *settings, "-o", out, "--checkpoint", state).returncode == 0
    assert out.read_bytes() == whole.read_bytes()


def trickle(stream, lines):
    """A sensor that sends a line a millisecond, whoever listens, and then keeps silent."""
    try:
        for line in lines:
            stream.write(line.encode() + b"\n")
            time.sleep(0.001)
    except OSError:
        pass
