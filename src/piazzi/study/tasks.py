"""What a study hands out, and what comes back: kept in its log, sent between processes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

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
