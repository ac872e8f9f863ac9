"""Orbit messages as text: OEM with covariances, OPM, OMM."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.ephemeris import Arc, Ephemeris, MeanElements
from piazzi.formats.odm_keywords import COVARIANCE, ELEMENTS, SPACECRAFT, STATE, TLE
from piazzi.formats.writing import date, dates, in_unit, now, number, plain
from piazzi.units import Units

_LOWER = np.tril_indices(6)


def oem_text(ephemeris: Ephemeris, *, originator: str = "PIAZZI", created: str | None = None) -> str:
    """An OEM (CCSDS 502.0-B-3, KVN) of all arcs: km, 17 digits, every covariance as a lower triangle with its axes.

    Raises
    ------
    ValueError
        For an arc without velocities, centre, axes or time scale, none of which the format can leave out.
    """
    if not ephemeris.arcs:
        raise ValueError("there are no states to write")
    lines = _header("OEM", originator, created)
    for arc in ephemeris.arcs:
        lines += ["", "META_START", *_metadata(arc), *_span(arc), "META_STOP", "", *_states(arc)]
        lines += _covariances(arc) if arc.covariance_frames else []
    return "\n".join(lines) + "\n"


def _header(form: str, originator: str, created: str | None) -> list[str]:
    return [f"CCSDS_{form}_VERS = 3.0", f"CREATION_DATE = {created or now()}", f"ORIGINATOR = {plain(originator)}"]


def _metadata(arc: Arc | MeanElements) -> Iterator[str]:
    for what, value in (("centre", arc.centre), ("axes", arc.frame), ("time scale", arc.scale)):
        if not plain(value or ""):
            raise ValueError(f"the {what} of {arc.called} must be known to write it")
    yield f"OBJECT_NAME = {plain(arc.name) or 'UNKNOWN'}"
    yield f"OBJECT_ID = {plain(arc.identifier) or 'UNKNOWN'}"
    yield f"CENTER_NAME = {plain(arc.centre or '')}"
    yield f"REF_FRAME = {plain(arc.frame or '')}"
    if isinstance(arc, Arc) and arc.frame_epoch is not None:
        yield f"REF_FRAME_EPOCH = {date(arc.scale or '', arc.frame_epoch)}"
    yield f"TIME_SYSTEM = {arc.scale}"


def _span(arc: Arc) -> Iterator[str]:
    scale = arc.scale or ""
    first, last = dates(scale, arc.epoch, arc.t[[0, -1]])
    yield f"START_TIME = {first}"
    for keyword, useable in zip(("USEABLE_START_TIME", "USEABLE_STOP_TIME"), arc.useable, strict=True):
        if useable is not None:
            yield f"{keyword} = {date(scale, useable)}"
    yield f"STOP_TIME = {last}"
    if arc.interpolation and arc.degree is not None:  # neither without the other
        yield f"INTERPOLATION = {plain(arc.interpolation).upper()}"
        yield f"INTERPOLATION_DEGREE = {arc.degree}"


def _states(arc: Arc) -> Iterator[str]:
    if np.isnan(arc.position).any() or np.isnan(arc.velocity).any():
        raise ValueError(f"states of {arc.called} must all have positions and velocities to write them")
    table = in_unit(np.hstack([arc.position, arc.velocity, arc.acceleration]), 1e3)
    for when, row in zip(dates(arc.scale or "", arc.epoch, arc.t), table.tolist(), strict=True):
        numbers = row if row[6] == row[6] and row[7] == row[7] and row[8] == row[8] else row[:6]
        yield " ".join([when, *map(number, numbers)])


def _covariances(arc: Arc) -> Iterator[str]:
    yield from ("", "COVARIANCE_START")
    times = dates(arc.scale or "", arc.epoch, arc.covariance_t)
    for when, frame, block in zip(times, arc.covariance_frames, in_unit(arc.covariance, 1e6), strict=True):
        yield from (f"EPOCH = {when}", f"COV_REF_FRAME = {plain(frame)}")
        for i in range(6):
            yield " ".join(map(number, block[i, : i + 1].tolist()))
    yield "COVARIANCE_STOP"


def opm_text(arc: Arc, *, originator: str = "PIAZZI", created: str | None = None) -> str:
    """An OPM (CCSDS 502.0-B-3, KVN) of an arc of one state; ValueError as `oem_text`."""
    if len(arc) != 1:
        raise ValueError(f"an OPM holds one state, and there are {len(arc)}: write an OEM")
    lines = [*_header("OPM", originator, created), *_metadata(arc)]
    scale = arc.scale or ""
    state = in_unit(np.concatenate([arc.position[0], arc.velocity[0]]), 1e3)
    if np.isnan(state).any():
        raise ValueError(f"the state of {arc.called} must have position and velocity to write it")
    lines.append(f"EPOCH = {dates(scale, arc.epoch, arc.t)[0]}")
    lines += [f"{keyword} = {number(value)}" for keyword, value in zip(STATE, state.tolist(), strict=True)]
    lines += [*_quantities(arc.elements, ELEMENTS), *_quantities(arc.spacecraft, SPACECRAFT)]
    if arc.covariance_frames:
        lines += _covariance(arc.covariance[0], arc.covariance_frames[0])
    for burn in arc.burns:
        lines += [f"MAN_EPOCH_IGNITION = {date(scale, burn.epoch)}", f"MAN_DURATION = {number(burn.duration)}"]
        lines += [f"MAN_DELTA_MASS = {number(burn.mass)}"] if burn.mass == burn.mass else []
        lines.append(f"MAN_REF_FRAME = {plain(burn.frame)}")
        lines += [f"MAN_DV_{i + 1} = {number(v)}" for i, v in enumerate(in_unit(burn.delta_v, 1e3).tolist())]
    lines += [f"{keyword} = {plain(text)}" for keyword, text in arc.said if keyword.startswith("USER_DEFINED_")]
    return "\n".join(lines) + "\n"


def _quantities(given: tuple[tuple[str, float], ...], keywords: dict[str, tuple[str, str]]) -> list[str]:
    """Lines of named numbers in the message's units."""
    found = dict(given)
    return [
        f"{keyword} = {number(float(in_unit(found[name], Units().unit(unit or '1').factor)))}"
        for keyword, (name, unit) in keywords.items()
        if name in found
    ]


