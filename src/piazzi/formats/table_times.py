"""Times of a table of measurements: dates, weeks and seconds of them, or seconds past an epoch that the table says."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.columns import Instants, read_dates, read_weeks
from piazzi.earth.epoch import orientation
from piazzi.earth.scales import DAY, to_tt
from piazzi.formats.conventions import Conventions
from piazzi.tables.cells import PAST, TIME, Cells
from piazzi.tables.names import SECONDS, WEEK, parts

EPOCH = "epoch"
UNIX = f"{TIME}[unix]"
ZERO_UNIX = 40587.0  # MJD of 1970-01-01


class Times(NamedTuple):
    """Time zero, (J,) seconds of TT past it, scales and (J,) which of them each row has, and what is open."""

    epoch: Epoch
    t: Array
    scales: tuple[str, ...]
    scale: Array
    open: tuple[str, ...] = ()


def clocks(cells: Cells, told: Conventions) -> Times:
    """Times of all rows; raises ValueError with the line for what is none."""
    rows = len(cells.lines)
    if not rows:
        raise ValueError("there are no measurements: only a header")
    place = _places(cells)
    if cells.dates is not None:
        return _dates(cells, told)
    if {WEEK, SECONDS} <= cells.numbers.keys() and TIME not in cells.numbers:
        return _past(read_weeks(cells.numbers[WEEK], cells.numbers[SECONDS], place))
    name = next(name for name in cells.numbers if parts(name)[0] == TIME)
    if name.casefold() == UNIX:
        return _past(_unix(cells.numbers[name], place))
    found = PAST.fullmatch(name)
    if name != TIME and found is None:
        raise ValueError(
            f"column {name[:60]!r} is no time: it is in a scale, as time[UTC], time[MJD UTC], {UNIX} or time[s past DATE]"
        )
    return _seconds(cells.numbers[name], found[1] if found else _said(cells), place)


def _places(cells: Cells, rows: Array | None = None) -> Callable[[int], str]:
    """How a message about an entry begins, of all rows or some."""
    return lambda i: f"line {cells.lines[i if rows is None else int(rows[i])]}: "


def _past(found: Instants, open_: tuple[str, ...] = ()) -> Times:
    epoch = Epoch.at(float(found.whole[0]))
    t = (found.whole - epoch.whole) + (found.fraction - epoch.fraction)
    return Times(epoch, t, (found.scale,), np.zeros(len(t), dtype=np.int64), open_)


def _dates(cells: Cells, told: Conventions) -> Times:
    """Dates by the scale of the column or of each date, else by what the user says of each station, else UTC, and open."""
    dates, place = cells.dates, _places(cells)
    assert dates is not None
    try:
        return _past(read_dates(dates, cells.scale, place))
    except ValueError as error:
        if "no time scale" not in str(error):
            raise
    names = cells.station_names or ("",)
    said = [told.scale_of(name) for name in names]
    known = list(dict.fromkeys(scale or "UTC" for scale in said))
    of_name = np.array([known.index(scale or "UTC") for scale in said])
    index = np.zeros(len(dates), dtype=np.int64) if cells.station is None else cells.station
    which, whole, fraction = of_name[index], np.empty(len(dates)), np.empty(len(dates))
    for k, scale in enumerate(known):
        own = np.flatnonzero(which == k)
        _, whole[own], fraction[own] = read_dates(dates[own], scale, _places(cells, own))
    open_ = () if None not in said else ("the time scale of dates: --scale UTC or another",)
    found = _past(Instants(known[0], whole, fraction), open_)
    return found._replace(scales=tuple(known), scale=which)


def _said(cells: Cells) -> str:
    """The date that numbers are seconds past, by a line above the header."""
    pairs = (comment.partition("=") for comment in cells.comments)
    said = next((value.strip() for key, equals, value in pairs if equals and key.strip() == EPOCH), "")
    if not said:
        raise ValueError(
            "the times are numbers, and nothing says past which date, as # epoch = 2016-02-13T16:00:00 UTC above the header, "
            'or --columns "time=T[s past 2016-02-13T16:00:00 UTC]"; others are time=T[unix], time=T[MJD UTC], time=T[JD TDB]'
        )
    return said


def _seconds(t: Array, said: str, place: Callable[[int], str]) -> Times:
    """Numbers as seconds past a date."""
    _finite(t, place)
    epoch = Epoch(said)
    if epoch == Epoch("1970-01-01T00:00:00 UTC"):
        raise ValueError(
            f"seconds past 1970 are Unix time to most, which has no leap seconds: name the column {UNIX}, or another date"
        )
    return Times(epoch, t, ("TT",), np.zeros(len(t), dtype=np.int64))


def _unix(t: Array, place: Callable[[int], str]) -> Instants:
    """Seconds past 1970 in days of 86400 s each, leap seconds left out, as instants of UTC."""
    _finite(t, place)
    day = np.floor(t / DAY)
    seconds = t - DAY * day
    whole = np.floor(seconds)
    return Instants("UTC", *to_tt("UTC", day + ZERO_UNIX, whole, seconds - whole, orientation("UTC")))


def _finite(t: Array, place: Callable[[int], str]) -> None:
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        raise ValueError(f"{place(int(bad[0]))}the time {'is missing' if np.isnan(t[bad[0]]) else 'is infinite'}")
