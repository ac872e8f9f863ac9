"""What orbit messages have in common: metadata, units, covariances, and arcs made of them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch
from piazzi.earth.scales import UTC_BEGINS
from piazzi.formats.dates import instants, read_dates
from piazzi.formats.ephemeris import Arc
from piazzi.formats.frames import KNOWN, frame_named
from piazzi.formats.ndm import Item, Source, known, needed, shown, single
from piazzi.formats.odm_keywords import COVARIANCE, OEM_META, SPACECRAFT
from piazzi.units import Units

_POWERS = str.maketrans({"×": "*", "·": "*", "²": "**2", "³": "**3", "⁴": "**4", "⁻": "**-", "¹": "1"})


class Block(NamedTuple):
    """A covariance of a file: its time, its axes or "", 21 numbers in km and s, and its line."""

    date: str
    frame: str
    numbers: Sequence[float]
    line: int


def in_si(source: Source, item: Item, unit: str) -> float:
    """The number of an item in SI, by the unit of the message or by one of the same kind that is written beside it."""
    value = source.number(item)
    stated = item.unit.strip()
    if stated in ("", unit, "n/a"):
        return value * Units().unit(unit or "1").factor
    expected = Units().unit(unit or "1")
    try:
        found = Units().unit(re.sub(r"\*\*-(?:\*\*)?", "**-", stated.translate(_POWERS)).replace(".", "*"))
    except ValueError:
        found = None
    if found is None or found.powers != expected.powers:
        source.refuse(item.line, f"{item.keyword} is in [{shown(stated)[1:-1]}]; it must be in [{unit or '1'}]")
    return value * found.factor


def spacecraft_of(source: Source, found: Mapping[str, Item]) -> tuple[tuple[str, float], ...]:
    """Mass, areas and coefficients, by our names, in SI."""
    return tuple((name, in_si(source, found[k], unit)) for k, (name, unit) in SPACECRAFT.items() if k in found)


def centre_named(text: str) -> str:
    """Name of a body in capitals, with single blanks."""
    return " ".join(text.upper().split())


def covariance_of(source: Source, found: Mapping[str, Item], line: int) -> Array | None:
    """The 6 by 6 matrix in SI that 21 items give, None where there are none."""
    given = [keyword for keyword in COVARIANCE if keyword in found]
    if not given:
        return None
    needed(source, dict(found), COVARIANCE, "the covariance", line)
    units = {2: "km**2", 1: "km**2/s", 0: "km**2/s**2"}
    places = [(i, j) for i in range(6) for j in range(i + 1)]
    values = [
        in_si(source, found[keyword], units[(i < 3) + (j < 3)]) for keyword, (i, j) in zip(COVARIANCE, places, strict=True)
    ]
    return full_matrix(np.array(values))


def full_matrix(lower: Array) -> Array:
    """Symmetric matrices (..., 6, 6) of their lower triangles (..., 21)."""
    i, j = np.tril_indices(6)
    out = np.zeros((*lower.shape[:-1], 6, 6))
    out[..., i, j] = lower
    out[..., j, i] = lower
    return out


def metadata_of(source: Source, items: Sequence[Item], line: int) -> dict[str, Item]:
    """Metadata of an OEM's segment by keyword, looked over."""
    for item in items:
        known(source, item, OEM_META, "the metadata of an OEM")
    found = single(source, items, "the metadata of a segment")
    needed(source, found, ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM"), "the metadata", line)
    return found


def about(source: Source, found: Mapping[str, Item]) -> dict[str, Any]:
    """What `Arc` and `MeanElements` say about object, centre, axes and time scale."""
    scale = source.scale(found["TIME_SYSTEM"])
    return {
        "name": found["OBJECT_NAME"].text, "identifier": found["OBJECT_ID"].text, "scale": scale,
        "centre": centre_named(found["CENTER_NAME"].text), "frame": frame_named(found["REF_FRAME"].text),
    }  # fmt: skip


def arc_of(
    source: Source, found: Mapping[str, Item], dates: Array, numbers: Array, lines: Array, blocks: Sequence[Block]
) -> Arc:
    """The arc of a segment: dates (K,) of bytes, numbers (K, 9) in km and s with NaN for no accelerations, and covariances."""
    who = about(source, found)
    scale = who["scale"]
    readings, bad = read_dates(dates)
    bad |= (readings.day < UTC_BEGINS) & (scale == "UTC")
    if bad.any():
        i = int(np.argmax(bad))
        source.refuse(int(lines[i]), f"{shown(dates[i].decode('utf-8', 'replace'))} is no date of {scale}")
    epoch, t = instants(scale, readings)
    back = np.flatnonzero(np.diff(t) < 0)
    if len(back):
        source.refuse(int(lines[back[0] + 1]), "the state is before the one above it: those of a segment go with time")
    optional: dict[str, Any] = {}
    if not np.isnan(numbers[:, 6:]).all():
        optional["acceleration"] = numbers[:, 6:] * 1e3
    if "REF_FRAME_EPOCH" in found:
        optional["frame_epoch"] = source.date(found["REF_FRAME_EPOCH"], scale)
    if "INTERPOLATION_DEGREE" in found:
        optional["degree"] = source.whole(found["INTERPOLATION_DEGREE"])
    spans = {
        keyword: source.date(found[keyword], scale) for keyword in OEM_META if keyword.endswith("_TIME") and keyword in found
    }
    if blocks:
        optional |= _covariances(source, blocks, epoch, scale, who["frame"])
    return Arc(
        epoch=epoch, t=t, position=numbers[:, :3] * 1e3, velocity=numbers[:, 3:6] * 1e3, lines=lines, **who, **optional,
        interpolation=found["INTERPOLATION"].text.lower() if "INTERPOLATION" in found else None,
        useable=(spans.get("USEABLE_START_TIME"), spans.get("USEABLE_STOP_TIME")),
        said=tuple((keyword, item.text) for keyword, item in found.items()),
    )  # fmt: skip


def _covariances(source: Source, blocks: Sequence[Block], epoch: Epoch, scale: str, frame: str) -> dict[str, Any]:
    times = [source.date(Item("EPOCH", block.date, block.line), scale) - epoch for block in blocks]
    return {
        "covariance_t": np.array(times),
        "covariance": full_matrix(np.array([block.numbers for block in blocks]) * 1e6),
        "covariance_frames": tuple(frame_named(block.frame) if block.frame else frame for block in blocks),
    }


def unknown_axes(names: Sequence[str | None]) -> tuple[str, ...]:
    """What is open about axes that nobody knows by their name."""
    odd = sorted({name for name in names if name and name not in KNOWN})
    return tuple(f"axes {name} have no meaning here: --frame names those that they are" for name in odd)


def one_system(source: Source, first: Item, item: Item) -> None:
    """Refuse a message whose segments have different time systems."""
    if item.text.upper() != first.text.upper():
        before = f"{first.text} in line {first.line}"
        source.refuse(item.line, f"TIME_SYSTEM is {shown(item.text)}, and {before}: a message has one time system")
