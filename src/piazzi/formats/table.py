"""Tables of measurements (CSV): columns with units, dates or weeks, stations and objects, whatever marks separate the cells.

What the table does not say by its header may stand above it, as ``# frame = ITRF``: the words of `Conventions`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.conventions import WORDS, Conventions, with_conventions
from piazzi.formats.kinds import KINDS, asked_sigmas
from piazzi.formats.observations import Observations, Segment
from piazzi.formats.table_header import FIX, LATITUDE, PEOPLE, SIGMA, WEATHER, Header, content_of
from piazzi.formats.table_times import clocks
from piazzi.tables.cells import Cells, cells_of
from piazzi.text import unescape_formula

COMMENTS = (*WORDS, "frame", "interval")  # what lines above the header may say
_ORDER = tuple(KINDS)


class _Column(NamedTuple):
    """One kind of a table: (J,) values and sigmas, NaN where there are none."""

    kind: str
    value: Array
    sigma: Array


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Rows of all cells that hold a measurement.

    Raises
    ------
    ValueError
        With the file and the line, for what is no table, has no column that is needed, or a cell that does not fit.
    """
    header = Header(dict(told.columns))
    try:
        text, first = content_of(data, dict(told.columns))
        cells = cells_of(text, header.named, PEOPLE, first).renamed(unescape_formula)
        said = _said(cells)
        own = Conventions.of(**said)
        return with_conventions(_observations(cells, header, name, told, own), own)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _said(cells: Cells) -> dict[str, str]:
    """What lines above the header say."""
    pairs = (comment.partition("=") for comment in cells.comments)
    return {key.strip(): value.strip() for key, equals, value in pairs if equals and key.strip() in COMMENTS}


def _observations(cells: Cells, header: Header, name: str, told: Conventions, own: Conventions) -> Observations:
    numbers = {label: _in_si(cells, label, header.factors.get(label, 1.0)) for label in cells.numbers}
    columns, left_out = _columns(numbers, own)
    if not columns:
        raise ValueError(f"there is no column of measurements{header.hint()}")
    times = clocks(cells, told)
    kinds = tuple(column.kind for column in columns)
    there = ~np.isnan(np.stack([column.value for column in columns], axis=1))
    line, kind = np.nonzero(there)
    if not len(line):
        raise ValueError("the table has no measurements")
    geodetic = LATITUDE[0] in numbers
    people, index = _people(cells)
    unitless = [label for label in header.unitless if (label in numbers and label not in LATITUDE) or geodetic]
    segments = tuple(Segment(scale, frame="ITRF" if geodetic else None) for scale in times.scales)
    weather: dict[str, Any] = {what: numbers[what][line] for what in WEATHER if what in numbers}
    return Observations(
        epoch=times.epoch, t=times.t[line], value=np.stack([c.value for c in columns], axis=1)[line, kind],
        sigma=np.stack([c.sigma for c in columns], axis=1)[line, kind], kinds=kinds, kind=kind,
        participants=people, station=_at(index.get("station"), line), object=_at(index.get("object"), line),
        segments=segments, segment=times.scale[line], files=(name,), line=np.asarray(cells.lines)[line],
        assumed=(*cells.notes, *_taken(header, geodetic)), left_out=left_out, **weather,
        open=(*times.open, *_open(kinds, columns, there, segments[0].frame, unitless, header)),
    )  # fmt: skip


def _in_si(cells: Cells, label: str, factor: float) -> Array:
    """A column in SI; raises ValueError, with the line, for an infinite number."""
    column = cells.numbers[label]
    bad = np.flatnonzero(np.isinf(column))
    if bad.size:
        raise ValueError(f"line {cells.lines[bad[0]]}: {label} is {column[bad[0]]}; leave the cell empty where it is not known")
    with np.errstate(over="ignore"):
        return np.asarray(column * factor)


