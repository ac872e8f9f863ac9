"""Whole studies in processes: the same bits however they are run, interrupted and continued."""

import contextlib
import os
import re
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from piazzi.present.study_table import failures
from piazzi.study import execute, pieces, pool, read_store, run_study, same_results, versions
from piazzi.study.log import Log
from piazzi.study.pool import Processes
from piazzi.study.runner import RETRIES
from piazzi.study.runs import simulated
from piazzi.study.tasks import Piece, Task
from piazzi.study.versions import fingerprint
from tests.study.estimators import Poison, Refusing
from tests.study.studies import small
from tests.waiting import HANGS, until

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study, and its store made in this process."""
    study = small(runs=60, vary={"R.scale": [1, 4]})
    path = tmp_path_factory.mktemp("whole") / "study.nc"
    run_study(study, path, workers=0, chunk=60)
    return study, path


@pytest.mark.parametrize(("workers", "chunk"), [(0, 7), (1, None), (2, None), (2, 1)])
def test_same_bits_with_any_workers_and_chunks(whole, tmp_path, workers, chunk):
    study, expected = whole
    run_study(study, tmp_path / "s.nc", workers=workers, chunk=chunk)
    assert same_results(expected, tmp_path / "s.nc") == []
    assert os.listdir(tmp_path) == ["s.nc"]


def test_comparison_of_stores_sees_a_changed_bit(whole, tmp_path):
    _, expected = whole
    run_study(small(runs=60, vary={"R.scale": [1, 4]}, seed=1), tmp_path / "s.nc", workers=0)
    differ = same_results(expected, tmp_path / "s.nc")
    assert {"rmse", "error", "nees", "bound", "about"} <= set(differ)
    assert "seconds" not in differ


def test_interrupted_and_resumed_is_the_same_and_computes_nothing_twice(whole, tmp_path, monkeypatch):
    study, expected = whole
    path, done = tmp_path / "s.nc", []

    def stop(finished, total):
        if finished >= 40:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(study, path, workers=0, chunk=8, progress=stop)
    assert not path.exists()
    from piazzi.study import kept_runs, pieces, pool

    assert kept_runs(path) == 40
    monkeypatch.setattr(pool, "run_task", lambda s, task: done.append(task) or pieces.run_task(s, task))
    run_study(study, path, workers=0, chunk=11, resume=True)
    assert same_results(expected, path) == []
    assert sum(task.count for task in done) == 120 - 40
    done.clear()
    run_study(study, path, workers=0, resume=True)
    assert done == []


def _counted(monkeypatch):
    """Tasks of studies that are computed in this process from now on."""
    done = []
    monkeypatch.setattr(pool, "run_task", lambda s, task: done.append(task) or pieces.run_task(s, task))
    return done


def test_a_finished_study_is_extended_without_computing_a_run_again(whole, tmp_path, monkeypatch):
    """Extended to 80 runs it has the bits of one of 80, and only the 20 that were missing are computed."""
    _, sixty = whole
    eighty = small(runs=80, vary={"R.scale": [1, 4]})
    run_study(eighty, tmp_path / "anew.nc", workers=0)
    path = tmp_path / "s.nc"
    path.write_bytes(sixty.read_bytes())
    done = _counted(monkeypatch)
    stored = run_study(eighty, path, workers=0, resume=True)
    assert same_results(path, tmp_path / "anew.nc") == []
    assert sum(task.count for task in done) == 2 * 20
    assert all(task.first >= 60 for task in done if task.count)
    before = read_store(sixty)
    for point in (0, 1):
        np.testing.assert_array_equal(stored.row(point, 0).error[:60], before.row(point, 0).error)
        np.testing.assert_array_equal(stored.row(point, 0).numbers["seconds"][:60], before.row(point, 0).numbers["seconds"])
    assert sorted(os.listdir(tmp_path)) == ["anew.nc", "s.nc"]


def test_an_interrupted_study_and_an_interrupted_extension_are_extended(whole, tmp_path, monkeypatch):
    study, sixty = whole
    eighty = small(runs=80, vary={"R.scale": [1, 4]})
    run_study(eighty, tmp_path / "anew.nc", workers=0)
    path = tmp_path / "s.nc"
    with pytest.raises(KeyboardInterrupt):
        run_study(study, path, workers=0, chunk=8, progress=_interrupt_after(40))
    done = _counted(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        run_study(eighty, path, workers=0, chunk=8, progress=_interrupt_after(100), resume=True)
    run_study(eighty, path, workers=0, resume=True)
    assert same_results(path, tmp_path / "anew.nc") == []
    assert sum(task.count for task in done) == 160 - 40

    path.write_bytes(sixty.read_bytes())
    with pytest.raises(KeyboardInterrupt):
        run_study(eighty, path, workers=0, chunk=8, progress=_interrupt_after(136), resume=True)
    assert run_study(study, path, workers=0, resume=True).about["specification"]["runs"] == 60  # which leaves the rest
    done.clear()
    run_study(eighty, path, workers=0, resume=True)
    assert same_results(path, tmp_path / "anew.nc") == []
    assert sum(task.count for task in done) == 160 - 136


def test_runs_of_another_version_are_not_added_to(whole, tmp_path, monkeypatch):
    path = tmp_path / "s.nc"
    path.write_bytes(whole[1].read_bytes())
    eighty = small(runs=80, vary={"R.scale": [1, 4]})
    changed = {**fingerprint(), "numba": "0.1"}
    monkeypatch.setattr("piazzi.study.extending.fingerprint", lambda: changed)
    with pytest.raises(ValueError, match=r"was made by numba .*, not 0\.1 as here: more runs would not be of the same study"):
        run_study(eighty, path, workers=0, resume=True)
    assert run_study(whole[0], path, workers=0, resume=True).about["specification"]["runs"] == 60


def test_runs_that_failed_keep_their_reasons_when_a_study_is_extended(tmp_path):
    path = tmp_path / "s.nc"
    first = simulated(small(runs=30), Task(0, 0, 30)).z[:, 0, 0]
    limit = float(np.sort(first)[-10])
    refusing = {"ekf": "ekf", "refusing": Refusing(limit)}
    run_study(small(runs=20, estimators=refusing), path, workers=0)
    stored = run_study(small(runs=30, estimators=refusing), path, workers=0, resume=True)
    expected = [[run, f"first measurement {first[run]:.3g} is too large"] for run in np.flatnonzero(first > limit).tolist()]
    assert 0 < sum(run < 20 for run, _ in expected) < len(expected)
    assert [m[2:] for m in stored.about["messages"]] == expected


def test_other_studies_stores_are_refused(whole, tmp_path):
    study, expected = whole
    fewer = small(runs=59, vary={"R.scale": [1, 4]})
    for resume in (False, True):
        with pytest.raises(ValueError, match="holds another study: runs is 60 there and 59 here"):
            run_study(fewer, expected, workers=0, resume=resume)
    with pytest.raises(ValueError, match="holds 60 runs of this study: --resume adds the 1 that are missing"):
        run_study(small(runs=61, vary={"R.scale": [1, 4]}), expected, workers=0)
    with pytest.raises(ValueError, match="holds this study, finished: --resume shows it"):
        run_study(study, expected, workers=0)
    with pytest.raises(KeyboardInterrupt):
        run_study(study, tmp_path / "s.nc", workers=0, chunk=8, progress=_interrupt_after(8))
    with pytest.raises(ValueError, match="was not finished: --resume continues it"):
        run_study(study, tmp_path / "s.nc", workers=0)
    with pytest.raises(ValueError, match="has runs of another study: seed is 0 there and 5 here"):
        run_study(small(runs=60, vary={"R.scale": [1, 4]}, seed=5), tmp_path / "s.nc", workers=0, resume=True)
    with pytest.raises(ValueError, match="its problem is not the same"):
        changed = small(
            runs=60,
            vary={"R.scale": [1, 4]},
            problem=study.problem.__class__(**_fields(study.problem, name="x", prior_time=-1.0)),
        )
        run_study(changed, expected, workers=0, resume=True)


def _fields(problem, **changes):
    from dataclasses import fields

    return {f.name: getattr(problem, f.name) for f in fields(problem)} | changes


def _interrupt_after(count):
    def stop(finished, total):
        if finished >= count:
            raise KeyboardInterrupt

    return stop


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_told_before_anything_runs(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError):
        run_study(small(), tmp_path / "s.nc", workers=0)
    tmp_path.chmod(0o700)


@pytest.mark.parametrize(("path", "message"), [("s.txt", "kept in a .nc file"), ("no/s.nc", "no folder")])
def test_places_that_make_no_sense(tmp_path, path, message):
    with pytest.raises((ValueError, OSError), match=message):
        run_study(small(), tmp_path / path, workers=0)


def test_a_poisoned_run_is_reported_and_the_others_are_all_there(tmp_path):
    plain = small(runs=30, estimators=("ekf",))
    first = float(simulated(plain, Task(0, 13, 1)).z[0, 0, 0])
    study = small(runs=30, estimators={"ekf": "ekf", "poison": Poison(first)})
    stored = run_study(study, tmp_path / "s.nc", workers=2, chunk=10)
    assert [m[2:] for m in stored.about["messages"]] == [[13, "killed its worker (SIGKILL), 3 times"]] * 2
    for row in (0, 1):
        success = stored.row(0, row).success
        assert not success[13]
        assert success.sum() == 29
    reference = run_study(plain, tmp_path / "plain.nc", workers=0).row(0, 0)
    others = np.arange(30) != 13
    np.testing.assert_array_equal(stored.row(0, 0).error[others], reference.error[others])


def test_a_study_that_workers_cannot_read_ends_at_once(tmp_path):
    script = tmp_path / "own.py"
    script.write_text(
        "from dataclasses import dataclass\nimport numpy as np, piazzi as pz\nfrom tests.study.studies import small\n"
        "@dataclass(frozen=True)\nclass Mine:\n    def estimate(self, problem, tracking):\n        return None\n"
        "try:\n    small(estimators={'mine': Mine()}).run('s.nc', workers=1)\n"
        "except RuntimeError as error:\n    print(error)\n"
    )
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=HANGS)
    assert re.fullmatch("a worker cannot read the study: AttributeError.*Mine.*\n", done.stdout), done
    assert os.listdir(tmp_path) == ["own.py"]


@pytest.mark.slow
def test_a_worker_killed_from_outside_takes_nothing_along(whole, tmp_path, monkeypatch):
    """Five times, at moments from the start of a task to after its end; none is hit so often that it counts as the cause."""
    study, expected = whole
    deaths, moments, lock = Counter(), [0.0, 0.05, 0.2, 0.5, 1.0], threading.Lock()
    original = Processes._run

    def run_and_kill(self, process, task):
        with lock:
            moment = moments.pop() if moments and deaths[task] < RETRIES else None
            deaths[task] += moment is not None
        if moment is None:
            return original(self, process, task)
        timer = threading.Timer(moment, process.kill)
        timer.start()
        outcome = original(self, process, task)
        timer.join()
        process.wait()
        return outcome

    monkeypatch.setattr(Processes, "_run", run_and_kill)
    stored = run_study(study, tmp_path / "s.nc", workers=2, chunk=6)
    assert deaths.total() == 5
    assert (stored.about["messages"], stored.about["bounds_unknown"]) == ([], [])
    assert same_results(expected, tmp_path / "s.nc") == []


def test_a_bound_that_cannot_be_computed_is_told(tmp_path, monkeypatch):
    def refuse(study, task):
        if (task.point, task.count) == (1, 0):
            raise ArithmeticError("no bound today")
        return pieces.run_task(study, task)

    monkeypatch.setattr(pool, "run_task", refuse)
    stored = run_study(small(vary={"R.scale": [1, 4]}), tmp_path / "s.nc", workers=0)
    message = "ArithmeticError: no bound today, 3 times"
    assert stored.summary.to_dict()["bounds_unknown"] == [{"point": 1, "message": message}]
    assert failures(stored.summary) == [f"Cramer-Rao bound (R.scale = 4): {message}"]
    assert [line.over_bound["position"] is None for line in stored.summary.lines[:: len(stored.rows)]] == [False, True]
    assert np.isfinite(stored.row(1, 0).error).all()


@pytest.mark.parametrize(("points", "rest"), [(5, []), (7, ["... and 2 more Cramer-Rao bounds"])])
def test_bounds_beyond_the_first_five_are_counted(tmp_path, monkeypatch, points, rest):
    def refuse(study, task):
        if task.count == 0:
            raise ArithmeticError("no bound today")
        return pieces.run_task(study, task)

    monkeypatch.setattr(pool, "run_task", refuse)
    study = small(runs=2, estimators=("ekf",), vary={"R.scale": list(range(1, points + 1))})
    told = failures(run_study(study, tmp_path / "s.nc", workers=0).summary)
    assert [line.partition(":")[0] for line in told[:5]] == [f"Cramer-Rao bound (R.scale = {i})" for i in range(1, 6)]
    assert told[5:] == rest


def test_runs_of_other_versions_are_not_gone_on_with(tmp_path, monkeypatch):
    """Their bits would differ, and nothing would show it."""
    study, path = small(runs=20), tmp_path / "s.nc"
    other = versions.fingerprint() | {"numpy": "1.0"}
    monkeypatch.setattr(execute, "fingerprint", lambda: other)
    log = execute._log(study, path.with_name("s.nc.runs"), False)
    log.close()
    monkeypatch.undo()
    with pytest.raises(ValueError, match=r"was begun by numpy 1.0, not .* as here: results would not be the same"):
        run_study(study, path, workers=0, resume=True)


@pytest.mark.slow
def test_killed_at_ten_random_moments_and_resumed(tmp_path):
    """SIGKILL of the main process, ten times in one study, at moments from its start to its end."""
    arguments = ["study", "b612-range", "--runs", "1200", "--with", "ekf", "--with", "window:10", "--workers", "1"]
    command = [sys.executable, "-m", "piazzi", *arguments]
    started = time.monotonic()
    subprocess.run([*command, "-o", tmp_path / "whole.nc"], check=True, capture_output=True)
    seconds = time.monotonic() - started
    rng, deaths = np.random.default_rng(0), 0
    while deaths < 10:
        process = subprocess.Popen(
            [*command, "-o", tmp_path / "s.nc", "--resume", "--chunk", "25"],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        try:
            process.wait(rng.uniform(0.02, 0.5) * seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            deaths += 1
        if process.wait() == 0:
            os.unlink(tmp_path / "s.nc")  # it was through: again
    last = subprocess.run([*command, "-o", tmp_path / "s.nc", "--resume"], check=False, capture_output=True, text=True)
    assert last.returncode == 0, last.stderr
    assert same_results(tmp_path / "whole.nc", tmp_path / "s.nc") == []
    assert sorted(os.listdir(tmp_path)) == ["s.nc", "whole.nc"]
    assert read_store(tmp_path / "s.nc").row(0, 0).success.all()


@pytest.mark.slow
def test_workers_end_with_the_process_that_started_them(tmp_path):
    command = [sys.executable, "-m", "piazzi", "study", "b612-range", "--runs", "100000", "--with", "graph", "--workers", "2"]
    process = subprocess.Popen([*command, "-o", tmp_path / "s.nc"], stderr=subprocess.DEVNULL)
    try:
        until(lambda: len(_descendants(process.pid)) >= 2, process)
        found = _descendants(process.pid)
    finally:
        process.kill()
        process.wait()
    until(lambda: not any(_alive(pid) for pid in found))


def _descendants(pid):
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):  # a thread that has just ended
            found += map(int, (task / "children").read_text().split())
    return found


def _alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(
    "task", [(0, int(8e100), 4), (0, 0, 10**30), (7, 0, 4), (0, 58, 4), (0, -4, 4), (0.0, 0, 4), ("0", 0, 4)]
)
def test_runs_that_are_none_of_the_study_are_run_again(whole, tmp_path, task):
    """Whatever a log says with a sound checksum: a first run of 8e100 made a study of twelve go on for ever."""
    study, expected = whole
    path = tmp_path / "s.nc"
    assert (study.points, study.runs) == (2, 60)
    log = Log.create(tmp_path / "s.nc.runs", study.specification | {"versions": fingerprint()})
    log.append(Piece(Task(*task), {"nonsense": np.zeros((1, 4))}))
    log.close()
    with pytest.warns(UserWarning, match="1 record damaged; 0 runs are whole"):
        run_study(study, path, workers=0, resume=True)
    assert same_results(expected, path) == []


def _without(name):
    return lambda p: Piece(p.task, {n: a for n, a in p.arrays.items() if n != name}, p.messages)


def _array(name, change):
    return lambda p: Piece(p.task, p.arrays | {name: change(p.arrays[name])}, p.messages)


@pytest.mark.parametrize(
    ("count", "change"),
    [
        (8, _without("rmse")),
        (8, _array("rmse", lambda a: a[:, :5])),
        (8, _array("rmse", lambda a: a[..., :-1])),
        (8, _array("rmse", lambda a: a.astype(np.float32))),
        (8, _array("success", lambda a: a.astype(bool))),
        (8, lambda p: Piece(p.task, p.arrays, ((99, 3, "of no row"),))),
        (8, lambda p: Piece(Task(0, 0, 7), p.arrays)),
        (8, lambda p: Piece(Task(0, 0, 0), p.arrays)),
        (0, lambda p: Piece(Task(0, 0, 8), p.arrays)),
        (0, _array("bound", lambda a: a[:, 1:])),
    ],
)
def test_pieces_that_the_study_does_not_keep_are_computed_again(whole, tmp_path, count, change):
    """They were found when the store was written, after everything else was computed, and each --resume ended there."""
    study, expected = whole
    path, two = tmp_path / "s.nc", [pieces.run_task(study, Task(0, first, 8)) for first in (0, 8)]
    if not count:
        two[0] = pieces.run_task(study, Task(0, 0, 0))
    log = Log.create(tmp_path / "s.nc.runs", study.specification | {"versions": fingerprint()})
    log.append(change(two[0]))
    log.append(two[1])
    log.close()
    with pytest.warns(UserWarning, match="1 record damaged; 8 runs are whole, the others are computed again"):
        run_study(study, path, workers=0, resume=True)
    assert same_results(expected, path) == []


def test_a_bound_that_is_not_known_is_gone_on_with(whole, tmp_path):
    study, _ = whole
    log = Log.create(tmp_path / "s.nc.runs", study.specification | {"versions": fingerprint()})
    log.append(pieces.failed_piece(study, Task(0, 0, 0), "why"))
    log.append(pieces.failed_piece(study, Task(0, 3, 2), "why not"))
    log.close()
    told = run_study(study, tmp_path / "s.nc", workers=0, resume=True).about
    assert told["bounds_unknown"] == [[0, "why"]]
    assert sorted(told["messages"]) == [[0, row, run, "why not"] for row in range(len(study.rows)) for run in (3, 4)]


def test_runs_in_other_lanes_are_not_gone_on_with(tmp_path, monkeypatch):
    """A study begun with one lane and gone on with in four had bits of both."""
    study, path = small(runs=20), tmp_path / "s.nc"
    here = versions.fingerprint()["lanes"]
    monkeypatch.setattr(versions, "machine_lanes", lambda: 16)
    execute._log(study, path.with_name("s.nc.runs"), False).close()
    monkeypatch.undo()
    with pytest.raises(ValueError, match=rf"was begun by lanes 16, not {here} as here: results would not be the same"):
        run_study(study, path, workers=0, resume=True)
