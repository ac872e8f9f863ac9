"""What a benchmark states: one number with its unit, its direction, and how much of it is noise; and how two runs are timed."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

TOLERANCE = 0.15  # on a shared machine, medians of interleaved runs move by this much


class UnavailableError(Exception):
    """What a section needs is not there: a command, a library, a data file."""


@dataclass(frozen=True)
class Figure:
    """One measurement.

    Attributes
    ----------
    value, unit : the number; `better` says which direction is good
    ratio, to : the value over something measured in the same run, and what that is
    bound : limit of the ratio where there is one, else of the value
    tolerance : relative change that is noise
    note : what the number does not say itself
    """

    name: str
    value: float
    unit: str
    better: Literal["lower", "higher"] = "lower"
    ratio: float | None = None
    to: str = ""
    bound: float | None = None
    tolerance: float = TOLERANCE
    note: str = ""

    @property
    def within(self) -> bool | None:
        """Whether the bound is kept, None where there is none."""
        if self.bound is None:
            return None
        judged = self.value if self.ratio is None else self.ratio
        return judged <= self.bound if self.better == "lower" else judged >= self.bound


Section = Callable[[], Iterator[Figure]]


def cpu_seconds(run: Callable[[], Any]) -> float:
    """CPU seconds of the process, all threads, for one call."""
    started = time.process_time()
    run()
    return time.process_time() - started


def interleaved(ours: list[Callable[[], Any]], other: Callable[[], float]) -> tuple[float, float]:
    """Median CPU seconds of our calls, and median ratio of each to what `other` says it took right after it."""
    ours[0]()  # load the compiled code
    times, ratios = [], []
    for run in ours[1:]:
        times.append(cpu_seconds(run))
        ratios.append(times[-1] / other())
    return statistics.median(times), statistics.median(ratios)


def rounds(runs: dict[Any, Callable[[], Any]], count: int) -> dict[Any, float]:
    """Median CPU seconds of each run, in rounds A B C A B C after one warm call of each."""
    times: dict[Any, list[float]] = {key: [] for key in runs}
    for turn in range(count + 1):
        for key, run in runs.items():
            seconds = cpu_seconds(run)
            if turn:
                times[key].append(seconds)
    return {key: statistics.median(seconds) for key, seconds in times.items()}
