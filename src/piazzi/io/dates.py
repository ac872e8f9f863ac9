"""Times of a table: seconds as they are, or dates as seconds past an epoch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from piazzi.io.cells import TIME, Cells
from piazzi.problem import Problem
from piazzi.problem.checks import Array, backwards, check_span
from piazzi.problem.epochs import check_near, epoch_given

if TYPE_CHECKING:
    from piazzi.earth import Epoch

EPOCH = "epoch = "


class Times(NamedTuple):
    """Seconds (J,), the instant that they are past, where it is known, and the scale of the dates, "" for none."""

    seconds: Array
    epoch: Epoch | None
    scale: str = ""


def times_of(cells: Cells, problem: Problem, scale: str | None = None) -> Times:
    """The times of a table, which do not fall.

    Dates become seconds of TT past the problem's epoch, or else the one in a comment of the file; a problem whose prior is at
    the first measurement needs neither, and begins at the first date.  `scale` is that of dates that name none.

    Raises
    ------
    ValueError
        With the line, for what is no date or no number, is in another scale than what is above, falls, or is far from the
        epoch; for dates without any epoch; for a scale where there are no dates.
    """
    epoch = epoch_in(cells.comments)
    if cells.dates is None:
        if scale is not None:
            raise ValueError(f"--scale {scale} is for dates; the times of this file are seconds")
        found = Times(cells.numbers[TIME], epoch)
        _check(cells, found.seconds, [])
        return found
    if not cells.dates.size:
        raise ValueError("there are no measurements: only a header")
    found = _dated(cells, cells.dates, problem.epoch or epoch, _scale(cells, scale), problem)
    _check(cells, found.seconds, cells.dates)
    return found


def _dated(cells: Cells, dates: Array, epoch: Epoch | None, scale: str | None, problem: Problem) -> Times:
    from piazzi.earth import Epoch
    from piazzi.earth.columns import read_dates

    try:
        kind, whole, fraction = read_dates(dates, scale, lambda i: f"line {cells.lines[i]}: ")
    except ValueError as error:
        hint = "; or say it once: --scale UTC, or time[UTC] as the name of the column" if "no time scale" in str(error) else ""
        raise ValueError(f"{error}{hint}") from None
    if epoch is None:
        first = Epoch.at(float(whole[0]), float(fraction[0]))
        if problem.prior_time is not None:
            raise ValueError(
                f"line {cells.lines[0]}: there are dates, but the problem has no epoch, so nothing says where they are beside "
                f'its prior at {problem.prior_time:g} s: give it one, such as epoch = "{first.exact()}"'
            )
        epoch = first
    seconds = (whole - epoch.whole) + (fraction - epoch.fraction)
    far = np.flatnonzero(np.abs(seconds) >= 1e8)
    if far.size:
        check_near(seconds[far[0]], epoch, f"line {cells.lines[far[0]]}: {dates[far[0]].decode()}, at")
    return Times(seconds, epoch, kind)


def epoch_in(comments: Sequence[str]) -> Epoch | None:
    """The epoch that a comment above a table says."""
    return epoch_given(next((c.removeprefix(EPOCH) for c in comments if c.startswith(EPOCH)), ""))


def _scale(cells: Cells, said: str | None) -> str | None:
    """The scale of dates that name none."""
    if said is not None and cells.scale is not None and said.upper() != cells.scale:
        raise ValueError(f"--scale {said} was said, but column {TIME!r} is in {cells.scale}")
    return cells.scale or said


def _check(cells: Cells, times: Array, dates: Array | list[bytes]) -> None:
    """Refuse times that are not finite or fall; `dates` are what they were read from, if they were dates."""
    if not times.size:
        raise ValueError("there are no measurements: only a header")
    bad = np.flatnonzero(~np.isfinite(times))
    if bad.size:
        what = "is missing" if np.isnan(times[bad[0]]) else f"is {times[bad[0]]}"
        raise ValueError(f"line {cells.lines[bad[0]]}: the time {what}; it must be finite")
    i = backwards(times)
    if i is not None:
        later, earlier = (dates[k].decode() if len(dates) else f"{times[k]:g} s" for k in (i, i - 1))
        raise ValueError(f"line {cells.lines[i]}: times must increase, but {later} comes after {earlier}")
    check_span(times[0], times[-1], f"line {cells.lines[-1]}")
