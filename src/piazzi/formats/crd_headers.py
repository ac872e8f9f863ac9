"""Headers of laser ranging files (CRD): who ranged, to what, when, and what has been applied to the flight times already.

Source: Consolidated Laser Ranging Data Format, versions 1.01 (2009) and 2.01 (2019), International Laser Ranging Service.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from piazzi.formats.fields import calendar_day, integer

RANGE_TYPES = ("transmit times only", "one-way", "two-way", "receive times only", "mixed")
KINDS = ("full rate", "normal points", "sampled engineering")
CORRECTIONS = ("troposphere", "centre of mass", "receive amplitude", "station delay", "spacecraft delay")
QUALITY = ("good", "suspect", "poor")
# what the time tag of a row is of (field "epoch event"), and how many legs its flight time has
EVENTS = ("reception", "bounce", "transmission", "arrival", "departure", "transmission and arrival", "departure and reception")
ONE_WAY = 3  # the first event of a one-way range


@dataclass(frozen=True)
class Station:
    """H2: the number of the pad, which names the station, and which system stood on it."""

    name: str
    pad: str
    system: str = ""
    occupancy: str = ""
    clock: int = 0  # 3 UTC(USNO), 4 UTC(GPS), 7 UTC(BIPM), 10 the station's own UTC


@dataclass(frozen=True)
class Target:
    """H3: the object and its numbers; `cospar` as 1992-070B."""

    name: str
    cospar: str
    sic: str = ""
    norad: str = ""
    transponder: bool = False


@dataclass(frozen=True)
class Session:
    """H4: one pass, and what was done to its flight times.

    Attributes
    ----------
    start, end : Modified Julian Day and second of it, in UTC; the end is None where the file leaves it open
    release : 0 first, then 1, 2, ...; a later one takes the place of an earlier one
    applied : those of `CORRECTIONS` that the values contain already
    """

    station: Station
    target: Target
    version: int
    kind: str
    start: tuple[int, float]
    end: tuple[int, float] | None
    release: int
    applied: tuple[str, ...]
    range_type: str
    quality: str
    line: int
    wavelengths: dict[str, float] = field(default_factory=dict)  # C0: by configuration, in metres
    configuration: dict[str, tuple[str, ...]] = field(default_factory=dict)  # C0 to C7, by record and name: the fields
    prediction: str = ""  # H5

    @property
    def seconds(self) -> float:
        """Length in seconds; that of half a day where the end is not known."""
        if self.end is None:
            return 43200.0
        return (self.end[0] - self.start[0]) * 86400.0 + self.end[1] - self.start[1]


def read_version(fields: Sequence[str]) -> int:
    """H1: the version, 1 or 2."""
    if len(fields) < 3 or fields[1].upper() != "CRD":
        raise ValueError(f"H1 says {fields[1] if len(fields) > 1 else ''!r}, not CRD")
    version = integer(fields[2], "version in H1")
    if version not in (1, 2):
        raise ValueError(f"CRD version {version} is not known; 1 and 2 are")
    return version


def read_station(fields: Sequence[str]) -> Station:
    """H2; the name may be missing of it where a station has none."""
    if len(fields) < 6:
        raise ValueError(f"H2 has {len(fields)} fields; it needs name, pad, system, occupancy and time scale")
    clock = integer(fields[5], "time scale in H2")
    if not fields[2].isalnum():
        raise ValueError(f"pad {fields[2]!r} in H2 is no number of a station")
    return Station(fields[1], fields[2], fields[3], fields[4], clock)


def read_target(fields: Sequence[str]) -> Target:
    """H3; a target that has no SIC, or no NORAD number, as reflectors on the Moon, may have neither 0 nor na there."""
    if len(fields) in (5, 6) and all(len(text) == 1 and text.isdecimal() for text in fields[-2:]):
        fields = [*fields[:-2], *("" for _ in range(7 - len(fields))), *fields[-2:]]
    if len(fields) < 7:
        raise ValueError(f"H3 has {len(fields)} fields; it needs target, COSPAR, SIC, NORAD, time scale and class")
    return Target(fields[1], cospar(fields[2]), fields[3], fields[4], fields[6] in ("3", "4"))


def cospar(code: str) -> str:
    """International designator of the number in laser files: 9207002 is 1992-070B; any other text as it is."""
    if not (code.isdecimal() and code.isascii() and 5 <= len(code) <= 7):
        return code
    year, launch, piece = int(code[:-5] or 0), code[-5:-2], int(code[-2:])
    letters = ""
    while piece > 0:
        piece, letter = divmod(piece - 1, 24)
        letters = "ABCDEFGHJKLMNPQRSTUVWXYZ"[letter] + letters  # I and O are not used
    return f"{year + (1900 if year >= 57 else 2000)}-{launch}{letters}"


def read_session(fields: Sequence[str], version: int, station: Station, target: Target, line: int) -> Session:
    """H4."""
    if len(fields) < 21:
        raise ValueError(f"H4 has {len(fields)} fields; it needs 21")
    kind, release = integer(fields[1], "data type in H4"), integer(fields[14], "release in H4")
    flags = [integer(text, f"{name} in H4") for name, text in zip(CORRECTIONS, fields[15:20], strict=True)]
    ranges, quality = integer(fields[20], "range type in H4"), integer(fields[21], "quality in H4") if len(fields) > 21 else 0
    for value, known, name in ((kind, KINDS, "data type"), (ranges, RANGE_TYPES, "range type"), (quality, QUALITY, "quality")):
        if not 0 <= value < len(known):
            raise ValueError(f"{name} {value} in H4 is not known; 0 to {len(known) - 1} are")
    if any(flag not in (0, 1) for flag in flags):
        raise ValueError("a correction in H4 is neither 0 (not applied) nor 1 (applied)")
    start = _instant(fields[2:8])
    end = None if any(text.lower() in ("-1", "na", "-na") for text in fields[8:14]) else _instant(fields[8:14])
    if end is not None and end < start:
        raise ValueError("the pass in H4 ends before it begins")
    applied = tuple(name for name, flag in zip(CORRECTIONS, flags, strict=True) if flag)
    what = KINDS[kind], start, end, release, applied, RANGE_TYPES[ranges], QUALITY[quality]
    return Session(station, target, version, *what, line)


def _instant(fields: Sequence[str]) -> tuple[int, float]:
    year, month, day, hour, minute, second = (integer(text, "date in H4") for text in fields)
    if not (0 <= hour <= 24 and 0 <= minute <= 59 and 0 <= second <= 60):
        raise ValueError(f"{hour}:{minute}:{second} in H4 is no time of a day")
    return calendar_day(year, month, day), 3600.0 * hour + 60.0 * minute + second
