"""Observatory codes of the Minor Planet Center: longitude and parallax constants, a row for each."""

from __future__ import annotations

import math
import re
from pathlib import Path

from piazzi.earth.stations import Coordinates, Station
from piazzi.opening import opened

RADIUS = 6378137.0  # m, the unit of parallax constants


def read_observatories(path: Path, notes: list[str]) -> list[Station]:
    """Observatories of a list: code, longitude in degrees, rho cos phi' and rho sin phi' in equatorial radii, name.

    Codes without a place on the ground are left out, which `notes` gets a line about.  Constants have five or six digits, which
    is 60 or 6 m.  Raises ValueError with file and line where a number cannot be read.
    """
    with opened(path) as file:
        rows = list(enumerate(file.read().decode("utf-8", "replace").splitlines(), 1))
    result, roving = [], []
    for number, row in rows:
        if not re.match(r"\w\d\d[ \d.-]", row):
            continue
        cells = row[4:13].strip(), row[13:21].strip(), row[21:30].strip()
        if not all(cells):
            roving.append(row[:3])
            continue
        try:
            longitude, across, along = (float(cell) for cell in cells)
        except ValueError:
            raise ValueError(f"{path.name}, line {number}: {' '.join(cells)!r} are not the numbers of an observatory") from None
        turn = math.radians(longitude)
        x, y, z = (RADIUS * v for v in (across * math.cos(turn), across * math.sin(turn), along))
        if (x, y, z) == (0.0, 0.0, 0.0):
            roving.append(row[:3])
            continue
        result.append(Station(row[:3], (Coordinates((x, y, z)),), description=row[30:].strip(), source=path.name))
    if roving:
        notes.append(
            f"{path.name}: {len(roving)} codes without a place on the ground are left out ({', '.join(roving[:6])} ...)"
        )
    return result
