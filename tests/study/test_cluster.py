"""Studies on Dask: the same bits, and plain words for what is wrong with a cluster."""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time

import pytest

import piazzi
from piazzi.study import run_study, same_results
from piazzi.study.cluster import Cluster
from piazzi.study.pieces import run_task
from piazzi.study.tasks import Task
from tests.study.studies import small

pytest.importorskip("distributed", reason="Dask is not installed")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    study = small(runs=60)
    path = tmp_path_factory.mktemp("whole") / "study.nc"
    run_study(study, path, workers=0)
    return study, path


@contextlib.contextmanager
def cluster(workers=2, environment=None):
    """A scheduler on the loopback, and workers, as programs of their own."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    command = [sys.executable, "-W", "ignore", "-m", "distributed.cli"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": {**os.environ, **(environment or {})}}
    scheduler = [*command[:-1], "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2]]
    started = [subprocess.Popen([*scheduler, "--no-dashboard"], **quiet)]
    worker = [*command[:-1], "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    try:
        _until_it_listens(address)
        started += [subprocess.Popen(worker, **quiet) for _ in range(workers)]
        yield address, started
    finally:
        for process in started:
            with contextlib.suppress(OSError):
                process.terminate()
        for process in started:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _until_it_listens(address):
    host, port = address.removeprefix("tcp://").split(":")
    for _ in range(600):
        with contextlib.suppress(OSError), socket.create_connection((host, int(port)), timeout=1):
            return
        time.sleep(0.1)
    raise AssertionError(f"nothing listens at {address}")


def study_program(*arguments):
    return [sys.executable, "-m", "piazzi", "study", "b612-range", "--with", "ekf", "--with", "window:10", *map(str, arguments)]


def test_dead_addresses_fail_within_ten_seconds(tmp_path):
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        for address in ("tcp://127.0.0.1:1", f"tcp://127.0.0.1:{mute.getsockname()[1]}"):
            started = time.monotonic()
            command = study_program("--runs", 5, "--scheduler", address, "-o", tmp_path / "s.nc")
            done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
            assert time.monotonic() - started < 10 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
            assert done.returncode == 2
            last = done.stderr.splitlines()[-1]
            assert re.fullmatch(rf"piazzi: no Dask scheduler answers at {address} \(tried for \d s\)", last)
            assert "Traceback" not in done.stderr
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("address", ["nonsense", "foo://bar:1", ""])
def test_addresses_that_are_none(tmp_path, address):
    with pytest.raises(ValueError, match="no address of a scheduler, such as tcp://host:8786"):
        run_study(small(), tmp_path / "s.nc", scheduler=address)
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_same_bits_through_a_real_cluster(whole, tmp_path):
    study, expected = whole
    with cluster() as (address, _):
        run_study(study, tmp_path / "s.nc", scheduler=address, chunk=7)
    assert same_results(expected, tmp_path / "s.nc") == []


@pytest.mark.slow
def test_same_bits_through_a_cluster_started_here(tmp_path):
    runs = ["--runs", 40, "--chunk", 9]
    for name, where in (("a", ["--workers", 1]), ("b", ["--scheduler", "local", "--workers", 2])):
        done = subprocess.run([*study_program(*runs, *where, "-o", tmp_path / f"{name}.nc")], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert same_results(tmp_path / "a.nc", tmp_path / "b.nc") == []


@pytest.mark.slow
def test_killed_worker_and_killed_scheduler(tmp_path):
    """A worker killed in the middle costs nothing; the scheduler, a clear error and a store that goes on."""
    runs = ["--runs", 1500]
    whole = subprocess.run(study_program(*runs, "-o", tmp_path / "whole.nc"), capture_output=True, text=True)
    assert whole.returncode == 0, whole.stderr
    path = tmp_path / "s.nc"
    with cluster(workers=3) as (address, started):
        command = [*study_program(*runs, "--chunk", 40, "--scheduler", address, "-o", path, "--resume")]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        beside = tmp_path / "s.nc.runs"
        _until(lambda: beside.exists() and beside.stat().st_size > 200_000, process)
        started[1].send_signal(signal.SIGKILL)
        size = beside.stat().st_size
        _until(lambda: beside.stat().st_size > size + 200_000, process)
        started[0].send_signal(signal.SIGKILL)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 2, err
    assert out == ""
    assert f"the scheduler at {address} is gone" in err.splitlines()[-1]
    assert re.search(r"[\d,]+ of 1,500 runs are kept beside", err)
    again = subprocess.run(study_program(*runs, "-o", path, "--resume"), capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert same_results(tmp_path / "whole.nc", path) == []


@pytest.mark.parametrize("losses", [1, 0])
def test_results_that_a_worker_took_with_it_are_made_again(monkeypatch, losses):
    """The worker that finished a task is killed before its results are fetched: another one makes the same bits."""
    monkeypatch.setattr("piazzi.study.cluster.LOSSES", losses)
    study, task = small(estimators=("ekf",)), Task(0, 0, 8)
    expected = run_task(study, task).arrays  # first: by then, every kernel is compiled
    team = Cluster(study, "local", 1)
    try:
        team.submit(task)
        ((future, _),) = team._futures.values()
        _wait_for(lambda: future.status == "finished")
        (pid,) = team._client.run(os.getpid).values()
        os.kill(pid, signal.SIGKILL)
        _wait_for(lambda: future.status == "lost")
        (outcome,) = team.wait()
    finally:
        team.close()
    assert outcome.task == task
    assert outcome.error == ""
    if not losses:
        assert outcome.died == "lost before its results were fetched"
        return
    assert outcome.died == ""
    assert expected.keys() == outcome.piece.arrays.keys()
    for name in expected.keys() - {"seconds"}:
        assert expected[name].tobytes() == outcome.piece.arrays[name].tobytes(), name


def _wait_for(condition):
    for _ in range(1200):
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("waited for nothing")


def _until(condition, process):
    for _ in range(1200):
        if condition():
            return
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    raise AssertionError("waited for nothing")


@pytest.mark.slow
def test_workers_of_another_version_are_named(tmp_path):
    """A worker whose piazzi has another text, with everything else the same."""
    other = tmp_path / "other"
    shutil.copytree(os.path.dirname(piazzi.__file__), other / "piazzi")
    (other / "piazzi" / "more.py").write_text("# another version\n")
    with cluster(workers=1, environment={"PYTHONPATH": str(other)}) as (address, _):
        command = study_program("--runs", 5, "--scheduler", address, "-o", tmp_path / "s.nc")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    version = rf"piazzi {re.escape(piazzi.__version__)} \(source"
    assert re.search(rf"worker tcp://\S+ has {version} \w+\), not \S+ \(source \w+\) as here", done.stderr), done.stderr
    assert "Traceback" not in done.stderr
