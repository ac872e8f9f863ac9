"""Run a study: hand out its tasks, keep what comes back, find the runs that kill their workers."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from math import ceil

from piazzi.study.log import Log
from piazzi.study.pieces import failed_piece
from piazzi.study.plan import Plan
from piazzi.study.pool import Outcome, Workers
from piazzi.study.tasks import Piece, Task

Progress = Callable[[int, int], None]
FIRST_PIECE = 8  # runs, before anything is known about how long one takes
PIECE_SECONDS = 1.0
LARGEST_PIECE = 2048
RETRIES = 2
MOST_DEATHS = 30  # in a row, before anything worked


class Runner:
    """One execution of a study; what it has done already is in the log."""

    def __init__(
        self, study: Plan, log: Log, workers: Workers, chunk: int | None = None, progress: Progress | None = None
    ) -> None:
        self._study, self._log, self._workers, self._chunk = study, log, workers, chunk
        self._progress = progress or (lambda done, total: None)
        self._gaps = deque(missing(study, log))
        self._again: deque[Task] = deque()
        self._tries: dict[Task, int] = {}
        self._started: dict[Task, float] = {}
        self._seconds_per_run: float | None = None
        self._deaths, self._works = 0, bool(log.entries)
        self.total = study.points * study.runs
        self.done = self.total - sum(task.count for task in self._gaps)

    def run(self) -> None:
        """Everything that is missing.

        Raises
        ------
        OSError
            Where results cannot be written.
        RuntimeError
            Where nothing can be run.
        """
        self._progress(self.done, self.total)
        while self._fill() or self._started:
            for outcome in self._workers.wait():
                self._take(outcome)
            self._progress(self.done, self.total)

    def _fill(self) -> bool:
        """Keep every worker busy; whether there was anything to begin."""
        began = False
        while len(self._started) < self._workers.slots:
            task = self._again.popleft() if self._again else self._cut()
            if task is None:
                break
            self._started[task] = time.monotonic()
            self._workers.submit(task)
            began = True
        return began

    def _cut(self) -> Task | None:
        """The next task: as many runs as take about a second, fewer towards the end so that all workers end together."""
        if not self._gaps:
            return None
        gap = self._gaps.popleft()
        count = min(gap.count, self._chunk or self._adapted())
        if count < gap.count:
            self._gaps.appendleft(Task(gap.point, gap.first + count, gap.count - count))
        return Task(gap.point, gap.first, count)

    def _adapted(self) -> int:
        if self._seconds_per_run is None:
            return FIRST_PIECE
        whole = min(PIECE_SECONDS / max(self._seconds_per_run, 1e-9), LARGEST_PIECE)
        left = self.total - self.done - sum(task.count for task in self._started)
        wanted = min(whole, max(left / (2 * self._workers.slots), whole / 10))
        if self._seconds_per_run > PIECE_SECONDS:
            return 1
        return ceil(wanted / FIRST_PIECE) * FIRST_PIECE  # fewer than fill the lanes would cost as much

    def _take(self, outcome: Outcome) -> None:
        task, piece = outcome.task, outcome.piece
        seconds = time.monotonic() - self._started.pop(task)
        if piece is not None:
            self._works = True
            if task.count:
                rate = seconds / task.count
                known = self._seconds_per_run
                self._seconds_per_run = rate if known is None else 0.5 * (known + rate)
            self._keep(piece)
            return
        if outcome.fatal:
            raise RuntimeError(outcome.error)
        why = f"killed its worker ({outcome.died})" if outcome.died else outcome.error
        self._deaths += 1
        if self._deaths > MOST_DEATHS and not self._works:
            raise RuntimeError(f"{self._deaths} tasks in a row failed, the last one because it {why}")
        if task.count > 1:
            half = task.count // 2
            self._again.appendleft(Task(task.point, task.first + half, task.count - half))
            self._again.appendleft(Task(task.point, task.first, half))
            return
        self._tries[task] = self._tries.get(task, 0) + 1
        if self._tries[task] <= RETRIES:
            self._again.append(task)
        else:
            self._keep(failed_piece(self._study, task, f"{why}, {self._tries[task]} times"))

    def _keep(self, piece: Piece) -> None:
        self._log.append(piece)
        self.done += piece.task.count


def missing(study: Plan, log: Log) -> Iterator[Task]:
    """What the log does not have: gaps in the runs of every point, and bounds."""
    have: dict[int, list[tuple[int, int]]] = {}
    bounds = set()
    for entry in log.entries:
        if entry.task.count:
            have.setdefault(entry.task.point, []).append((entry.task.first, entry.task.count))
        else:
            bounds.add(entry.task.point)
    for point in range(study.points):
        at, gaps = 0, []
        for first, count in [*sorted(have.get(point, [])), (study.runs, 0)]:
            if first > at:
                gaps.append(Task(point, at, first - at))
            at = max(at, first + count)
        if point not in bounds:  # after a first few runs, which compile, and before the last, which end together
            if gaps and gaps[0].count > FIRST_PIECE:
                head = gaps.pop(0)
                rest = Task(point, head.first + FIRST_PIECE, head.count - FIRST_PIECE)
                gaps = [Task(point, head.first, FIRST_PIECE), rest, *gaps]
            gaps.insert(1, Task(point, 0, 0))
        yield from gaps
