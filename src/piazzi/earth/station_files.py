"""Files of stations: TOML, SINEX, eccentricities, observatory codes, sites of satellite observers, told apart by content."""

from __future__ import annotations

import math
import re
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.earth.epoch import Epoch
from piazzi.earth.ilrs import ilrs_eccentricities, ilrs_stations
from piazzi.earth.observatories import read_observatories
from piazzi.earth.sinex import read_sinex, stations_of
from piazzi.earth.stations import (
    J2000,
    Coordinates,
    Eccentricity,
    Station,
    StationList,
    StationWarning,
    warn_of_place,
)
from piazzi.opening import opened
from piazzi.text import nearest
from piazzi.units import Units

KEYS = (
    "name", "latitude", "longitude", "height", "ellipsoid", "position", "velocity", "epoch", "eccentricities", "bias",
    "sigma", "mask", "description",
)  # fmt: skip
_ANGLES = ("azimuth", "elevation", "right_ascension", "declination")
_SITE = re.compile(r"(\d{4}) +(\S{1,3}) +([-+]?\d+\.\d*) +([-+]?\d+\.\d*) +([-+]?\d+\.?\d*)\s+(\S.*?)\s*")
_NEAR = 5e4  # m: within this a station is taken for one of the ILRS that has its name
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*\S)\s*")


def read_stations(*paths: str | Path) -> StationList:
    """Stations of files, which are told apart by content.

    Takes TOML (``[[stations]]``), SINEX with coordinates and velocities, SINEX with eccentricities only, which are given to
    the stations of the other files, the list of observatory codes of the Minor Planet Center, text or JSON, and the lists of
    sites of visual and radio observers (number, initials, latitude, longitude, height, name; # begins remarks).  Sites of a
    SINEX file for which no file has eccentricities get those of the list of the ILRS in the package, which `notes` says.

    Raises ValueError with the file and the place where a value cannot be read, and OSError where a file cannot be opened.
    Warns with StationWarning where a station stands inside the Earth, in space, or where latitude and longitude, or metres
    and kilometres, are likely to have been confused.
    """
    found: list[Station] = []
    surveys: list[Station] = []
    offsets: dict[str, list[Eccentricity]] = {}
    notes: list[str] = []
    for path in map(Path, paths):
        with opened(path) as file:
            start = file.read(4096)
        if start.startswith(b"%=SNX"):
            sinex = read_sinex(path)
            surveys += stations_of(sinex, path.name)
            for site, rows in sinex.eccentricities.items():
                offsets.setdefault(site, []).extend(rows)
        elif start.lstrip().startswith(b"{") or re.search(rb"(?m)^\w\d\d [ \d]{2}\d\.\d{4}", start):
            found += read_observatories(path, notes)
        elif any(map(_SITE.fullmatch, start.decode("latin-1").splitlines())):
            found += _sites(path, notes)
        else:
            found += _toml(path)
    found += [_with_offsets(s, offsets, notes) for s in surveys]
    if not found:
        raise ValueError(f"{', '.join(Path(p).name for p in paths)}: eccentricities only; give the coordinates they belong to")
    for station in found:
        warn_of_place(station, station.source)
    return StationList(tuple(found), tuple(dict.fromkeys(notes)))


def _with_offsets(station: Station, offsets: dict[str, list[Eccentricity]], notes: list[str]) -> Station:
    """The station with the eccentricities of the files, or else of the package, that belong to its points."""
    if station.eccentricities:
        return station
    points = {c.point for c in station.coordinates}
    site = station.name if station.name in offsets else station.name.rstrip("ABCD")
    if offsets:
        chosen = tuple(e for e in offsets.get(site, ()) if e.point in points)
        if not chosen:
            notes.append(f"{station.name}: no file has its eccentricities; none are used")
        return replace(station, eccentricities=chosen)
    chosen = tuple(e for e in ilrs_eccentricities().get(site, ()) if e.point in points)
    if chosen:
        notes.append(f"{station.source} has no eccentricities: those of the ILRS of 2020-04-20, in the package, are added")
    return replace(station, eccentricities=chosen)


