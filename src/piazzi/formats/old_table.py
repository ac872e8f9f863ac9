"""Tables of observatories from before there was UTC: local mean time from noon, apparent places of date.

A file begins with the line ``OBSERVATIONS OF AN OBSERVATORY``, then has lines ``name = value`` (object, station, longitude in
degrees east, time, axes, angles), and one line an observation: date, time, right ascension in hours and declination in degrees,
parted by blanks and colons, with ``-`` for what there is none of.  Remarks begin with #.  A declination without seconds, or the
word ``minutes`` where a print had no more and nobody copied it, is left out and counted.
"""

from __future__ import annotations

import math

from piazzi.formats.conventions import Conventions
from piazzi.formats.fields import calendar_day, integer, number
from piazzi.formats.mpc import sexagesimal
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

FIRST = "OBSERVATIONS OF AN OBSERVATORY"
_KEYS = ("object", "station", "longitude", "time", "axes", "angles")
_NOON = "local mean time from noon"
_MINUTES, _TIMELESS = "declinations in minutes only", "nights without a time"


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Right ascension and declination of each night; ValueError with the file, the line and the reason."""
    rows, head, line = Rows(), dict[str, str](), 0
    try:
        for line, text in enumerate(data.decode("utf-8").split("\n"), 1):
            plain = text.strip()
            if not plain or plain.startswith("#") or plain == FIRST:
                continue
            key, equals, value = plain.partition("=")
            if equals:
                if key.strip() not in _KEYS:
                    raise ValueError(f"{key.strip()[:40]!r} is not known; there are {', '.join(_KEYS)}")
                head[key.strip()] = value.strip()
            else:
                _night(rows, head, plain.split(), line)
        return rows.table(name, _assumed(head))
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _assumed(head: dict[str, str]) -> tuple[str, ...]:
    from piazzi.earth.delta_t import MODEL

    noon = f"times are {_NOON} at {head['longitude']} deg east, which is taken for UT1 (Delta T: {MODEL})"
    return (noon, f"right ascensions and declinations are {head['angles']}, along the axes of date ({head['axes']})")


def _night(rows: Rows, head: dict[str, str], cells: list[str], line: int) -> None:
    missing = [key for key in _KEYS if key not in head]
    if missing:
        raise ValueError(f"there is no line {missing[0]} = ... before the observations")
    if head["time"] != _NOON:
        raise ValueError(f"time is {head['time'][:40]!r}; {_NOON!r} is known")
    if len(cells) != 4:
        raise ValueError(f"the line has {len(cells)} cells; date, time, right ascension and declination are four")
    date, clock, ascension, declination = cells
    if clock == "-":
        rows.skip(_TIMELESS)
        return
    day = calendar_day(*(integer(part, "date") for part in date.split("-")))
    hours, _ = sexagesimal(clock.replace(":", " "), "time")
    longitude = number(head["longitude"], "longitude")
    seconds = 43200.0 + 3600.0 * hours - 240.0 * longitude  # of UT1, from the midnight before
    day, seconds = day + math.floor(seconds / 86400.0), seconds % 86400.0
    segment = rows.segment("", scale="UT1", frame=head["axes"], angles=head["angles"], tag="receive")
    row = Row(day, seconds, head["station"], head["object"], segment, line)
    if ascension != "-":
        hours, _ = sexagesimal(ascension.replace(":", " "), "right ascension")
        if not 0.0 <= hours < 24.0:
            raise ValueError(f"right ascension {hours:g} h is on no sphere")
        rows.add(row, "right_ascension", math.radians(15.0 * hours))
    if declination == "minutes" or declination.count(":") == 1:
        rows.skip(_MINUTES)
    elif declination != "-":
        degrees, _ = sexagesimal(declination.replace(":", " "), "declination")
        if abs(degrees) > 90.0:
            raise ValueError(f"declination {degrees:g} deg is on no sphere")
        rows.add(row, "declination", math.radians(degrees))
