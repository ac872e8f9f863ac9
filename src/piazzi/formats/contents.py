"""What is in observations, as one object: kinds, stations, passes, gaps, conventions, what is assumed and what is open."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.formats.kinds import KINDS, TAGS
from piazzi.formats.observations import Observations, Segment
from piazzi.formats.passes import numbered

SCHEMA = "piazzi.tracking/1"
LEAST_GAP = 600.0  # s, of times in which nobody measured anything
GAPS = 10


def summary(observations: Observations) -> dict[str, Any]:
    """What is in observations, as JSON has it: dates with their scale, SI units, None where there is no number."""
    rows = observations
    order = np.argsort(rows.t, kind="stable")
    ends = [_date(rows, int(order[i])) for i in (0, -1)] if len(rows) else [None, None]
    measured = rows[rows.measured]
    return {
        "schema": SCHEMA,
        "files": list(rows.files),
        "rows": len(rows),
        "measurements": len(measured),
        "first": ends[0],
        "last": ends[1],
        "seconds": float(np.ptp(rows.t)) if len(rows) else None,
        "scales": list(rows.scales),
        "objects": list(rows.objects),
        "stations": list(rows.stations),
        "kinds": [_kind(rows, name) for name in rows.kinds if rows.of_kind(name).any()],
        "passes": list(passes(measured)),
        "gaps": list(_gaps(measured)),
        "out_of_order": int(np.count_nonzero(np.diff(rows.t) < 0)),
        "repeated": _repeated(rows),
        "not_to_be_used": int(np.count_nonzero(~rows.used)),
        "conventions": _conventions(rows),
        "assumed": list(rows.assumed),
        "open": list(rows.open),
        "left_out": [{"reason": reason, "count": count} for reason, count in rows.left_out],
    }


def _date(rows: Observations, row: int) -> str:
    """When a row was measured, in the scale of its file."""
    return rows.instant(row).to(rows.segments[int(rows.segment[row])].scale, digits=6)


def _kind(rows: Observations, name: str) -> dict[str, Any]:
    own = rows.of_kind(name)
    values, sigmas = rows.value[own], rows.sigma[own]
    known = sigmas[~np.isnan(sigmas)]
    return {
        "kind": name,
        "unit": KINDS[name].unit,
        "auxiliary": KINDS[name].auxiliary,
        "rows": int(np.count_nonzero(own)),
        "least": _finite(np.nanmin(values)) if not np.isnan(values).all() else None,
        "greatest": _finite(np.nanmax(values)) if not np.isnan(values).all() else None,
        "sigmas": len(known),
        "median_sigma": _finite(np.median(known)) if len(known) else None,
        "stations": [rows.participants[i] for i in distinct(rows.station[own]) if i >= 0],
    }


def _finite(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def passes(rows: Observations) -> Iterator[dict[str, Any]]:
    """Passes of each object over each station in order of time, as `numbered` parts them."""
    found: list[tuple[float, dict[str, Any]]] = []
    pairs = rows.station.astype(np.int64) * (len(rows.participants) + 2) + rows.object
    number = numbered(rows.t, pairs, rows.segment)
    order = np.lexsort([rows.t, number])
    for part in np.split(order, np.flatnonzero(np.diff(number[order])) + 1) if len(rows) else []:
        first, last = int(part[0]), int(part[-1])
        one = {
            "station": _name(rows, rows.station[first]), "object": _name(rows, rows.object[first]),
            "first": _date(rows, first), "last": _date(rows, last), "seconds": float(rows.t[last] - rows.t[first]),
            "rows": len(part), "kinds": [rows.kinds[i] for i in distinct(rows.kind[part])],
        }  # fmt: skip
        found.append((float(rows.t[first]), one))
    yield from (one for _, one in sorted(found, key=lambda pair: pair[0]))


def _name(rows: Observations, index: Any) -> str | None:
    return rows.participants[int(index)] if index >= 0 else None


def _gaps(rows: Observations) -> Iterator[dict[str, Any]]:
    """The longest times in which nobody measured anything, the longest first."""
    order = np.argsort(rows.t, kind="stable")
    steps = np.diff(rows.t[order])
    for k in np.argsort(-steps, kind="stable")[:GAPS]:
        if steps[k] > LEAST_GAP:
            yield {"after": _date(rows, int(order[k])), "seconds": float(steps[k])}


def _repeated(rows: Observations) -> int:
    """How many rows are of the same time, kind, station, object and participant as another one before."""
    if not len(rows):
        return 0
    keys: list[Array] = [rows.t, rows.kind, rows.station, rows.object, rows.participant]
    order = np.lexsort(keys[::-1])
    same = np.ones(len(rows) - 1, dtype=np.bool_)
    for key in keys:
        same &= key[order][1:] == key[order][:-1]
    return int(np.count_nonzero(same))


def _conventions(rows: Observations) -> list[dict[str, Any]]:
    """Conventions of segments, those that are the same once, with the number of their rows."""
    counts = np.bincount(rows.segment, minlength=len(rows.segments))
    tags = _tags(rows)
    found: dict[str, dict[str, Any]] = {}
    for i, segment in enumerate(rows.segments):
        if counts[i]:
            told = _stated(segment) | {"tag": segment.tag or tags[i]}
            told = {name: value for name, value in told.items() if value not in (None, [], {})}
            one = found.setdefault(repr(told), told | {"segments": 0, "rows": 0})
            one["segments"] += 1
            one["rows"] += int(counts[i])
    return list(found.values())


def _tags(rows: Observations) -> list[str | None]:
    """What the times of each segment's rows are, where that is the same for all."""
    seen = (
        np.unique(np.stack([rows.segment, rows.tag.astype(np.int32)], axis=1), axis=0) if len(rows) else np.zeros((0, 2), int)
    )
    out: list[str | None] = [None] * len(rows.segments)
    alone = np.bincount(seen[:, 0], minlength=len(out)) == 1
    for i, tag in seen.tolist():
        out[i] = TAGS[tag] or None if alone[i] else None
    return out


def _stated(segment: Segment) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for field in fields(segment):
        value = getattr(segment, field.name)
        if field.name == "corrections":
            value = [{"name": c.name, "value": c.value, "applied": c.applied} for c in value]
        elif field.name in ("frequencies", "delays"):
            value = dict(value)
        elif isinstance(value, tuple):
            value = list(value)
        if field.name != "said":
            out[field.name] = value
    return out
