"""Studies on Dask: the same bits, and plain words for what is wrong with a cluster."""

import contextlib
import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess
import sys

import pytest

import piazzi
from piazzi.study import cluster as cluster_module
from piazzi.study import run_study, same_results
from piazzi.study.cluster import CONNECT_SECONDS, Cluster
from piazzi.study.pieces import run_task
from piazzi.study.tasks import Task
from tests.study.studies import small
from tests.waiting import HANGS, until

pytest.importorskip("distributed", reason="Dask is not installed")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    study = small(runs=60)
    path = tmp_path_factory.mktemp("whole") / "study.nc"
    run_study(study, path, workers=0)
    return study, path


@contextlib.contextmanager
def cluster(folder, workers=2, environment=None):
    """A scheduler on the loopback, at a port that it finds itself, and workers, as programs of their own."""
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": {**os.environ, **(environment or {})}}
    command = [sys.executable, "-W", "ignore", "-m"]
    place = ["--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file), "--no-dashboard"]
    started = [subprocess.Popen([*command, "distributed.cli.dask_scheduler", *place], **quiet)]
    try:
        until(lambda: _address(file), started[0])
        worker = [*command, "distributed.cli.dask_worker", _address(file), "--nthreads", "1", "--no-dashboard"]
        started += [subprocess.Popen(worker, **quiet) for _ in range(workers)]
        yield _address(file), started
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


def _address(file):
    """Where the scheduler listens, once it has written all of its file."""
    with contextlib.suppress(OSError, ValueError):
        return json.loads(file.read_text())["address"]
    return ""


def study_program(*arguments):
    return [sys.executable, "-m", "piazzi", "study", "b612-range", "--with", "ekf", "--with", "window:10", *map(str, arguments)]


def refused(address, folder):
    """What a program that cannot begin says last, and the seconds that its processor was busy."""
    command = study_program("--runs", 5, "--scheduler", address, "-o", folder / "s.nc")
    before = processor_seconds_of_programs()
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANGS, check=False)
    busy = processor_seconds_of_programs() - before
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    return done.stderr.splitlines()[-1], busy


def processor_seconds_of_programs():
    """Of those that this process started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextlib.contextmanager
def dead_addresses():
    """One where nobody listens, and one where somebody does and never says a word."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        yield "tcp://127.0.0.1:1", f"tcp://127.0.0.1:{mute.getsockname()[1]}"


def test_dead_addresses_fail_within_ten_seconds(tmp_path):
    """Five of them to wait, as the next test has it; the others for the imports, as one that makes no sense."""
    assert CONNECT_SECONDS <= 5
    last, imports = refused("nonsense", tmp_path)
    assert "no address of a scheduler" in last
    with dead_addresses() as addresses:
        for address in addresses:
            last, busy = refused(address, tmp_path)
            assert re.fullmatch(rf"piazzi: no Dask scheduler answers at {address} \(tried for \d+ s\)", last)
            assert busy < 3 * imports or refused(address, tmp_path)[1] < 3 * imports  # a clock may jump, once
    assert os.listdir(tmp_path) == []


def test_dead_addresses_are_tried_once_and_for_so_long(tmp_path, monkeypatch):
    """Every time-out that Dask is handed before the study gives up."""
    from distributed import comm

    connect, handed = comm.connect, []

    def connect_and_note(address, timeout=None, **others):
        handed.append((address, timeout))
        return connect(address, timeout=timeout, **others)

    monkeypatch.setattr(comm, "connect", connect_and_note)
    with dead_addresses() as addresses:
        for address in addresses:
            with pytest.raises(ConnectionError, match="no Dask scheduler answers"):
                run_study(small(), tmp_path / "s.nc", scheduler=address)
    assert handed == [(address, CONNECT_SECONDS) for address in addresses]
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("address", ["nonsense", "foo://bar:1", ""])
def test_addresses_that_are_none(tmp_path, address):
    with pytest.raises(ValueError, match="no address of a scheduler, such as tcp://host:8786"):
        run_study(small(), tmp_path / "s.nc", scheduler=address)
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_same_bits_through_a_real_cluster(whole, tmp_path):
    study, expected = whole
    with cluster(tmp_path) as (address, _):
        run_study(study, tmp_path / "s.nc", scheduler=address, chunk=7)
    assert same_results(expected, tmp_path / "s.nc") == []


