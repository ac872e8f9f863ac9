"""`piazzi estimate SCENARIO --follow`: a tracker in a pipe, that survives bad lines and being killed."""

import importlib
import json
import os
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


# ---- nothing is lost ----------------------------------------------------------------------------------------------------


@pytest.fixture
def rows(measurements, tmp_path):
    """A file of 30 measurements."""
    path = tmp_path / "rows.csv"
    path.write_text("\n".join(measurements[2][:31]) + "\n")
    return path


@pytest.fixture(params=["name", "symlink", "hard link", "other way"])
def alias(request, rows, tmp_path):
    """The same file, by another name or not."""
    other = tmp_path / "other.csv"
    if request.param == "symlink":
        other.symlink_to(rows)
    elif request.param == "hard link":
        other.hardlink_to(rows)
    else:
        (tmp_path / "folder").mkdir()
        other = rows if request.param == "name" else tmp_path / "folder" / ".." / "rows.csv"
    return other


def test_a_stream_is_not_replaced_by_its_estimates(rows, alias, call):
    before = rows.read_bytes()
    for arguments in (("-o", alias), ("--checkpoint", alias)):
        line = call("estimate", "b612-range", "--follow", rows, *arguments).refused()
        assert f"{arguments[0]} {alias} and --follow {rows} are the same file" in line
    assert rows.read_bytes() == before


def test_nor_where_it_is_piped_in_or_out(rows, tmp_path):
    before = rows.read_bytes()
    with open(rows, "rb") as stream:
        done = subprocess.run([*FOLLOW, "-", "-o", rows], stdin=stream, capture_output=True, text=True, timeout=HANGS)
    assert done.returncode == 2
    assert f"-o {rows} and standard input are the same file" in done.stderr
    with open(rows, "ab") as sink:  # it would read what it writes, without end
        done = subprocess.run([*FOLLOW, rows], stdout=sink, stderr=subprocess.PIPE, text=True, timeout=HANGS)
    assert done.returncode == 2
    assert f"standard output and --follow {rows} are the same file" in done.stderr
    assert rows.read_bytes() == before


def test_estimates_and_checkpoint_are_two_files(rows, tmp_path, call):
    out, state = tmp_path / "x.csv", tmp_path / "k.csv"
    for make in (lambda: None, lambda: out.write_text("old"), lambda: (state.unlink(missing_ok=True), state.symlink_to(out))):
        make()
        for same in {out, state if state.is_symlink() else out}:
            line = call("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", same).refused()
            assert f"-o {out} and --checkpoint {same} are the same file" in line
        assert not out.exists() or out.read_text() == "old"


def test_devices_may_be_given_twice(rows, call):
    assert call("estimate", "b612-range", "--follow", rows, "-o", "/dev/stdout").status in (0, 2)  # a pipe or a file of pytest
    assert call("estimate", "b612-range", "--follow", "/dev/null", "-o", "x.csv", "--checkpoint", "/dev/null").status == 2


def test_another_stream_leaves_estimates_and_checkpoint_alone(rows, measurements, tmp_path, call):
    """It begins as the one of the checkpoint did, and goes on otherwise: seen only where the checkpoint was made."""
    out, state, lines = tmp_path / "o.csv", tmp_path / "k.npz", measurements[2]
    command = ("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", state)
    assert call(*command).status == 0
    with open(out, "a") as file:
        file.write("written after the last checkpoint\n")
    before = out.read_bytes(), state.read_bytes()
    rows.write_text("\n".join([*lines[:5], "0.45,11.25", *lines[6:40]]) + "\n")
    assert "line 31: the stream is not the one that the checkpoint was made from" in call(*command).refused()
    assert (out.read_bytes(), state.read_bytes()) == before
    rows.write_text("nonsense\n")
    assert call(*command).status == 2
    rows.write_text("")
    assert call(*command).status == 2
    assert (out.read_bytes(), state.read_bytes()) == before


@pytest.mark.parametrize("left", [1000, 0, None])
def test_estimates_that_were_lost_are_told_and_not_padded(rows, measurements, tmp_path, call, left):
    """As after a power failure: they were written before the checkpoint, and are not there."""
    out, state = tmp_path / "o.csv", tmp_path / "k.npz"
    command = ("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", state)
    assert call(*command).status == 0
    whole = out.read_bytes()
    assert len(whole) > 1000
    if left is None:
        out.unlink()
    else:
        out.write_bytes(whole[:left])
    kept = state.read_bytes()
    line = call(*command).refused()
    assert f"{out}: it has {left or 0:,} bytes, but {len(whole):,} were written before the checkpoint was made" in line
    assert (out.read_bytes() if out.exists() else None) == (None if left is None else whole[:left])
    assert state.read_bytes() == kept
    out.write_bytes(whole)  # put back, it goes on
    rows.write_text("\n".join(measurements[2]) + "\n")
    assert call(*command).status == 0
    assert out.read_bytes().startswith(whole)
    assert out.read_bytes().count(b"\n") == 101