def _sites(path: Path, notes: list[str]) -> list[Station]:
    """Sites of observers of satellites, a line each; of a number that several have, the last."""
    with opened(path) as file:
        lines = file.read().decode("utf-8", "replace").splitlines()
    found: dict[str, Station] = {}
    for at, text in enumerate(lines, 1):
        if not text.strip() or text.startswith("#"):
            continue
        match = _SITE.fullmatch(text)
        if match is None:
            what = "a site has a number, initials, latitude, longitude (deg), height (m) and a name"
            raise ValueError(f"{path.name}: line {at}: {what}")
        number, _, latitude, longitude, height, who = match.groups()
        place = {"latitude": float(latitude), "longitude": float(longitude), "height": float(height)}
        row = {"name": number, "description": who, **place}
        found[number] = replace(station_of(row, f"{path.name}: line {at}"), source=path.name)
    notes.append(f"{path.name}: heights of sites are taken as above the ellipsoid")
    return list(found.values())


def _toml(path: Path) -> list[Station]:
    with opened(path) as file:
        raw = file.read()
    try:
        data = tomllib.loads(raw.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name}: neither SINEX, observatory codes, sites of observers nor TOML: {error}") from None
    rows = data.get("stations")
    if not isinstance(rows, list) or not rows:
        raise ValueError(f"{path.name}: no [[stations]]; each has name, latitude, longitude and height")
    return [replace(station_of(row, f"{path.name}, station {i}"), source=path.name) for i, row in enumerate(rows, 1)]


def station_of(row: Mapping[str, Any], where: str) -> Station:
    """The station of a table of ``[[stations]]``: angles in degrees and lengths in metres, or text with a unit.

    Raises ValueError with `where` and the key; warns as `read_stations` does.
    """
    for key in row:
        if key not in KEYS:
            raise ValueError(f"{where}: unknown key {key!r}{nearest(key, KEYS)}")
    name = row.get("name")
    if not isinstance(name, str) or not name:
        raise ValueError(f'{where}: name is {name!r}; it must be text, such as "7090"')
    where = f"{where} ({name})"
    coordinates = _coordinates(row, where)
    velocity = _three(row["velocity"], "velocity", where) if "velocity" in row else (0.0, 0.0, 0.0)
    reference = _epoch(row["epoch"], f"{where}: epoch") if "epoch" in row else J2000
    if any(velocity) and "epoch" not in row:
        raise ValueError(f'{where}: a velocity needs the epoch of the position, such as epoch = "2010-01-01 UTC"')
    others = row.get("eccentricities", ())
    if not isinstance(others, list | tuple):
        raise ValueError(f"{where}: eccentricities are a list of {{ up, north, east, since, until }}")
    offsets = tuple(_offset(e, f"{where}, eccentricity {i}") for i, e in enumerate(others, 1))
    bias, sigma = (_by_kind(row.get(key, {}), f"{where}: {key}") for key in ("bias", "sigma"))
    mask = quantity(row.get("mask", 0.0), "deg", f"{where}: mask")
    marker = Coordinates(coordinates, velocity, reference)
    try:
        return Station(name, (marker,), offsets, bias, sigma, mask, str(row.get("description", "")))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _coordinates(row: Mapping[str, Any], where: str) -> tuple[float, float, float]:
    if "position" in row:
        if {"latitude", "longitude", "height"} & row.keys():
            raise ValueError(f"{where}: give a position or latitude, longitude and height, not both")
        return _three(row["position"], "position", where)
    missing = [key for key in ("latitude", "longitude", "height") if key not in row]
    if missing:
        raise ValueError(f"{where}: {', '.join(missing)} missing; give latitude, longitude and height, or position")
    latitude, longitude = (quantity(row[key], "deg", f"{where}: {key}") for key in ("latitude", "longitude"))
    height = quantity(row["height"], "m", f"{where}: height")
    ellipsoid = row.get("ellipsoid", "WGS84")
    ellipsoid = tuple(ellipsoid) if isinstance(ellipsoid, list) and len(ellipsoid) == 2 else ellipsoid
    if abs(latitude) > math.pi / 2:
        swapped = "; are latitude and longitude swapped?" if abs(longitude) <= math.pi / 2 else ""
        raise ValueError(f"{where}: latitude {math.degrees(latitude):g} deg lies beyond a pole{swapped}")
    if abs(longitude) > 2.0 * math.pi:
        raise ValueError(f"{where}: longitude {math.degrees(longitude):g} deg is more than a turn; in which unit is it?")
    try:
        place = Station.geodetic(row["name"], latitude, longitude, height, ellipsoid)
        other = Station.geodetic(row["name"], longitude, latitude, height, ellipsoid) if abs(longitude) <= math.pi / 2 else None
    except (ValueError, TypeError) as error:
        raise ValueError(f"{where}: {error}") from None
    _ask(place, other, row["height"], where)
    return place.coordinates[0].position


