"""More runs than a study had: what is there is taken over bit by bit, because a run does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from piazzi.io import hdf5
from piazzi.study.log import Check, Log
from piazzi.study.plan import BOUND_RUNS, Plan
from piazzi.study.score import NUMBERS
from piazzi.study.store import Stored
from piazzi.study.tasks import Piece, Task
from piazzi.study.versions import difference_of, fingerprint

_TOGETHER = 256  # runs of one piece
_PER_RUN = (*NUMBERS, "success", "diverged", "error", "nees", "rank")
_BOUND = ("bound", "bound_whole", "bound_last_half", "bound_runs")


def begun(study: Plan, stored: Stored, path: Path) -> Log:
    """The log of a study that begins with the runs of a finished one; raises ValueError for one of other versions."""
    there = stored.about.get("versions")
    change = difference_of(there if isinstance(there, dict) else {}, fingerprint())
    if change:
        raise ValueError(f"{stored.path} was made by {change}: more runs would not be of the same study; run it anew")
    return _filled(study, path, _pieces(stored), int(stored.about["specification"]["runs"]))


def longer(study: Plan, log: Log, checks: Callable[[dict[str, Any]], Check]) -> Log:
    """The log of a study that was begun with fewer runs, in its place."""
    path, beside = log.path, log.path.with_name(log.path.name + ".longer")
    beside.unlink(missing_ok=True)
    try:
        _filled(study, beside, log.pieces(), int(log.specification["runs"])).close()
    finally:
        log.close()
    os.replace(beside, path)
    return Log.open(path, checks)


def _filled(study: Plan, path: Path, pieces: Iterable[Piece], runs: int) -> Log:
    """A new log with these pieces of a study of so many runs; bounds only where they are means over the same truths."""
    same_bounds = min(runs, BOUND_RUNS) == min(study.runs, BOUND_RUNS)
    log = Log.create(path, study.specification | {"versions": fingerprint()})
    try:
        for piece in pieces:
            if piece.task.count or same_bounds:
                log.append(piece)
    except BaseException:
        log.remove()
        raise
    return log


def _pieces(stored: Stored) -> Iterator[Piece]:
    """Everything in a store, as it came: the bound of each point and its runs, a few hundred at a time."""
    runs = int(stored.about["specification"]["runs"])
    unknown = dict(stored.about.get("bounds_unknown", []))
    with hdf5.opened(stored.path) as root:
        for point in range(len(stored.points)):
            why = ((-1, -1, unknown[point]),) if point in unknown else ()
            yield Piece(Task(point, 0, 0), {name: hdf5.slab(root, name, (point,)) for name in _BOUND}, why)
            said = [tuple(message[1:]) for message in stored.about["messages"] if message[0] == point]
            for first in range(0, runs, _TOGETHER):
                task = Task(point, first, min(_TOGETHER, runs - first))
                part = (point, slice(None), slice(first, first + task.count))
                arrays = {name: hdf5.slab(root, name, part) for name in _PER_RUN}
                arrays["rank"] = arrays["rank"].astype("u2")  # as pieces have it
                yield Piece(task, arrays, tuple(m for m in said if m[1] in task.runs))
