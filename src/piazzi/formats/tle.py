"""Two-line element sets, with or without a line of the name before each: mean elements of the SGP4 theory.

Columns as of the NORAD format (Space Track Report No. 3, 1980).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from piazzi.earth import Epoch
from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Ephemeris, MeanElements
from piazzi.formats.ndm import Source

LENGTH = 69
_DEGREE, _DAY = np.pi / 180.0, 86400.0


def read(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The mean elements of every set in a file; ValueError with file, line and reason."""
    lines = [(k + 1, text.rstrip()) for k, text in enumerate(data.decode("ascii", "replace").splitlines()) if text.strip()]
    return Ephemeris(arcs=(), mean=tuple(_sets(Source(name), lines)), file=name, format="TLE")


def _sets(source: Source, lines: list[tuple[int, str]]) -> Iterator[MeanElements]:
    title, at = "", 0
    while at < len(lines):
        number, text = lines[at]
        if not text.startswith(("1 ", "2 ")):
            title, at = text.removeprefix("0 ").strip(), at + 1
            continue
        if not text.startswith("1 "):
            source.refuse(number, "a line 2 without a line 1 before it")
        if at + 1 == len(lines) or not lines[at + 1][1].startswith("2 "):
            source.refuse(number, "no line 2 follows this line 1")
        for k, line in lines[at : at + 2]:
            _check(source, k, line)
        yield _elements(source, title, lines[at], lines[at + 1])
        title, at = "", at + 2
    if title:
        source.refuse(lines[-1][0], "a name without elements after it")


def _check(source: Source, number: int, line: str) -> None:
    """Refuse a line of another length or with another checksum: digits, and 1 for each minus sign, modulo 10."""
    if len(line) != LENGTH:
        source.refuse(number, f"the line has {len(line)} characters; a line of a two-line element set has {LENGTH}")
    total = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10
    if line[-1] != str(total):
        source.refuse(number, f"the checksum is {line[-1]!r}, and that of the line is {total}")


def _elements(source: Source, title: str, first: tuple[int, str], second: tuple[int, str]) -> MeanElements:
    (k1, one), (k2, two) = first, second
    if one[2:7] != two[2:7]:
        source.refuse(k2, f"line 2 is of object {two[2:7]}, and line 1 of {one[2:7]}")
    values = [
        _number(source, k2, what, text)
        for what, text in (
            ("mean motion", two[52:63]), ("eccentricity", "." + two[26:33].replace(" ", "0")), ("inclination", two[8:16]),
            ("ascending node", two[17:25]), ("argument of perigee", two[34:42]), ("mean anomaly", two[43:51]),
        )
    ]  # fmt: skip
    names = ("mean_motion", "eccentricity", "inclination", "ascending_node", "argument_of_pericentre", "mean_anomaly")
    factors = (2.0 * np.pi / _DAY, 1.0, _DEGREE, _DEGREE, _DEGREE, _DEGREE)
    said = {
        "NORAD_CAT_ID": _catalogue(source, k1, one[2:7]), "CLASSIFICATION_TYPE": one[7].strip() or "U",
        "EPHEMERIS_TYPE": one[62].strip() or "0", "ELEMENT_SET_NO": one[64:68].strip(), "REV_AT_EPOCH": two[63:68].strip(),
        "BSTAR": repr(_exponential(source, k1, "drag term", one[53:61])),
        "MEAN_MOTION_DOT": repr(_number(source, k1, "first derivative of the mean motion", one[33:43])),
        "MEAN_MOTION_DDOT": repr(_exponential(source, k1, "second derivative of the mean motion", one[44:52])),
    }  # fmt: skip
    designator = one[9:17].strip()
    year = int(designator[:2]) if designator[:2].isdigit() else None
    full = "" if year is None else f"{1900 + year if year >= 57 else 2000 + year}-{designator[2:]}"
    return MeanElements(
        epoch=_epoch(source, k1, one[18:32]), theory="SGP4", name=title or said["NORAD_CAT_ID"], identifier=full,
        centre="EARTH", frame="TEME", scale="UTC", said=tuple((k, v) for k, v in said.items() if v),
        elements=tuple((n, v * f) for n, v, f in zip(names, values, factors, strict=True)),
    )  # fmt: skip


def _catalogue(source: Source, number: int, text: str) -> str:
    """Number of an object in the catalogue; beyond 99999 its first digits are a letter, A for 10, without I and O (alpha-5)."""
    found = re.fullmatch(r"([A-HJ-NP-Z]?)(\d{4})|( *\d{1,5})", text, re.ASCII)
    if not found:
        source.refuse(number, f"the object is {text!r}; it must be five digits, or a letter other than I and O and four")
    if not found[1]:
        return text.strip()
    return f"{10 + 'ABCDEFGHJKLMNPQRSTUVWXYZ'.index(found[1])}{found[2]}"