def _ask(place: Station, swapped: Station | None, height: object, where: str) -> None:
    """Questions about numbers that are possible and unlikely."""
    known = ilrs_stations().get(place.name) if place.name[:1].isdigit() else None  # as all names of these sites begin
    if known is not None:
        here, there = known.position(J2000), place.position(J2000)
        away = float(np.linalg.norm(here - there))
        if away > _NEAR and swapped is not None and np.linalg.norm(here - swapped.position(J2000)) < _NEAR:
            _warn(f"{where}: {away / 1e3:,.0f} km from the ILRS site of that name; are latitude and longitude swapped?")
        elif away > _NEAR:
            _warn(f"{where}: {away / 1e3:,.0f} km from the ILRS site of that name ({known.description}); is that meant?")
    if not isinstance(height, str) and 0.0 < abs(float(height)) < 9.0 and float(height) != round(float(height), 1):  # type: ignore[arg-type]
        _warn(f'{where}: height is {height} m; if that is kilometres, write "{height} km", and "{height} m" if it is not')


def _warn(text: str) -> None:
    warnings.warn(text, StationWarning, stacklevel=5)


def quantity(value: object, unit: str, where: str) -> float:
    """A number in `unit`, or text with a unit of its own, in SI; raises ValueError with `where`."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{where} is {value!r}; it must be a number in {unit}, or text with a unit")
    known = Units()
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value)
        if match is None:
            raise ValueError(f'{where} is {value!r}; write a number with a unit, such as "10 {unit}"')
        number, given = float(match[1]), match[2]
    else:
        number, given = float(value), unit
    try:
        said = known.unit(given)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    if said.powers != known.unit(unit).powers:
        raise ValueError(f"{where} is {value!r}; it must be in a unit such as {unit}")
    if not math.isfinite(number):
        raise ValueError(f"{where} is {value!r}; it must be finite")
    return number * said.factor


def _by_kind(table: object, where: str) -> dict[str, float]:
    if not isinstance(table, Mapping):
        raise ValueError(f'{where} is {table!r}; say of what, such as {{ range = "3 cm" }}')
    result = {}
    for kind, value in table.items():
        unit = "deg" if kind in _ANGLES else "m/s" if kind.endswith("rate") else "m"
        if unit == "deg" and not isinstance(value, str):
            raise ValueError(f'{where} of {kind} is {value!r}; angles need a unit, such as "{value} deg"')
        result[kind] = quantity(value, unit, f"{where} of {kind}")
    return result


def _three(values: object, what: str, where: str) -> tuple[float, float, float]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise ValueError(f"{where}: {what} is {values!r}; it must be three numbers, X, Y, Z of the ITRF in metres")
    unit = "m"
    x, y, z = (quantity(v, unit, f"{where}: {what}") for v in values)
    return x, y, z


def _epoch(value: object, where: str) -> Epoch:
    try:
        return Epoch(value)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{where}: {error}") from None


def _offset(row: object, where: str) -> Eccentricity:
    if not isinstance(row, Mapping) or not row.keys() <= {"up", "north", "east", "since", "until"}:
        raise ValueError(f"{where} is {row!r}; it has up, north, east, and may have since and until")
    up, north, east = (quantity(row.get(k, 0.0), "m", f"{where}: {k}") for k in ("up", "north", "east"))
    since, until = (_epoch(row[k], f"{where}: {k}") if k in row else None for k in ("since", "until"))
    return Eccentricity(up, north, east, since, until)
