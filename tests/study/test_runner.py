"""Handing out tasks: gaps, sizes, deaths and retries, on workers that die to order."""

from dataclasses import dataclass, field

import pytest

from piazzi.study.log import Log
from piazzi.study.pieces import failed_piece
from piazzi.study.pool import Outcome
from piazzi.study.runner import MOST_DEATHS, RETRIES, Runner, missing
from piazzi.study.tasks import Task
from tests.study.studies import small


@dataclass
class Fake:
    """Workers whose tasks take no time; tasks with a run in `deadly` kill their worker, once per entry."""

    study: object
    slots: int = 2
    deadly: dict = field(default_factory=dict)
    always: bool = False
    waiting: list = field(default_factory=list)
    seen: list = field(default_factory=list)

    def submit(self, task):
        assert len(self.waiting) < self.slots
        self.waiting.append(task)
        self.seen.append(task)

    def wait(self):
        task = self.waiting.pop(0)
        for run in task.runs:
            if self.deadly.get(run, 0) > 0:
                self.deadly[run] -= 1
                return [Outcome(task, died="SIGKILL")]
        if self.always:
            return [Outcome(task, error="MemoryError: no")]
        return [Outcome(task, failed_piece(self.study, task, "fine"))]

    def close(self):
        pass


def run(tmp_path, study, **options):
    chunk = options.pop("chunk", None)
    log = Log.create(tmp_path / "s.runs", study.specification)
    workers = Fake(study, **options)
    told = []
    try:
        Runner(study, log, workers, chunk, lambda done, total: told.append((done, total))).run()
        pieces = list(log.pieces())
    finally:
        log.close()
    return workers, pieces, told


def everything(study, pieces):
    """Every run of every point exactly once, and one bound for each point."""
    found = sorted((p.task.point, run) for p in pieces for run in p.task.runs)
    assert found == [(point, run) for point in range(study.points) for run in range(study.runs)]
    assert sorted(p.task.point for p in pieces if not p.task.count) == list(range(study.points))


@pytest.mark.parametrize("chunk", [None, 1, 7, 1000])
def test_every_run_once(tmp_path, chunk):
    study = small(runs=50, vary={"R.scale": [1, 2]})
    workers, pieces, told = run(tmp_path, study, chunk=chunk)
    everything(study, pieces)
    assert told[0] == (0, 100)
    assert told[-1] == (100, 100)
    if chunk:
        assert max(task.count for task in workers.seen) == min(chunk, 42)  # eight go first


def test_gaps_are_what_the_log_has_not(tmp_path):
    study = small(runs=20, vary={"R.scale": [1, 2]})
    log = Log.create(tmp_path / "s.runs", study.specification)
    for task in (Task(0, 5, 3), Task(0, 0, 2), Task(1, 0, 20), Task(1, 0, 0)):
        log.append(failed_piece(study, task, ""))
    assert list(missing(study, log)) == [Task(0, 2, 3), Task(0, 0, 0), Task(0, 8, 12)]
    log.close()


def test_bound_comes_after_the_first_few_runs(tmp_path):
    study = small(runs=100)
    log = Log.create(tmp_path / "s.runs", study.specification)
    assert list(missing(study, log)) == [Task(0, 0, 8), Task(0, 0, 0), Task(0, 8, 92)]
    log.close()


def test_a_run_that_kills_its_worker_is_found_and_reported(tmp_path):
    study = small(runs=40)
    workers, pieces, _ = run(tmp_path, study, chunk=16, deadly={21: 1000})
    everything(study, pieces)
    (bad,) = (p for p in pieces if p.task == Task(0, 21, 1))
    assert {text for _, _, text in bad.messages} == {"killed its worker (SIGKILL), 3 times"}
    assert sum(task == Task(0, 21, 1) for task in workers.seen) == RETRIES + 1
    assert all(text == "fine" for p in pieces if p is not bad for _, _, text in p.messages)


def test_a_death_from_outside_costs_a_retry_and_no_run(tmp_path):
    study = small(runs=40)
    _, pieces, _ = run(tmp_path, study, chunk=1, deadly={3: RETRIES, 30: 1})
    everything(study, pieces)
    assert all(text == "fine" for p in pieces for _, _, text in p.messages)


def test_where_nothing_runs_it_ends(tmp_path):
    study = small(runs=100)
    with pytest.raises(RuntimeError, match=rf"{MOST_DEATHS + 1} tasks in a row failed.*MemoryError"):
        run(tmp_path, study, chunk=64, always=True)