def _columns(numbers: Mapping[str, Array], own: Conventions) -> tuple[list[_Column], tuple[tuple[str, int], ...]]:
    """The kinds that were measured in the order of `KINDS`, fixes of geodetic places as x, y and z; what was left out."""
    numbers = dict(numbers)
    if LATITUDE[0] in numbers or LATITUDE[1] in numbers:
        numbers |= _positions(numbers, own)
    present = [kind for kind in _ORDER if kind in numbers and kind not in (*WEATHER, *LATITUDE)]
    nothing = np.full(len(next(iter(numbers.values()), ())), np.nan)
    columns = [_Column(kind, numbers[kind], numbers.get(SIGMA + kind, nothing)) for kind in present]
    fix = [column for column in columns if column.kind in FIX]
    missing = [kind for kind in FIX[:3] if kind not in present]
    if fix and missing:
        raise ValueError(f"a fix has x, y and z: there is no column {missing[0]!r}")
    if len(fix) not in (0, 3, 6):
        lost = next(kind for kind in FIX if kind not in present)
        raise ValueError(f"a velocity has vx, vy and vz: there is no column {lost!r}")
    if not fix:
        return columns, ()
    values = np.stack([column.value for column in fix], axis=1)
    whole = ~np.isnan(values[:, :3]).any(axis=1)
    fast = whole & ~np.isnan(values).any(axis=1)
    partly = int(np.count_nonzero(~whole & ~np.isnan(values).all(axis=1)))
    kept = {c.kind: np.where(whole if c.kind in FIX[:3] else fast, c.value, np.nan) for c in fix}
    columns = [c._replace(value=kept.get(c.kind, c.value)) for c in columns]
    return columns, ((("fixes with a coordinate missing", partly),) if partly else ())


def _positions(numbers: Mapping[str, Array], own: Conventions) -> dict[str, Array]:
    """Columns x, y and z in the ITRF of latitudes, longitudes and heights."""
    from piazzi.earth.geodetic import geodetic_to_position

    for what in LATITUDE:
        if what not in numbers:
            raise ValueError(f"a geodetic place has latitude, longitude and height: there is no column {what!r}")
        if SIGMA + what in numbers:
            raise ValueError(f"column {SIGMA + what!r}: a fix has sigmas of x, y and z; say --sigma x=10m, and ignore={what}")
    if any(axis in numbers for axis in FIX):
        raise ValueError("there are columns of x, y, z and of latitude, longitude, height: leave one out by ignore=NAME")
    if own.frame not in (None, "ITRF"):
        raise ValueError(f"latitude, longitude and height are of the ITRF, not of {own.frame}")
    there = ~np.isnan(np.stack([numbers[what] for what in LATITUDE])).any(axis=0)
    out = np.full((len(there), 3), np.nan)
    out[there] = geodetic_to_position(*(numbers[what][there] for what in LATITUDE))
    return dict(zip(FIX[:3], out.T, strict=True))


def _people(cells: Cells) -> tuple[tuple[str, ...], dict[str, Array]]:
    """Names of all who take part, and for each column of them (J,) indices."""
    people = tuple(dict.fromkeys(name for found in cells.texts.values() for name in found.names))
    place = {name: i for i, name in enumerate(people)}
    return people, {
        column: np.array([place[name] for name in found.names], dtype=np.int64)[found.code]
        for column, found in cells.texts.items()
    }


def _at(index: Array | None, line: Array) -> Array:
    return np.array(-1) if index is None else index[line]


def _taken(header: Header, geodetic: bool) -> list[str]:
    out = [f"columns that mean nothing here are left out: {', '.join(header.strange[:8])}"] if header.strange else []
    return [*out, "latitudes, longitudes and heights are above the ellipsoid WGS84"] if geodetic else out


def _open(
    kinds: Sequence[str], columns: Sequence[_Column], there: Array, frame: str | None, unitless: Sequence[str], header: Header
) -> list[str]:
    """What only the user can say."""
    out = []
    if unitless:
        said = " ".join(f"{label}={header.theirs(label)}[{header.unit(label)}]" for label in unitless)
        out.append(f'units of {", ".join(unitless)}: --columns "{said}" or others')
    if {"range", "range_rate", "range_rate_averaged"} & {*kinds}:
        out.append("whether ranges and rates are of one way, half or all of both: --range one-way, two-way or round-trip")
    if "range_rate_averaged" in kinds:
        out.append("over which interval range rates are averaged: --interval 60")
        out.append("which part of the interval times are of: --interval-reference middle")
    if "right_ascension" in kinds:
        out.append("what directions are reduced to: --angles astrometric, --angles geocentric or --angles apparent")
        out.append("the axes of right ascension and declination: --frame EME2000")
    if "x" in kinds and frame is None:
        out.append("the axes of x, y and z: --frame ITRF")
    silent = [c.kind for i, c in enumerate(columns) if not KINDS[c.kind].auxiliary and np.isnan(c.sigma[there[:, i]]).any()]
    if silent:
        out.append(asked_sigmas(silent))
    return out
