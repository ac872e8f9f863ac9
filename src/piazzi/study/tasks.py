"""What a study hands out, and what comes back: kept in its log, sent between processes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from piazzi.problem.checks import Array


@dataclass(frozen=True)
class Task:
    """Runs `first` to `first + count - 1` at a point; no runs mean the point's Cramer-Rao bound."""

    point: int
    first: int
    count: int

    @property
    def runs(self) -> range:
        return range(self.first, self.first + self.count)


@dataclass(frozen=True, eq=False)
class Piece:
    """Results of a task: arrays by name, row by row of the study; and for each row and run without success, why.

    A bound that is not known has one message, of no row and no run: -1 stands for both.
    """

    task: Task
    arrays: Mapping[str, Array]
    messages: tuple[tuple[int, int, str], ...] = ()


def joined(pieces: Sequence[Piece]) -> Piece:
    """One piece of runs that follow each other; their axis is the second."""
    if len(pieces) == 1:
        return pieces[0]
    first = pieces[0].task
    task = Task(first.point, first.first, sum(p.task.count for p in pieces))
    arrays = {name: np.concatenate([p.arrays[name] for p in pieces], axis=1) for name in pieces[0].arrays}
    return Piece(task, arrays, tuple(m for p in pieces for m in p.messages))