def _covariance(block: Array, frame: str) -> list[str]:
    values = in_unit(block, 1e6)[_LOWER].tolist()
    return [f"COV_REF_FRAME = {plain(frame)}", *(f"{k} = {number(v)}" for k, v in zip(COVARIANCE, values, strict=True))]


def omm_text(mean: MeanElements, *, originator: str = "PIAZZI", created: str | None = None) -> str:
    """An OMM (CCSDS 502.0-B-3, KVN) of mean elements, with the parameters of two-line elements as they were given."""
    said = dict(mean.said)
    lines = [*_header("OMM", originator, created), *_metadata(mean), f"MEAN_ELEMENT_THEORY = {plain(mean.theory)}"]
    epoch = date(mean.scale or "", mean.epoch)  # readers of others want a fraction of the second
    lines += [f"EPOCH = {epoch if '.' in epoch else f'{epoch}.0'}", *_quantities(mean.elements, ELEMENTS)]
    lines += _quantities(mean.spacecraft, SPACECRAFT)
    lines += [f"{keyword} = {plain(said[keyword])}" for keyword in TLE if keyword in said]
    if mean.covariance:
        lines += _covariance(np.reshape(mean.covariance, (6, 6)), mean.covariance_frame or mean.frame or "")
    lines += [f"{keyword} = {plain(text)}" for keyword, text in mean.said if keyword.startswith("USER_DEFINED_")]
    return "\n".join(lines) + "\n"