@pytest.mark.slow
def test_same_bits_through_a_cluster_started_here(tmp_path):
    runs = ["--runs", 40, "--chunk", 9]
    for name, where in (("a", ["--workers", 1]), ("b", ["--scheduler", "local", "--workers", 2])):
        done = subprocess.run([*study_program(*runs, *where, "-o", tmp_path / f"{name}.nc")], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert same_results(tmp_path / "a.nc", tmp_path / "b.nc") == []


KILLING = """
import os, signal, sys
from piazzi.cli.main import main
from piazzi.study.log import Log

worker, scheduler, *arguments = sys.argv[1:]
victims, append, kept = {8: int(worker), 16: int(scheduler)}, Log.append, []

def append_and_kill(log, piece):
    append(log, piece)
    kept.append(piece.task)
    if len(kept) in victims:
        os.kill(victims[len(kept)], signal.SIGKILL)

Log.append = append_and_kill
sys.exit(main(arguments))
"""


@pytest.mark.slow
def test_killed_worker_and_killed_scheduler(tmp_path):
    """A worker killed in the middle costs nothing; the scheduler, a clear error and a store that goes on.

    The program that runs the study kills them itself, each after so many of its 31 tasks, of which three are out at a time.
    """
    program = study_program("--runs", 600, "--chunk", 20)
    whole = subprocess.run([*program, "-o", tmp_path / "whole.nc"], capture_output=True, text=True)
    assert whole.returncode == 0, whole.stderr
    path = tmp_path / "s.nc"
    with cluster(tmp_path, workers=3) as (address, (scheduler, worker, *_)):
        killing = [sys.executable, "-c", KILLING, str(worker.pid), str(scheduler.pid), *program[3:]]
        done = subprocess.run(
            [*killing, "--scheduler", address, "-o", path, "--resume"], capture_output=True, text=True, timeout=HANGS
        )
        assert [process.wait(HANGS) for process in (worker, scheduler)] == [-signal.SIGKILL] * 2
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert f"the scheduler at {address} is gone" in done.stderr.splitlines()[-1]
    assert re.search(r"\d+ of 600 runs are kept beside", done.stderr)
    assert "distributed" not in done.stderr
    again = subprocess.run([*program, "-o", path, "--resume"], capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert same_results(tmp_path / "whole.nc", path) == []


@pytest.mark.slow
@pytest.mark.parametrize("when", ["between tasks", "while a task runs", "before workers are asked"])
def test_stalled_scheduler_is_given_up(tmp_path, when, monkeypatch):
    """It is stopped, as one is that a network swallows: connections are made, and nothing is ever said."""
    silence = 2.0
    with cluster(tmp_path, workers=1) as (address, (scheduler, worker)):
        if when == "before workers are asked":
            connect = cluster_module._client
            stop = lambda address: (connect(address), os.kill(scheduler.pid, signal.SIGSTOP))[0]  # noqa: E731
            monkeypatch.setattr(cluster_module, "_client", stop)
            with pytest.raises(ConnectionError, match="not answered for 2 s"):
                Cluster(small(), address, None, silence)
            os.kill(scheduler.pid, signal.SIGCONT)
            return
        team = Cluster(small(), address, None, HANGS)
        team._silence = silence  # from here on: where the machine is busy a worker may take longer to begin
        try:
            os.kill(worker.pid, signal.SIGSTOP)
            if when == "while a task runs":
                team.submit(Task(0, 0, 8))
            os.kill(scheduler.pid, signal.SIGSTOP)
            with pytest.raises(ConnectionError, match=rf"{address} has not answered for 2 s; what was finished is kept"):
                team.wait() if when == "while a task runs" else team.slots
        finally:
            team.close()
            for process in (scheduler, worker):
                os.kill(process.pid, signal.SIGCONT)


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
        until(lambda: future.status == "finished")
        (pid,) = team._client.run(os.getpid).values()
        os.kill(pid, signal.SIGKILL)
        until(lambda: future.status == "lost")
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


@pytest.mark.slow
def test_workers_of_another_version_are_named(tmp_path):
    """A worker whose piazzi has another text, with everything else the same."""
    other = tmp_path / "other"
    shutil.copytree(os.path.dirname(piazzi.__file__), other / "piazzi")
    (other / "piazzi" / "more.py").write_text("# another version\n")
    with cluster(tmp_path, workers=1, environment={"PYTHONPATH": str(other)}) as (address, _):
        command = study_program("--runs", 5, "--scheduler", address, "-o", tmp_path / "s.nc")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    version = rf"piazzi {re.escape(piazzi.__version__)} \(source"
    assert re.search(rf"worker tcp://\S+ has {version} \w+\), not \S+ \(source \w+\) as here", done.stderr), done.stderr
    assert "Traceback" not in done.stderr
