"""Astrometry in the 80 columns of the Minor Planet Center: optical, from satellites and roving observers, and radar.

Source: Format for Optical Astrometric Observations, Satellite-Based, Roving Observer and Radar Astrometry, Minor Planet Center.
Directions are astrometric, in the ICRF; dates are in UT1 before 1960 and in UTC since.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from piazzi.formats.astrometry import settled
from piazzi.formats.conventions import Conventions
from piazzi.formats.designations import unpack
from piazzi.formats.fields import calendar_day, integer, number
from piazzi.formats.observations import Observations
from piazzi.formats.rows import Row, Rows

EXTRA = ("magnitude", "band", "catalogue", "note", "technique", "reference", "place_axes")
AU = 149597870700.0  # m
_ARCSECOND = math.pi / 648000.0
_SECOND = {"s": "S", "v": "V", "r": "R"}  # second lines, and the first line that each belongs to
_STEP = 0.0433  # s: half of the last digit of a time
_UTC = 36934  # 1960-01-01
_TEXT = "lines of text between observations"
_DATE = re.compile(r"\d{4} [ \d]\d [ \d]\d\.\d")
_HEADER = re.compile(r"(COD|CON|OBS|MEA|TEL|NET|BND|COM|NUM|ACK|AC2|TYP|FNT|---)[ -]")  # of reports


@dataclass
class _Reader:
    rows: Rows
    waiting: tuple[str, int] | None = None  # a first line of two, and its number


def read(data: bytes, name: str, told: Conventions) -> Observations:
    """Right ascension and declination of each line, delay and Doppler of radar; replaced ones are counted and left out.

    Raises ValueError with file, line and reason.
    """
    reader, line = _Reader(Rows(EXTRA)), 0
    try:
        for line, text in enumerate(data.decode("latin-1").split("\n"), 1):
            if text.strip():
                _take(reader, text.rstrip("\r"), line)
        if reader.waiting:
            raise ValueError(f"the second line of the observation in line {reader.waiting[1]} is missing")
        return settled(reader.rows.table(name), told)
    except ValueError as error:
        raise ValueError(f"{name}: line {line}: {error}") from None


def _take(reader: _Reader, text: str, line: int) -> None:
    text = text.rstrip()
    if _HEADER.match(text):
        return
    if text.startswith("#") or not _DATE.search(text):
        reader.rows.skip(_TEXT)
        return
    if len(text) != 80:
        raise ValueError(f"an observation has 80 columns; this line has {len(text)}")
    if "\t" in text:
        raise ValueError("the line has a tab")
    technique = text[14]
    if reader.waiting:
        first, at = reader.waiting
        if _SECOND.get(technique) != first[14] or text[15:32] != first[15:32]:
            raise ValueError(f"this is not the second line of the observation in line {at}")
        reader.waiting = None
        _two_lines(reader.rows, first, text, at)
    elif technique in _SECOND:
        raise ValueError(f"a second line ({technique!r} in column 15) without its first")
    elif technique in "SVR":
        reader.waiting = text, line
    elif technique in "Xx":
        reader.rows.skip("observations that others replace")
    else:
        _direction(reader.rows, text, _row(reader.rows, text, line))


def _date(text: str) -> tuple[int, float]:
    """Modified Julian Day and second of it."""
    year, month, rest = integer(text[15:19], "year"), integer(text[20:22].strip(), "month"), text[23:32].strip()
    whole, point, part = rest.partition(".")
    day = calendar_day(year, month, integer(whole, "day"))
    return day, 86400.0 * (number(f"0.{part}", "fraction of the day") if point and part else 0.0)


def _row(rows: Rows, text: str, line: int, place: int = -1) -> Row:
    day, seconds = _date(text)
    scale = "UTC" if day >= _UTC else "UT1"
    key = {"frame": "ICRF", "angles": "astrometric", "tag": "receive"}
    segment = rows.segment(("optical", scale), scale=scale, **key)
    return Row(day, seconds, text[77:80].strip(), unpack(text[:12]), segment, line, place)


def _notes(text: str, place_axes: str = "") -> dict[str, object]:
    brightness = text[65:70].strip()
    return _unseen(text) | {
        "magnitude": number(brightness, "magnitude") if brightness else math.nan,
        "band": text[70].strip(),
        "catalogue": text[71].strip(),
        "reference": text[72:77].strip(),
        "place_axes": place_axes,
    }


def _unseen(text: str) -> dict[str, object]:
    """Notes of what no telescope saw: the columns of magnitude and catalogue have numbers of the radar."""
    notes: dict[str, object] = dict.fromkeys(EXTRA, "")
    return notes | {"magnitude": math.nan, "note": text[13].strip(), "technique": text[14].strip()}


def sexagesimal(text: str, what: str) -> tuple[float, float]:
    """Hours or degrees of one to three numbers, and how much the last digit stands for; the sign leads."""
    sign = -1.0 if text.startswith("-") else 1.0
    parts = text.lstrip("+-").split()
    if not 1 <= len(parts) <= 3:
        raise ValueError(f"{what} is {text.strip()!r}; it has degrees or hours, minutes and seconds")
    value = 0.0
    for k, part in enumerate(parts):
        size = number(part, what) if k == len(parts) - 1 else float(integer(part, what))
        if size < 0.0 or (k and size >= 60.0) or not part[0].isdigit():
            raise ValueError(f"{what} is {text.strip()!r}")
        value += size / 60.0**k
    decimals = len(parts[-1].partition(".")[2])
    return sign * value, 10.0**-decimals / 60.0 ** (len(parts) - 1)


def _direction(rows: Rows, text: str, row: Row, place_axes: str = "") -> None:
    notes = _notes(text, place_axes)
    hours, fine = sexagesimal(text[32:44], "right ascension")
    degrees, finest = sexagesimal(text[44:56], "declination")
    if hours >= 24.0 or abs(degrees) > 90.0:
        raise ValueError(f"right ascension {hours:g} h or declination {degrees:g} deg is on no sphere")
    rows.add(row, "right_ascension", math.radians(15.0 * hours), _coarse(15.0 * fine), extra=notes)
    rows.add(row, "declination", math.radians(degrees), _coarse(finest), extra=notes)


def _coarse(digit: float) -> float:
    """Standard deviation in rad of what is rounded to a digit of so many degrees; NaN where others decide, from 10" down."""
    return math.nan if 3600.0 * digit <= 10.0 else 3600.0 * digit * _ARCSECOND / math.sqrt(12.0)


