"""Astrometry in the Astrometry Data Exchange Standard (ADES) of the IAU: pipe-separated values and XML.

Source: Chesley, Hockney and Holman, ADES Master version of 2017 and 2022.  Directions are astrometric, in the ICRF.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from piazzi.formats.astrometry import settled
from piazzi.formats.conventions import Conventions
from piazzi.formats.dates import read_dates
from piazzi.formats.fields import number
from piazzi.formats.markup import Element, walk
from piazzi.formats.ndm import Source
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

EXTRA = ("magnitude", "band", "catalogue", "mode", "place_axes")
AU = 149597870700.0  # m
_ARCSECOND = math.pi / 648000.0
_RECORDS = ("optical", "offset", "occultation", "radar")
_UNITS = {"WGS84": 1.0, "ICRF_KM": 1e3, "ICRF_AU": AU}


def read_psv(data: bytes, name: str, told: Conventions) -> Observations:
    """Observations of pipe-separated values, as `observe` has them; ValueError with file, line and reason."""
    header: list[str] = []
    rows, line = Rows(EXTRA), 0
    try:
        for line, text in enumerate(data.decode("utf-8", "replace").split("\n"), 1):
            stripped = text.strip()
            if stripped[:1] in ("", "#", "!"):
                continue
            cells = [cell.strip() for cell in stripped.split("|")]
            if not header or "obsTime" in cells:  # each block names its columns
                header = _columns(cells)
            elif len(cells) > len(header):
                raise ValueError(f"the line has {len(cells)} cells; the columns are {len(header)}")
            else:
                observe(rows, dict(zip(header, cells, strict=False)), line)
        return settled(rows.table(name), told)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def read_xml(data: bytes, name: str, told: Conventions) -> Observations:
    """Observations of an XML document, as `observe` has them; ValueError with file, line and reason."""
    source, rows, record, begun = Source(name), Rows(EXTRA), dict[str, str](), [0]

    def begins(element: str, attributes: dict[str, str], line: int) -> None:
        if element in _RECORDS:
            record.clear()
            begun[0] = line

    def ends(element: Element) -> None:
        if element.name not in _RECORDS:
            record[element.name] = element.text
            return
        try:
            observe(rows, record, begun[0])
        except ValueError as error:
            source.refuse(begun[0], str(error))

    walk(source, data, begins, ends)
    try:
        return settled(rows.table(name), told)
    except ValueError as error:
        source.refuse(data.count(b"\n") + 1, str(error))


def _columns(cells: list[str]) -> list[str]:
    if "obsTime" not in cells or {"stn", "rcv"}.isdisjoint(cells):
        raise ValueError("no line names the columns: obsTime, stn (rcv of radar), ra, dec and more, between |")
    if len(set(cells)) < len(cells):
        raise ValueError("two columns have the same name")
    return cells


def observe(rows: Rows, record: Mapping[str, str], line: int) -> None:
    """Rows of one record: right ascension and declination, or those of a star and an offset from it, or delay and Doppler.

    Those that the file calls deprecated are counted and left out.
    """
    if record.get("deprecated"):
        rows.skip("observations that are deprecated")
        return
    readings, bad = read_dates(np.array([record.get("obsTime", "").encode("latin-1", "replace")[:40] or b" "]))
    if bad[0] or not record["obsTime"].endswith("Z"):
        raise ValueError(f"obsTime is {record.get('obsTime', '')[:40]!r}; it must be UTC as 2016-08-29T12:23:34.12Z")
    day, seconds = float(readings.day[0]), float(readings.seconds[0] + readings.fraction[0])
    scale = "UTC" if day >= 36934 else "UT1"
    names = (
        record.get("permID") and _permanent(record["permID"]),
        record.get("provID"),
        record.get("artSat"),
        record.get("trkSub"),
    )
    target = next((name for name in names if name), "")
    if _has(record, "delay") or _has(record, "doppler"):
        _radar(rows, record, Row(day, seconds, record.get("rcv") or record.get("stn", ""), target, 0, line), scale)
        return
    station = record.get("stn", "")
    if not station:
        raise ValueError("the observation has no station (stn)")
    segment = rows.segment(("optical", scale), scale=scale, frame="ICRF", angles="astrometric", tag="receive")
    place, axes = _place(rows, record)
    time_sigma = _number(record, "rmsTime")
    _direction(rows, record, Row(day, seconds, station, target, segment, line, place, time_sigma), axes)


def _permanent(name: str) -> str:
    """A minor planet's number in brackets, as other formats of the Center have it; comets and satellites as they are."""
    return f"({int(name)})" if name.isdecimal() and name.isascii() else name