def test_estimates_are_on_disk_before_the_checkpoint_that_knows_of_them(rows, tmp_path, call, monkeypatch):
    """Whenever the power fails: no checkpoint is moved into place that knows of more than was synced."""
    out, state, synced = tmp_path / "o.csv", tmp_path / "k.npz", [0]
    sync, replace = os.fsync, os.replace

    def seen_sync(handle):
        sync(handle)
        if os.path.exists(out) and os.path.samestat(os.fstat(handle), out.stat()):
            synced.append(os.fstat(handle).st_size)

    def seen_replace(source, target):
        if Path(target).name == "k.npz":
            with np.load(source) as archive:
                assert int(archive["progress_written"]) == synced[-1] > 0
        replace(source, target)

    monkeypatch.setattr(os, "fsync", seen_sync)
    monkeypatch.setattr(os, "replace", seen_replace)
    assert call("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", state).status == 0
    assert synced[-1] == out.stat().st_size


def test_an_interruption_in_the_middle_of_a_line_loses_no_line(rows, measurements, tmp_path, call, monkeypatch):
    """Ctrl-C between a measurement and its estimate: the checkpoint is of before, so that the line is taken again."""
    out, state, whole = tmp_path / "o.csv", tmp_path / "k.npz", tmp_path / "whole.csv"
    assert call("estimate", "b612-range", "--follow", rows, "-o", whole).status == 0
    command = ("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", state)
    monkeypatch.setattr("piazzi.cli.follow.BETWEEN_CHECKPOINTS", 0.0)
    for place in ("piazzi.io.lines.RowReader.read", "piazzi.estimate.live.LiveFilter.update", "piazzi.cli.sink.Sink.emit"):
        for at in (3, 17):
            out.unlink(missing_ok=True)
            state.unlink(missing_ok=True)
            with monkeypatch.context() as patch:
                patch.setattr(place, interrupted_after(at, place))
                assert call(*command).status == 130
            assert call(*command).status == 0
            assert out.read_bytes() == whole.read_bytes(), (place, at)


def interrupted_after(calls, place):
    """What is called there, but for a Ctrl-C after so many calls."""
    module, kind, name = place.rsplit(".", 2)
    real, count = getattr(getattr(importlib.import_module(module), kind), name), [0]

    def call(*arguments):
        count[0] += 1
        out = real(*arguments)
        if count[0] == calls:
            raise KeyboardInterrupt
        return out

    return call


def test_a_checkpoint_after_a_remark_is_gone_on_from(rows, measurements, tmp_path, call):
    out, state, lines = tmp_path / "o.csv", tmp_path / "k.npz", measurements[2]
    command = ("estimate", "b612-range", "--follow", rows, "-o", out, "--checkpoint", state)
    rows.write_text("\n".join([*lines[:20], "# a pause", ""]) + "\n")
    assert call(*command).status == 0
    rows.write_text("\n".join([*lines[:20], "# a pause", "", *lines[20:]]) + "\n")
    assert call(*command).status == 0
    assert out.read_bytes().count(b"\n") == 101
    with np.load(state) as archive:
        assert archive["progress_lines"] == 103


# ---- nothing is silently wrong ------------------------------------------------------------------------------------------

CUBE = """
states = { x = "m" }
dynamics = { x = "x**3" }
sensors.r.components = { range = "x" }
stations = [{ name = "s", sensor = "r", noise = { sigma = 1 } }]
prior = { mean = [1], sigma = [1] }
times = { step = 0.01, count = 5 }
"""


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("estimator", ["ekf", "ukf", "srekf", "window:3"])
def test_an_estimate_that_cannot_be_used_ends_it(tmp_path, call, estimator, as_json, monkeypatch):
    """As the same lines do in a file, status 3; the last good checkpoint stays, and can be gone on from."""
    monkeypatch.setattr("piazzi.cli.follow.BETWEEN_CHECKPOINTS", 0.0)
    scenario, rows, state = tmp_path / "cube.toml", tmp_path / "rows.csv", tmp_path / "k.npz"
    scenario.write_text(CUBE)
    rows.write_text("time,range\n0,1\n0.1,1.1\n0.2,1.2\n3,4\n3.5,4\n")
    command = ("estimate", scenario, "--with", estimator, "--follow", rows, "--checkpoint", state, *["--json"] * as_json)
    done = call(*command)
    assert done.status == 3
    assert done.said == [
        "piazzi: 3 measurements taken",
        "piazzi: line 5: with s at t = 3 s, the estimate is not finite at t = 3 s (x)",
    ]
    assert "nan" not in done.out.lower()
    assert "null" not in done.out
    assert done.out.count("\n") == 4 - as_json
    with np.load(state) as archive:
        assert all(np.isfinite(archive[name]).all() for name in ("session_mean", "session_covariance"))
    kept = state.read_bytes()
    assert call(*command).status == 3  # the same lines again: the same end
    assert state.read_bytes() == kept
    rows.write_text("time,range\n0.25,1.2\n0.3,1.3\n")  # others: it goes on
    done = call(*command)
    assert (done.status, done.said) == (0, ["piazzi: 2 measurements taken"])
    assert call("estimate", rows, "--scenario", scenario, "--with", estimator).status in (0, 3)
