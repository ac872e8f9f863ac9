"""Times of a table: seconds as they are; dates, or weeks and seconds of them, as seconds past an epoch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from piazzi.problem import Problem
from piazzi.problem.checks import Array, check_span
from piazzi.problem.epochs import FARTHEST, check_near, epoch_given
from piazzi.tables.cells import TIME, Cells
from piazzi.tables.names import SECONDS, WEEK

if TYPE_CHECKING:
    from piazzi.earth import Epoch

EPOCH = "epoch = "


class Times(NamedTuple):
    """Seconds (J,), and the instant that they are past, where it is known."""

    seconds: Array
    epoch: Epoch | None


def times_of(cells: Cells, problem: Problem, scale: str | None = None) -> Times:
    """The times of a table, in the order of its rows.

    Dates become seconds of TT past the problem's epoch, or else the one in a comment of the file; a problem whose prior is at
    the first measurement needs neither, and begins at the first date.  `scale` is that of dates that name none.  Columns
    ``week`` and ``sow`` are weeks of GPS since 1980 and seconds of the week.

    Raises
    ------
    ValueError
        With the line, for what is no date or no number, is in another scale than what is above, or is far from the epoch; for
        dates without any epoch; for a scale where there are no dates.
    """
    rows = len(cells.lines)
    if not rows:
        raise ValueError("there are no measurements: only a header")
    epoch = epoch_in(cells.comments)
    if has_weeks(cells):
        week = cells.numbers[WEEK]
        return _past(cells, *_weeks(cells, scale), problem.epoch or epoch, problem, lambda i: f"week {week[i]:g}")
    if cells.dates is not None:
        dates = cells.dates
        instants = _instants(cells, dates, _scale(cells, scale))
        return _past(cells, *instants, problem.epoch or epoch, problem, lambda i: str(dates[i].decode()))
    if scale is not None:
        raise ValueError(f"--scale {scale} is for dates; the times of this file are seconds")
    times = cells.numbers[TIME]
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        what = "is missing" if np.isnan(times[bad[0]]) else f"is {times[bad[0]]}"
        raise ValueError(f"line {cells.lines[bad[0]]}: the time {what}; it must be finite")
    last = int(np.argmax(times))
    check_span(times.min(), times[last], f"line {cells.lines[last]}")
    return Times(times, epoch)


def has_weeks(cells: Cells) -> bool:
    """Whether weeks and their seconds say the time."""
    return {WEEK, SECONDS} <= cells.numbers.keys() and TIME not in cells.numbers and cells.dates is None


def epoch_in(comments: Sequence[str]) -> Epoch | None:
    """The epoch that a comment above a table says."""
    return epoch_given(next((c.removeprefix(EPOCH) for c in comments if c.startswith(EPOCH)), ""))


def _instants(cells: Cells, dates: Array, scale: str | None) -> tuple[Array, Array]:
    """Instants of dates, as whole seconds of TT past J2000.0 and a fraction."""
    from piazzi.earth.columns import read_dates

    try:
        return read_dates(dates, scale, lambda i: f"line {cells.lines[i]}: ")[1:]
    except ValueError as error:
        hint = "; or say it once: --scale UTC, or time[UTC] as the name of the column" if "no time scale" in str(error) else ""
        raise ValueError(f"{error}{hint}") from None


def _weeks(cells: Cells, scale: str | None) -> tuple[Array, Array]:
    """Instants of weeks of GPS and seconds of them."""
    from piazzi.earth.columns import read_weeks

    if scale not in (None, "GPS"):
        raise ValueError(f"--scale {scale} was said, but weeks and seconds of them are in GPS")
    return read_weeks(cells.numbers[WEEK], cells.numbers[SECONDS], lambda i: f"line {cells.lines[i]}: ")[1:]


def _past(
    cells: Cells, whole: Array, fraction: Array, epoch: Epoch | None, problem: Problem, said: Callable[[int], str]
) -> Times:
    """Instants as seconds past an epoch, or else past the first of them; `said` is how a row says it."""
    if epoch is None:
        from piazzi.earth import Epoch

        i = int(np.lexsort((fraction, whole))[0])
        epoch = Epoch.at(float(whole[i]), float(fraction[i]))
        if problem.prior_time is not None:
            raise ValueError(
                f"line {cells.lines[i]}: there are dates, but the problem has no epoch, so nothing says where they are beside "
                f'its prior at {problem.prior_time:g} s: give it one, such as epoch = "{epoch.exact()}"'
            )
    seconds = (whole - epoch.whole) + (fraction - epoch.fraction)
    far = np.flatnonzero(np.abs(seconds) >= FARTHEST)
    if far.size:
        check_near(seconds[far[0]], epoch, f"line {cells.lines[far[0]]}: {said(int(far[0]))}, at")
    return Times(seconds, epoch)


def _scale(cells: Cells, said: str | None) -> str | None:
    """The scale of dates that name none."""
    if said is not None and cells.scale is not None and said.upper() != cells.scale:
        raise ValueError(f"--scale {said} was said, but column {TIME!r} is in {cells.scale}")
    return cells.scale or said
