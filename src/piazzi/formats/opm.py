"""Orbit Parameter Messages and Orbit Mean Elements Messages (CCSDS 502.0-B-2 and B-3) as text (KVN)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from piazzi.formats.conventions import Conventions
from piazzi.formats.ephemeris import Arc, Burn, Ephemeris, MeanElements
from piazzi.formats.frames import frame_named
from piazzi.formats.ndm import Item, Source, key_value, known, lines_of, needed, single
from piazzi.formats.odm import about, covariance_of, in_si, spacecraft_of, unknown_axes
from piazzi.formats.odm_keywords import ELEMENTS, MANOEUVRE, OMM, OPM, STATE
from piazzi.formats.oem import check_version

_MARKS = ("META_START", "META_STOP")  # of other messages, which some write around the metadata of these, too
_WHO = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "EPOCH")


def read_opm(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The state of an OPM in KVN, as an arc of one; ValueError with file, line and reason."""
    source = Source(name)
    items = _items(source, data)
    return message_of(name, "OPM", [arc_of_opm(source, items, items[-1].line)], [])


def read_omm(data: bytes, name: str, told: Conventions) -> Ephemeris:
    """The mean elements of an OMM in KVN; ValueError with file, line and reason."""
    source = Source(name)
    items = _items(source, data)
    return message_of(name, "OMM", [], [elements_of_omm(source, items, items[-1].line)])


def message_of(name: str, form: str, arcs: Sequence[Arc], mean: Sequence[MeanElements]) -> Ephemeris:
    """The ephemeris of some messages, with what is assumed and open about them."""
    frames = [frame for arc in arcs for frame in (arc.frame, *arc.covariance_frames, *(burn.frame for burn in arc.burns))]
    frames += [frame for elements in mean for frame in (elements.frame, elements.covariance_frame)]
    silent = any(not dict(arc.said).get("MAN_DURATION", "x") for arc in arcs)
    assumed = ("manoeuvres without MAN_DURATION are impulsive",) if silent else ()
    return Ephemeris(arcs=tuple(arcs), mean=tuple(mean), file=name, format=form, assumed=assumed, open=unknown_axes(frames))


def _items(source: Source, data: bytes) -> list[Item]:
    lines = (("" if text.strip() in _MARKS else text, k) for k, text in enumerate(lines_of(data), 1))
    found = (key_value(source, text, line) for text, line in lines)
    items = [item for item in found if item is not None]
    check_version(source, items[0])
    return items


def arc_of_opm(source: Source, items: Iterable[Item], line: int) -> Arc:
    """The arc of one state of an OPM's items.

    Raises
    ------
    ValueError
        With file, line and reason: for keywords that are not of the format, given twice, missing, or with a wrong value.
    """
    plain, burns = _split(source, items, OPM, "an OPM")
    found = single(source, plain, "an OPM")
    needed(source, found, (*_WHO, *STATE), "the message", line)
    who = about(source, found)
    epoch = source.date(found["EPOCH"], who["scale"])
    state = np.array([[in_si(source, found[k], "km/s" if k.endswith("_DOT") else "km") for k in STATE]])
    optional: dict[str, Any] = {}
    covariance = covariance_of(source, found, line)
    if covariance is not None:
        frame = frame_named(found["COV_REF_FRAME"].text) if "COV_REF_FRAME" in found else who["frame"]
        optional = {"covariance_t": np.zeros(1), "covariance": covariance[None], "covariance_frames": (frame,)}
    if "REF_FRAME_EPOCH" in found:
        optional["frame_epoch"] = source.date(found["REF_FRAME_EPOCH"], who["scale"])
    said = [(item.keyword, item.text) for item in plain]
    if any("MAN_DURATION" not in burn for burn in burns):
        said.append(("MAN_DURATION", ""))
    return Arc(
        epoch=epoch, t=np.zeros(1), position=state[:, :3], velocity=state[:, 3:], **who, **optional,
        lines=np.array(found["EPOCH"].line),
        spacecraft=spacecraft_of(source, found), elements=_elements(source, found),
        burns=tuple(_burn(source, burn, who["scale"]) for burn in burns), said=tuple(said),
    )  # fmt: skip


def _split(
    source: Source, items: Iterable[Item], keywords: Iterable[str], what: str
) -> tuple[list[Item], list[dict[str, Item]]]:
    """Items but those of manoeuvres, and those of each manoeuvre, which begins with its ignition."""
    allowed, plain, burns = set(keywords), list[Item](), list[dict[str, Item]]()
    for item in items:
        if not item.keyword.startswith("USER_DEFINED_"):
            known(source, item, allowed, what)
        if item.keyword not in MANOEUVRE or "MAN_DV_1" not in allowed:
            plain.append(item)
            continue
        if item.keyword == "MAN_EPOCH_IGNITION":
            burns.append({})
        if not burns:
            source.refuse(item.line, f"{item.keyword} stands before MAN_EPOCH_IGNITION")
        if item.keyword in burns[-1]:
            source.refuse(item.line, f"{item.keyword} is given twice in a manoeuvre")
        burns[-1][item.keyword] = item
    return plain, burns


def _burn(source: Source, found: dict[str, Item], scale: str) -> Burn:
    ignition = found["MAN_EPOCH_IGNITION"]
    needed(source, found, ("MAN_REF_FRAME", "MAN_DV_1", "MAN_DV_2", "MAN_DV_3"), "the manoeuvre", ignition.line)
    along = [in_si(source, found[f"MAN_DV_{i}"], "km/s") for i in (1, 2, 3)]
    duration = in_si(source, found["MAN_DURATION"], "s") if "MAN_DURATION" in found else 0.0
    mass = in_si(source, found["MAN_DELTA_MASS"], "kg") if "MAN_DELTA_MASS" in found else np.nan
    frame = frame_named(found["MAN_REF_FRAME"].text)
    return Burn(source.date(ignition, scale), duration, mass, frame, (along[0], along[1], along[2]))


def _elements(source: Source, found: dict[str, Item]) -> tuple[tuple[str, float], ...]:
    return tuple((name, in_si(source, found[k], unit)) for k, (name, unit) in ELEMENTS.items() if k in found)


def elements_of_omm(source: Source, items: Iterable[Item], line: int) -> MeanElements:
    """Mean elements of an OMM's items; ValueError as `arc_of_opm`."""
    plain, _ = _split(source, items, OMM, "an OMM")
    found = single(source, plain, "an OMM")
    orbit = ("ECCENTRICITY", "INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY")
    size = "SEMI_MAJOR_AXIS" if "SEMI_MAJOR_AXIS" in found else "MEAN_MOTION"
    needed(source, found, (*_WHO, "MEAN_ELEMENT_THEORY", *orbit, size), "the message", line)
    who = about(source, found)
    covariance = covariance_of(source, found, line)
    frame = found.get("COV_REF_FRAME")
    for keyword in ("BSTAR", "BTERM", "AGOM", "MEAN_MOTION_DOT", "MEAN_MOTION_DDOT"):
        if keyword in found:
            source.number(found[keyword])
    return MeanElements(
        epoch=source.date(found["EPOCH"], who["scale"]), theory=found["MEAN_ELEMENT_THEORY"].text, **who,
        elements=_elements(source, found), spacecraft=spacecraft_of(source, found),
        covariance=() if covariance is None else tuple(covariance.reshape(-1).tolist()),
        covariance_frame=None if covariance is None else frame_named(frame.text) if frame else who["frame"],
        said=tuple((item.keyword, item.text) for item in plain),
    )  # fmt: skip