def _has(record: Mapping[str, str], name: str) -> bool:
    return bool(record.get(name))


def _number(record: Mapping[str, str], name: str, unit: float = 1.0) -> float:
    """A field in SI, NaN where there is none."""
    return unit * number(record[name], name) if _has(record, name) else math.nan


def _sigma(record: Mapping[str, str], name: str, unit: float) -> float:
    value = _number(record, name, unit)
    if value <= 0.0:
        raise ValueError(f"{name} is {record[name]}; it must be positive")
    return value


def _direction(rows: Rows, record: Mapping[str, str], row: Row, axes: str) -> None:
    ascension, declination = _number(record, "ra"), _number(record, "dec")
    if _has(record, "raStar") and _has(record, "decStar"):
        ascension, declination = _from_star(record)
    if math.isnan(ascension) or math.isnan(declination):
        raise ValueError("the observation has neither ra and dec, nor a star with an offset, nor delay or Doppler")
    if not (0.0 <= ascension < 360.0 and abs(declination) <= 90.0):
        raise ValueError(f"right ascension {ascension:g} deg or declination {declination:g} deg is on no sphere")
    correlation = _number(record, "rmsCorr")
    if abs(correlation) >= 1.0:
        raise ValueError(f"rmsCorr is {correlation:g}; a correlation lies between -1 and 1")
    brightness = _number(record, "mag")
    notes = {"magnitude": brightness, "band": record.get("band", ""), "catalogue": record.get("astCat", "")}
    notes |= {"mode": record.get("mode", ""), "place_axes": axes}
    rows.add(row, "right_ascension", math.radians(ascension), _sigma(record, "rmsRA", _ARCSECOND), extra=notes)
    rows.add(row, "declination", math.radians(declination), _sigma(record, "rmsDec", _ARCSECOND), correlation, extra=notes)


def _from_star(record: Mapping[str, str]) -> tuple[float, float]:
    """Degrees of a place by its offset from a star; that in right ascension is times the cosine of the declination."""
    ascension, declination = _number(record, "raStar"), _number(record, "decStar")
    east, north = (_number(record, name, 1.0 / 3600.0) for name in ("deltaRA", "deltaDec"))
    return (ascension + east / math.cos(math.radians(declination))) % 360.0, declination + north


def _place(rows: Rows, record: Mapping[str, str]) -> tuple[int, str]:
    """Index of the observer's own place, where the record has one, and its axes."""
    system = record.get("sys", "")
    if not system:
        return -1, ""
    if system not in _UNITS:
        raise ValueError(f"sys is {system[:20]!r}; {', '.join(_UNITS)} are read")
    if record.get("ctr", "399") not in ("399", ""):
        raise ValueError(f"ctr is {record['ctr'][:20]!r}; only places about the Earth (399) are read")
    one, two, three = (_number(record, f"pos{k}") for k in (1, 2, 3))
    if math.isnan(one + two + three):
        raise ValueError(f"sys is {system}, and pos1, pos2 or pos3 is missing")
    if system == "WGS84":  # east longitude and latitude in degrees, height in metres
        from piazzi.earth.geodetic import geodetic_to_position

        x, y, z = map(float, geodetic_to_position(math.radians(two), math.radians(one), three))
    else:
        x, y, z = (_UNITS[system] * value for value in (one, two, three))
    rows.places.append((x, y, z))
    return len(rows.places) - 1, "ITRF" if system == "WGS84" else "GCRF"


def _radar(rows: Rows, record: Mapping[str, str], row: Row, scale: str) -> None:
    sender, frequency = record.get("trx") or row.station, _number(record, "frq", 1e6)
    point = "centre of mass" if record.get("com") in ("1", "true") else "surface"
    segment = rows.segment(
        ("radar", scale, sender, row.station, row.object, frequency, point),
        scale=scale,
        path=(sender, row.object, row.station),
        way="two-way" if sender == row.station else "three-way",
        range_is="sum",
        tag="receive",
        frequencies=() if math.isnan(frequency) else (("transmit", frequency),),
        said=(("echo", point),),
    )
    row, notes = row._replace(segment=segment), dict.fromkeys(EXTRA, "") | {"magnitude": math.nan}
    if _has(record, "delay"):
        rows.add(row, "time_of_flight", _number(record, "delay"), _sigma(record, "rmsDelay", 1e-6), extra=notes)
    if _has(record, "doppler"):
        rows.add(row, "doppler", _number(record, "doppler"), _sigma(record, "rmsDoppler", 1.0), extra=notes)