def _epoch(source: Source, number: int, text: str) -> Epoch:
    import erfa

    if not re.fullmatch(r"\d\d[ \d]{3}\.\d+ *", text, re.ASCII):
        source.refuse(number, f"the epoch is {text!r}; it must be a year of two digits and a day with its fraction")
    year = int(text[:2])
    whole, _, fraction = text[2:].strip().partition(".")
    start = erfa.cal2jd(1900 + year if year >= 57 else 2000 + year, 1, 1)[1] + 2400000.5
    if not 1 <= int(whole) <= 366:
        source.refuse(number, f"the day of the epoch is {int(whole)}; a year has 366 at most")
    return Epoch.from_jd(start + int(whole) - 1.0, float("0." + fraction), "UTC")


def _number(source: Source, number: int, what: str, text: str) -> float:
    if not re.fullmatch(r"\s*[+-]?(\d+\.?\d*|\.\d+)\s*", text, re.ASCII):
        source.refuse(number, f"the {what} is {text!r}; it must be a number")
    return float(text)


def _exponential(source: Source, number: int, what: str, text: str) -> float:
    """A number such as `` 12345-4``, which is 0.12345e-4."""
    found = re.fullmatch(r"([ +-])\s*(\d{1,5})([ +-]\d)", text, re.ASCII)
    if not found:
        source.refuse(number, f"the {what} is {text!r}; it must be a number as in 12345-4")
    return float(f"{found[1].strip()}0.{found[2]}e{found[3].replace(' ', '+')}")


def tle_text(mean: MeanElements) -> str:
    """Two-line elements of mean elements of SGP4, with a line of the name where there is one.

    Raises
    ------
    ValueError
        Where there is no mean motion, or a value does not fit into its columns.
    """
    values, said = dict(mean.elements), dict(mean.said)
    if "mean_motion" not in values:
        raise ValueError(f"mean elements of {mean.called} have no mean motion, which two-line elements hold")
    _, day, seconds, fraction = mean.epoch.reading("UTC")
    year, since = _year_and_day(day)
    number = said.get("NORAD_CAT_ID", "").rjust(5, "0")[:5]
    designator = mean.identifier[2:].replace("-", "", 1) if len(mean.identifier) > 5 else ""
    part = (seconds + fraction) / _DAY
    first = (
        f"1 {number}{said.get('CLASSIFICATION_TYPE', 'U')[:1]} {designator[:8]:<8} {year % 100:02d}{since + part:012.8f} "
        f"{_small(float(said.get('MEAN_MOTION_DOT', 0.0)))} {_power(float(said.get('MEAN_MOTION_DDOT', 0.0)))} "
        f"{_power(float(said.get('BSTAR', 0.0)))} {said.get('EPHEMERIS_TYPE', '0')[:1]} {said.get('ELEMENT_SET_NO', '0'):>4}"
    )
    degrees = {name: value / _DEGREE for name, value in values.items()}
    second = (
        f"2 {number} {degrees['inclination']:8.4f} {degrees['ascending_node'] % 360.0:8.4f} "
        f"{round(values['eccentricity'] * 1e7):07d} {degrees['argument_of_pericentre'] % 360.0:8.4f} "
        f"{degrees['mean_anomaly'] % 360.0:8.4f} {values['mean_motion'] * _DAY / (2.0 * np.pi):11.8f}"
        f"{said.get('REV_AT_EPOCH', '0'):>5}"
    )
    for line in (first, second):
        if len(line) != LENGTH - 1:
            raise ValueError(f"mean elements of {mean.called} do not fit into two-line elements: {line}")
    lines = [f"{line}{sum(int(c) if c.isdigit() else c == '-' for c in line) % 10}" for line in (first, second)]
    return "\n".join([*([mean.name] if mean.name else []), *lines]) + "\n"


def _year_and_day(day: float) -> tuple[int, int]:
    """The year of a day (MJD), and which day of it that is, from 1."""
    import erfa

    year = int(erfa.jd2cal(2400000.5, day)[0])
    return year, int(day - erfa.cal2jd(year, 1, 1)[1]) + 1


def _small(value: float) -> str:
    """A number below 1 as `` .00000023``."""
    return f"{'-' if value < 0 else ' '}{abs(value):.8f}".replace("0.", ".", 1)


def _power(value: float) -> str:
    """A number such as 0.12345e-4 as `` 12345-4``."""
    if value == 0.0:
        return " 00000-0"
    digits, exponent = f"{abs(value):.4e}".split("e")
    return f"{'-' if value < 0 else ' '}{digits.replace('.', '')}{int(exponent) + 1:+d}"
