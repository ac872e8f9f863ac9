"""What a TDM does not say: assumed where there is a custom, left open with the option that says it where there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from piazzi.formats.frames import KNOWN
from piazzi.formats.kinds import KINDS
from piazzi.formats.observations import Segment

_ALONG = ("range", "range_ru", "range_rate", "range_rate_averaged")


def assumed_of(segments: Sequence[Segment]) -> tuple[str, ...]:
    """What is assumed of segments that do not say it."""
    out = []
    if any(segment.tag is None and segment.path for segment in segments):
        out.append("times are those of reception where TIMETAG_REF is not given (--tag transmit says otherwise)")
    return tuple(out)


def open_of(segments: Sequence[Segment], present: Mapping[str, int]) -> tuple[str, ...]:
    """What only the user can say, given the kinds of rows that there are."""
    out = []
    kinds = {kind for kind, count in present.items() if count}
    closed = sorted({",".join(s.path) for s in segments if s.path and s.range_is is None})
    if closed and kinds & set(_ALONG):
        along = f"ranges and range rates along {'; '.join(closed[:3])}"
        out.append(f"whether {along} are half or all of the way: --range two-way or --range round-trip")
    if "range_ru" in kinds:
        out.append("how long a range unit of the station is: --range-unit 0.28m")
    if "range_rate_averaged" in kinds and any(s.interval is None or s.interval_reference is None for s in segments):
        out.append("over which interval range rates are averaged: --interval 60 and --interval-reference middle")
    if "right_ascension" in kinds:
        out.append("what directions are reduced to: --angles astrometric, --angles geocentric or --angles apparent")
        if any(segment.frame not in KNOWN for segment in segments):
            out.append("the axes of right ascension and declination: --frame EME2000")
    if any(c.applied is None for segment in segments for c in segment.corrections):
        out.append("whether the corrections are applied: --corrections applied or --corrections open")
    if any(dict(segment.said).get("DOPPLER_COUNT_ROLLOVER", "").upper() == "YES" for segment in segments):
        out.append("at how many cycles the Doppler counter rolled over, which the message has no keyword for")
    measured = sorted(kind for kind in kinds if not KINDS[kind].auxiliary)
    if measured:
        first = measured[0]
        out.append(f"standard deviations of {', '.join(measured)}: --sigma {first}=...{KINDS[first].unit}")
    return tuple(out)
