"""SINEX files of coordinates, velocities and eccentricities of stations; SINEX 2.02, IERS Message 103."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from piazzi.earth.epoch import Epoch
from piazzi.earth.stations import Coordinates, Eccentricity, Station
from piazzi.opening import opened
from piazzi.text import finite_number

_BLOCKS = ("SITE/ID", "SITE/ECCENTRICITY", "SOLUTION/EPOCHS", "SOLUTION/ESTIMATE")
_AXES = ("STAX", "STAY", "STAZ", "VELX", "VELY", "VELZ")
Row = tuple[int, str]  # number of the line, text


class Sinex(NamedTuple):
    """What a file says: descriptions by site, coordinates by site, eccentricities by site; points are kept apart in them."""

    descriptions: dict[str, str]
    coordinates: dict[str, list[Coordinates]]
    eccentricities: dict[str, list[Eccentricity]]


def read_sinex(path: Path) -> Sinex:
    """Coordinates and eccentricities of a SINEX file; raises ValueError with file and line where a value cannot be read."""
    blocks: dict[str, list[Row]] = {name: [] for name in _BLOCKS}
    for name, row in _rows(path):
        blocks[name].append(row)
    descriptions = {row[1:5].strip(): " ".join(row[21:43].split()) for _, row in blocks["SITE/ID"]}
    spans = dict(_span(path, row) for row in blocks["SOLUTION/EPOCHS"])
    coordinates = _estimates(path, blocks["SOLUTION/ESTIMATE"], spans)
    offsets: dict[str, list[Eccentricity]] = {}
    for row in blocks["SITE/ECCENTRICITY"]:
        site, offset = _eccentricity(path, row)
        offsets.setdefault(site, []).append(offset)
    if not coordinates and not offsets:
        raise ValueError(f"{path.name}: a SINEX file with neither coordinates (SOLUTION/ESTIMATE) nor SITE/ECCENTRICITY")
    return Sinex(descriptions, coordinates, offsets)


def _rows(path: Path) -> Iterator[tuple[str, Row]]:
    """Rows of the blocks that are read, without comments; large matrices go by unread."""
    block = ""
    with opened(path) as file:
        for number, raw in enumerate(file, 1):
            first = raw[:1]
            if first == b"+":
                name = raw[1:].strip().decode("ascii", "replace")
                block = name if name in _BLOCKS else ""
            elif first == b"-":
                block = ""
            elif block and first == b" ":
                yield block, (number, raw.decode("latin-1").rstrip())


def sinex_date(text: str) -> Epoch | None:
    """The instant of ``YY:DDD:SSSSS`` or ``YYYY:DDD:SSSSS`` in UTC; None for zeros, which leave a span open."""
    year, day, seconds = (int(part) for part in text.strip().split(":"))
    if year == day == seconds == 0:
        return None
    if year < 100:
        year += 2000 if year <= 50 else 1900
    date = dt.date(year, 1, 1) + dt.timedelta(days=day - 1)
    return Epoch(f"{date.isoformat()} UTC") + float(seconds)


def _date(path: Path, number: int, text: str) -> Epoch | None:
    try:
        return sinex_date(text)
    except (ValueError, OverflowError):
        raise ValueError(f"{path.name}, line {number}: {text.strip()!r} is no date; SINEX writes YY:DDD:SSSSS") from None


def _span(path: Path, row: Row) -> tuple[tuple[str, str, str], tuple[Epoch | None, Epoch | None]]:
    number, text = row
    key = text[1:5].strip(), text[6:8].strip(), text[9:13].strip()
    return key, (_date(path, number, text[16:28]), _date(path, number, text[29:41]))


def _estimates(
    path: Path, rows: list[Row], spans: dict[tuple[str, str, str], tuple[Epoch | None, Epoch | None]]
) -> dict[str, list[Coordinates]]:
    found: dict[tuple[str, str, str], dict[str, float]] = {}
    references: dict[tuple[str, str, str], Epoch | None] = {}
    for number, text in rows:
        kind = text[7:13].strip()
        if kind not in _AXES:
            continue
        key = text[14:18].strip(), text[19:21].strip(), text[22:26].strip()
        unit = text[40:44].strip()
        wanted = ("m",) if kind.startswith("STA") else ("m/y", "m/yr", "m/a")
        if unit not in wanted:
            raise ValueError(f"{path.name}, line {number}: {kind} is in {unit!r}; it is read in {wanted[0]}")
        found.setdefault(key, {})[kind] = finite_number(text[47:68].strip(), f"{path.name}, line {number}")
        references[key] = _date(path, number, text[27:39])
    result: dict[str, list[Coordinates]] = {}
    for key, values in found.items():
        missing = [axis for axis in _AXES[:3] if axis not in values]
        if missing:
            raise ValueError(f"{path.name}: site {key[0]}, solution {key[2]} has no {', '.join(missing)}")
        reference = references[key]
        if reference is None:
            raise ValueError(f"{path.name}: site {key[0]}, solution {key[2]} has no reference epoch")
        x, y, z, vx, vy, vz = (values.get(axis, 0.0) for axis in _AXES)
        since, until = spans.get(key, (None, None))
        result.setdefault(key[0], []).append(Coordinates((x, y, z), (vx, vy, vz), reference, since, until, key[1]))
    return result


def _eccentricity(path: Path, row: Row) -> tuple[str, Eccentricity]:
    number, text = row
    if text[42:45] != "UNE":
        raise ValueError(f"{path.name}, line {number}: eccentricities in {text[42:45]!r}; they are read up, north, east (UNE)")
    place = f"{path.name}, line {number}"
    up, north, east = (finite_number(text[a:b].strip(), place) for a, b in ((46, 54), (54, 63), (63, 72)))
    since, until = _date(path, number, text[16:28]), _date(path, number, text[29:41])
    return text[1:5].strip(), Eccentricity(up, north, east, since, until, text[6:8].strip())


def stations_of(sinex: Sinex, source: str) -> list[Station]:
    """A station for every site; points that follow one another are one station, else each has its letter in the name."""
    result = []
    for site, coordinates in sinex.coordinates.items():
        offsets = sinex.eccentricities.get(site, [])
        points = sorted({c.point for c in coordinates})
        together = len(points) == 1 or _follow(coordinates)
        for point in [None] if together else points:
            chosen = [c for c in coordinates if point in (None, c.point)]
            eccentric = [e for e in offsets if any(e.point == c.point for c in chosen)]
            name = site if point is None else f"{site}{point}"
            described = sinex.descriptions.get(site, "")
            result.append(Station(name, tuple(chosen), tuple(eccentric), description=described, source=source))
    return result


def _follow(coordinates: list[Coordinates]) -> bool:
    """Whether no two points of a site were occupied at one time."""
    early, late = Epoch.at(-1e11), Epoch.at(1e11)
    spans = sorted((c.since or early, c.until or late, c.point) for c in coordinates)
    return all(a[2] == b[2] or a[1] <= b[0] for a, b in pairwise(spans))
