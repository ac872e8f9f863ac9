"""Plain columns of ranges and angles, one observation a line, parted by blanks; remarks begin with #."""

from __future__ import annotations

import math
from collections.abc import Sequence

from piazzi.formats.b3 import said_of
from piazzi.formats.conventions import Conventions
from piazzi.formats.fields import calendar_day, integer, number, second_of_day
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

_KINDS = {
    "0": ("range",), "1": ("azimuth", "elevation"), "2": ("range", "azimuth", "elevation"),
    "3": ("right_ascension", "declination"),
}  # fmt: skip


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Type, object, sensor, year, month, day, h, m, s of each line, then range (km), azimuth and elevation (deg) or two angles.

    Raises ValueError with file, line and reason.
    """
    rows, line = Rows(), 0
    try:
        for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
            fields = text.split()
            if fields and not fields[0].startswith("#"):
                _plain(rows, fields, line)
        return rows.table(name, *said_of(rows, {}, False, told))
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _plain(rows: Rows, fields: Sequence[str], line: int) -> None:
    if fields[0] not in _KINDS:
        raise ValueError(f"type {fields[0][:20]!r} is not known; there are {', '.join(_KINDS)}")
    kinds = _KINDS[fields[0]]
    if len(fields) != 9 + len(kinds):
        raise ValueError(f"the line has {len(fields)} fields; one of type {fields[0]} has {9 + len(kinds)}")
    day = calendar_day(*(integer(text, "date") for text in fields[3:6]))
    seconds = second_of_day(integer(fields[6], "hour"), integer(fields[7], "minute"), number(fields[8], "second"))
    segment = rows.segment(fields[0], scale="UTC", way="two-way", range_is="half")
    row = Row(day, seconds, fields[2], fields[1], segment, line)
    for kind, text in zip(kinds, fields[9:], strict=True):
        value = number(text, kind)
        rows.add(row, kind, 1e3 * value if kind == "range" else math.radians(value))
