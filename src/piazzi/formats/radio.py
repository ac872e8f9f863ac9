"""Frequencies as amateur receivers list them: time, Hz, strength and site, a line each, parted by blanks; # begins remarks.

Times are of UTC, of the reception: a Modified Julian Day, or ``yy/mm/dd hh:mm:ss.s``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from piazzi.earth.dates import read_date
from piazzi.formats.conventions import Conventions
from piazzi.formats.fields import number
from piazzi.formats.kinds import asked_sigmas
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

_SHORT = re.compile(r"(\d\d)/(\d\d)/(\d\d) +(?=\d)")  # a date with two digits of the year


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Rows of received frequencies; ValueError with file, line and reason."""
    rows, line = Rows(), 0
    segment = rows.segment(None, scale="UTC", way="one-way", tag="receive")
    try:
        for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
            fields = _SHORT.sub(r"20\1-\2-\3T", text.strip(), count=1).split()
            if fields and not fields[0].startswith("#"):
                _row(rows, fields, segment, line)
        return rows.table(name, (), (asked_sigmas(["receive_frequency"]),))
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _row(rows: Rows, fields: Sequence[str], segment: int, line: int) -> None:
    if len(fields) == 5:
        raise ValueError("a second site is that of a transmitter whose signal the satellite reflects, which is not read")
    if len(fields) != 4:
        raise ValueError(f"the line has {len(fields)} fields; it has a time, a frequency (Hz), a strength and a site")
    when = read_date(fields[0] if "T" in fields[0] else f"MJD {fields[0]}", "UTC")
    frequency = number(fields[1], "frequency")
    if not frequency > 0.0:
        raise ValueError(f"the frequency is {frequency:g} Hz; it must be positive")
    row = Row(when.day, when.seconds + when.fraction, fields[3], "", segment, line)
    rows.add(row, "receive_frequency", frequency)