def _two_lines(rows: Rows, first: str, second: str, line: int) -> None:
    match first[14]:
        case "S":
            unit = {"1": 1e3, "2": AU}.get(second[32])
            if unit is None:
                raise ValueError(f"units of the satellite's place are {second[32]!r}; 1 (km) and 2 (au) are known")
            cells = (second[a : a + 11].replace(" ", "") for a in (34, 46, 58))
            x, y, z = (unit * number(cell, "place of the satellite") for cell in cells)
            axes = "GCRF"
        case "V":
            from piazzi.earth.geodetic import geodetic_to_position

            longitude, latitude = number(second[34:44].strip(), "longitude"), number(second[45:55].strip(), "latitude")
            height = number(second[56:61].strip(), "height")
            if abs(latitude) > 90.0:
                raise ValueError(f"latitude {latitude:g} deg is on no sphere")
            x, y, z = map(float, geodetic_to_position(math.radians(latitude), math.radians(longitude), height))
            axes = "ITRF"
        case _:
            _radar(rows, first, second, line)
            return
    rows.places.append((x, y, z))
    _direction(rows, first, _row(rows, first, line, len(rows.places) - 1), axes)


def _fixed(text: str, what: str) -> float:
    """A number whose decimal point stands before its last four characters and is not written; NaN for blanks."""
    whole, part = text[:-4].replace(" ", ""), text[-4:].rstrip()
    if not whole.strip("+-") and not part:
        return math.nan
    return number(f"{whole or '0'}.{part.replace(' ', '0')}", what)


def _second(text: str) -> tuple[int, float]:
    """Day and whole second of a radar, which six decimals of a day hold to 0.043 s, while delays change by 1e-4 of it."""
    day, seconds = _date(text)
    near = round(seconds)
    return (day, float(near)) if abs(seconds - near) <= _STEP and near < 86400 else (day, seconds)


def _radar(rows: Rows, first: str, second: str, line: int) -> None:
    day, seconds = _second(first)
    sender, receiver, target = first[68:71].strip(), first[77:80].strip(), unpack(first[:12])
    megahertz = _megahertz(first[62:68], second[62:68])
    point = {"S": "surface", "C": "centre of mass"}.get(second[32])
    if point is None:
        raise ValueError(f"a radar echo of {second[32]!r}; S (surface) and C (centre of mass) are known")
    scale = "UTC" if day >= _UTC else "UT1"
    segment = rows.segment(
        ("radar", scale, sender, receiver, target, megahertz, point),
        scale=scale,
        path=(sender, target, receiver),
        way="two-way" if sender == receiver else "three-way",
        range_is="sum",
        tag="receive",
        frequencies=(("transmit", 1e6 * megahertz),),
        said=(("echo", point),),
    )
    row, notes = Row(day, seconds, receiver, target, segment, line), _unseen(first)
    delay, doppler = _fixed(first[32:47], "delay"), _fixed(first[47:62], "Doppler shift")
    if math.isnan(delay) and math.isnan(doppler):
        raise ValueError("a radar observation without delay and Doppler shift")
    if not math.isnan(delay):
        rows.add(row, "time_of_flight", 1e-6 * delay, 1e-6 * _fixed(second[33:47], "uncertainty of the delay"), extra=notes)
    if not math.isnan(doppler):
        rows.add(row, "doppler", doppler, _fixed(second[47:62], "uncertainty of the Doppler shift"), extra=notes)


def _megahertz(first: str, second: str) -> float:
    """Frequency whose decimal point stands before the first line's last character; the second line goes on with it."""
    digits = (first[:5].strip() + "." + first[5:].strip() + second.strip()).rstrip(".")
    return number(digits, "frequency")
