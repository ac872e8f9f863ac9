"""Observations as a Tracking Data Message (CCSDS 503.0-B-2, KVN)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.formats.kinds import TAGS
from piazzi.formats.observations import Observations, Segment
from piazzi.formats.tdm_keywords import ANGLE_KINDS, CORRECTIONS, DEGREE, LIGHT, METADATA, OF_PARTICIPANT, PLAIN, RANGE_FACTORS
from piazzi.formats.writing import dates, in_unit, now, plain

_OF_KIND = {quantity.kind: keyword for keyword, quantity in PLAIN.items()}
_OF_INDEXED = {quantity.kind: keyword for keyword, quantity in OF_PARTICIPANT.items()}
_ANGLE_TYPE = {kind: (name, place + 1) for name, kinds in ANGLE_KINDS.items() for place, kind in enumerate(kinds)}
_UNITS = {"range": "km", "range_ru": "RU", "time_of_flight": "s"}


def tdm_text(observations: Observations, *, originator: str = "PIAZZI", created: str | None = None) -> str:
    """A TDM of all rows; sigmas and weather of single rows have no place in the format and are left out.

    Rows of one segment, station and object stand in one segment of the message, which has one type of angles.

    Raises
    ------
    ValueError
        For no rows, and for kinds that the format has no keyword for.
    """
    if not len(observations):
        raise ValueError("there are no rows to write")
    odd = [kind for kind in observations.kinds if observations.of_kind(kind).any() and not _known(kind)]
    if odd:
        raise ValueError(f"a TDM has no keyword for {', '.join(odd)}")
    lines = ["CCSDS_TDM_VERS = 2.0", f"CREATION_DATE = {created or now()}", f"ORIGINATOR = {plain(originator)}"]
    for rows in _groups(observations):
        lines += _segment(observations[rows])
    return "\n".join(lines) + "\n"


def _known(kind: str) -> bool:
    return kind in _OF_KIND or kind in _OF_INDEXED or kind in _ANGLE_TYPE or kind in _UNITS


def _groups(observations: Observations) -> Iterator[Array]:
    """Indices of rows that go into one segment, those segments in the order in which their first rows come."""
    keys = np.stack([observations.segment, observations.station, observations.object], axis=1)
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(group.reshape(-1), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(group.reshape(-1)))[:-1])
    for g in np.argsort(first):
        own = groups[g]
        part = _parts([observations.kinds[i] for i in distinct(observations.kind[own])], observations.kinds)
        parts = part[observations.kind[own]]
        for p in distinct(parts):
            yield own[parts == p]


def _parts(present: Sequence[str], kinds: Sequence[str]) -> Array:
    """For each kind, which segment of the message its rows go into: one has one type of angles and one unit of ranges."""
    angles = list(dict.fromkeys(_ANGLE_TYPE[kind][0] for kind in present if kind in _ANGLE_TYPE))
    units = list(dict.fromkeys(_UNITS[kind] for kind in present if kind in _UNITS))
    out = np.zeros(len(kinds), dtype=np.int64)
    for i, kind in enumerate(kinds):
        if kind in _ANGLE_TYPE and _ANGLE_TYPE[kind][0] in angles:
            out[i] = angles.index(_ANGLE_TYPE[kind][0])
        elif kind in _UNITS and _UNITS[kind] in units:
            out[i] = units.index(_UNITS[kind])
    return out


def _segment(rows: Observations) -> Iterator[str]:
    segment = rows.segments[int(rows.segment[0])]
    kinds = [kind for kind in rows.kinds if rows.of_kind(kind).any()]
    unit = next((_UNITS[kind] for kind in kinds if kind in _UNITS), "")
    said = dict(segment.said)
    if unit == "km" and said.get("RANGE_UNITS", "").lower() == "s":
        unit = "s"
    yield "META_START"
    names = _participants(rows, segment)
    meta = {key: text for key, text in said.items() if key in METADATA and text} | _metadata(rows, segment, names, kinds, unit)
    yield from (f"{keyword} = {plain(text)}" for keyword, text in meta.items())
    yield from ("META_STOP", "DATA_START")
    yield from _data(rows, segment, names, unit, float(meta.get("DOPPLER_COUNT_SCALE", "1")))
    yield "DATA_STOP"


def _participants(rows: Observations, segment: Segment) -> list[str]:
    if segment.participants:
        return list(segment.participants)
    found = [rows.participants[i] for i in (int(rows.station[0]), int(rows.object[0])) if i >= 0]
    return found or ["UNKNOWN"]


def _metadata(rows: Observations, segment: Segment, names: list[str], kinds: list[str], unit: str) -> dict[str, str]:
    """Metadata that the columns and the segment give, by keyword."""
    out = {"TIME_SYSTEM": segment.scale} | {f"PARTICIPANT_{i + 1}": name for i, name in enumerate(names)}
    paths = [path for path in (segment.path, segment.second_path) if path]
    if not paths and len(names) > 1 and segment.way in ("one-way", "two-way"):
        paths = [(names[1], names[0]) if segment.way == "one-way" else (names[0], names[1], names[0])]
    out |= {"MODE": segment.mode.upper()} if segment.mode else {"MODE": "SEQUENTIAL"} if paths else {}
    for keyword, path in zip(("PATH",) if len(paths) == 1 else ("PATH_1", "PATH_2"), paths, strict=False):
        out[keyword] = ",".join(str(names.index(name) + 1) for name in path)
    tags = {TAGS[i] for i in distinct(rows.tag)}
    if segment.tag in ("transmit", "receive") or tags == {"transmit"}:
        out["TIMETAG_REF"] = (segment.tag or "transmit").upper()
    elif segment.tag == "bounce" or "bounce" in tags:
        raise ValueError("a TDM cannot say that times are those of the bounce")
    numbers = {"INTEGRATION_INTERVAL": segment.interval, "FREQ_OFFSET": dict(segment.frequencies).get("offset")}
    words = {"INTEGRATION_REF": segment.interval_reference, "RANGE_MODE": segment.range_mode, "DATA_QUALITY": segment.quality}
    out |= {key: repr(value) for key, value in numbers.items() if value is not None}
    out |= {key: word.upper() for key, word in words.items() if word is not None}
    if unit:
        out["RANGE_UNITS"] = unit
        if segment.range_modulus:
            out["RANGE_MODULUS"] = repr(float(in_unit(segment.range_modulus, RANGE_FACTORS[unit])))
    angles = next((_ANGLE_TYPE[kind][0] for kind in kinds if kind in _ANGLE_TYPE), None)
    out |= {"ANGLE_TYPE": angles} if angles else {}
    out |= {"REFERENCE_FRAME": segment.frame} if segment.frame else {}
    return out | _corrections(segment, unit) | _delays(segment, names)


def _corrections(segment: Segment, unit: str) -> dict[str, str]:
    out: dict[str, str] = {}
    for name, value, applied in segment.corrections:
        factor = CORRECTIONS.get(name.upper(), 0.0)
        factor = RANGE_FACTORS[unit or "km"] if factor is None else factor
        if factor and value is not None:
            out[f"CORRECTION_{name.upper()}"] = repr(float(in_unit(value, factor)))
            if applied is not None:
                out["CORRECTIONS_APPLIED"] = "YES" if applied else "NO"
    return out


def _delays(segment: Segment, names: list[str]) -> dict[str, str]:
    out = {}
    for what, value in segment.delays:
        event, _, name = what.partition(" ")
        if name in names:
            out[f"{event.upper()}_DELAY_{names.index(name) + 1}"] = repr(value)
    return out


def _data(rows: Observations, segment: Segment, names: list[str], unit: str, count_scale: float) -> Iterator[str]:
    """Lines of data in the order of the rows."""
    texts = np.empty(len(rows), dtype=object)
    keywords = np.empty(len(rows), dtype=object)
    for kind in rows.kinds:
        own = np.flatnonzero(rows.of_kind(kind))
        if not len(own):
            continue
        keyword, factor, offset = _quantity(kind, segment, unit, count_scale)
        texts[own] = [repr(value) for value in in_unit(rows.value[own], factor, offset).tolist()]
        keywords[own] = keyword
        if kind in _OF_INDEXED:
            places = [names.index(rows.participants[i]) + 1 if i >= 0 else 0 for i in rows.participant[own].tolist()]
            station = names.index(rows.participants[rows.station[0]]) + 1 if rows.station[0] >= 0 else 1
            whole = {0: keyword if kind in _OF_KIND else f"{_OF_INDEXED[kind]}_{station}"}
            keywords[own] = [whole.get(place, f"{_OF_INDEXED[kind]}_{place}") for place in places]
    for keyword, when, text in zip(keywords, dates(segment.scale, rows.epoch, rows.t), texts, strict=True):
        yield f"{keyword} = {when} {text}"


def _quantity(kind: str, segment: Segment, unit: str, count_scale: float) -> tuple[str, float, float]:
    """Keyword of a kind, and factor and offset of its numbers."""
    if kind in _UNITS:
        return "RANGE", 1.0 if kind == "time_of_flight" else LIGHT if unit == "s" else RANGE_FACTORS[unit], 0.0
    if kind in _ANGLE_TYPE:
        return f"ANGLE_{_ANGLE_TYPE[kind][1]}", DEGREE, 0.0
    offset = dict(segment.frequencies).get("offset", 0.0) if kind == "receive_frequency" else 0.0
    if kind == "doppler_count":
        return "DOPPLER_COUNT", 1.0 / count_scale, 0.0
    keyword = _OF_KIND.get(kind, "")
    return keyword, PLAIN[keyword].factor if keyword else 1.0, offset
