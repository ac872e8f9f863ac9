"""What is being done, while it is done: in terminals and notebooks."""

from __future__ import annotations

import logging
import sys
from time import monotonic
from types import TracebackType
from typing import Any

_KERNELS = "piazzi"
_OFTEN = 0.1  # seconds between two steps of many in a notebook


class progress:  # noqa: N801 - a context like those of the standard library
    """Show the steps of long work, in a terminal on its standard error and in a notebook below the cell.

    What it gives is taken by `compare`, `windows` and `determine` as ``announce`` and by `Study.run` as ``progress``; kernels
    that are compiled meanwhile are shown too, as in "compiling 3 of 6".  Elsewhere nothing is shown.

    Parameters
    ----------
    console : rich Console, default one on standard error

    Examples
    --------
    >>> with pz.progress() as step:  # doctest: +SKIP
    ...     pz.compare(problem, tracking, estimators, announce=step)
    """

    def __init__(self, console: Any = None) -> None:
        self._console = console
        self._bar: Any = None
        self._task: Any = None
        self._handler = _Compiling(self)
        self._level = logging.NOTSET

    def __enter__(self) -> progress:
        from rich.console import Console

        console = self._console or (None if sys.stderr is None else Console(stderr=True))
        if console is None or not (console.is_terminal or console.is_jupyter):
            return self
        if console.is_jupyter:
            self._bar = _Cell()
        else:
            self._bar, self._task = _line(console)
        logger = logging.getLogger(_KERNELS)
        self._level = logger.level
        if not logger.isEnabledFor(logging.INFO):
            logger.setLevel(logging.INFO)
        logger.addHandler(self._handler)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bar is None:
            return
        logger = logging.getLogger(_KERNELS)
        logger.removeHandler(self._handler)
        logger.setLevel(self._level)
        self._bar.stop()
        self._bar = None

    def __call__(self, *step: Any) -> None:
        """A step begins, by its name; or so many of so many are done."""
        if self._bar is None:
            return
        if len(step) == 2:
            self._bar.update(self._task, completed=step[0], total=step[1], description=f"{step[0]:,} of {step[1]:,}")
        else:
            self._bar.update(self._task, description=str(step[0]))


def _line(console: Any) -> tuple[Any, Any]:
    """A line of a terminal with a bar, and its task."""
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    bar = Progress(SpinnerColumn(), text, BarColumn(bar_width=24), TimeElapsedColumn(), console=console, transient=True)
    task = bar.add_task("", total=None)
    bar.start()
    return bar, task


class _Cell:
    """A line below a cell of a notebook, which is written anew with every step: no widgets have to be installed for it."""

    def __init__(self) -> None:
        from IPython.display import display  # it is there in a notebook

        self._handle: Any = display({"text/plain": ""}, raw=True, display_id=True)
        self._begun = self._last = monotonic()

    def update(self, task: Any, *, description: str, completed: int | None = None, total: int | None = None) -> None:
        """Of many steps one every tenth of a second."""
        now = monotonic()
        if completed is not None and completed != total and now - self._last < _OFTEN:
            return
        self._last = now
        share = "" if completed is None or not total else f" {'█' * (20 * completed // total):░<20}"
        self._handle.update({"text/plain": f"{description}{share} {now - self._begun:.1f} s"}, raw=True)

    def stop(self) -> None:
        """Leave nothing."""
        self._handle.update({"text/plain": ""}, raw=True)


class _Compiling(logging.Handler):
    """Hands over what is said of kernels."""

    def __init__(self, shown: progress) -> None:
        super().__init__(logging.INFO)
        self._shown = shown

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if text.startswith("compiling"):
            self._shown(text)
