"""Orbit Comprehensive Messages (CCSDS 502.0-B-3) as text: trajectory, covariances, and how the orbit was determined."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby

import numpy as np

from piazzi.formats.ephemeris import Arc
from piazzi.formats.writing import date, dates, in_unit, now, number, plain
from piazzi.text import suggest

_LOWER = np.tril_indices(6)
# keywords of the block of a determination, in the order of the standard
DETERMINATION = (
    "OD_ID", "OD_PREV_ID", "OD_METHOD", "OD_EPOCH", "DAYS_SINCE_FIRST_OBS", "DAYS_SINCE_LAST_OBS", "RECOMMENDED_OD_SPAN",
    "ACTUAL_OD_SPAN", "OBS_AVAILABLE", "OBS_USED", "TRACKS_AVAILABLE", "TRACKS_USED", "MAXIMUM_OBS_GAP", "OD_EPOCH_EIGMAJ",
    "OD_EPOCH_EIGINT", "OD_EPOCH_EIGMIN", "OD_MAX_PRED_EIGMAJ", "OD_MIN_PRED_EIGMIN", "OD_CONFIDENCE", "GDOP", "SOLVE_N",
    "SOLVE_STATES", "CONSIDER_N", "CONSIDER_PARAMS", "SEDR", "SENSORS_N", "SENSORS", "WEIGHTED_RMS", "DATA_TYPES",
)  # fmt: skip


def ocm_text(
    arc: Arc,
    *,
    determination: Mapping[str, object] | None = None,
    originator: str = "PIAZZI",
    created: str | None = None,
    basis: str | None = None,
) -> str:
    """An OCM (KVN) of an arc: km, 17 digits, covariances as lower triangles with their axes.

    Parameters
    ----------
    arc : Arc
    determination : keyword of `DETERMINATION` to value, in the units of the standard; ``OD_ID``, ``OD_METHOD`` and ``OD_EPOCH``
        must be among them where there are any
    basis : ``DETERMINED``, ``PREDICTED`` or ``SIMULATED``, what the trajectory is, where that is known

    Raises
    ------
    ValueError
        For an arc without centre, axes, time scale or velocities, or an unknown keyword of a determination.
    """
    for what, value in (("centre", arc.centre), ("axes", arc.frame), ("time scale", arc.scale)):
        if not plain(value or ""):
            raise ValueError(f"the {what} of {arc.called} must be known to write it")
    if np.isnan(arc.position).any() or np.isnan(arc.velocity).any():
        raise ValueError(f"states of {arc.called} must all have positions and velocities to write them")
    lines = ["CCSDS_OCM_VERS = 3.0", f"CREATION_DATE = {created or now()}", f"ORIGINATOR = {plain(originator)}", ""]
    lines += ["META_START", f"OBJECT_NAME = {plain(arc.name) or 'UNKNOWN'}"]
    lines += [f"INTERNATIONAL_DESIGNATOR = {plain(arc.identifier) or 'UNKNOWN'}", f"TIME_SYSTEM = {arc.scale}"]
    lines += [f"EPOCH_TZERO = {date(arc.scale or '', arc.epoch)}", "META_STOP", ""]
    lines += [*_trajectory(arc, basis), *_physics(arc), *_covariances(arc), *_determination(determination or {})]
    return "\n".join(lines) + "\n"


def _trajectory(arc: Arc, basis: str | None) -> Iterator[str]:
    yield from ("TRAJ_START", *([f"TRAJ_BASIS = {plain(basis)}"] if basis else []), f"CENTER_NAME = {plain(arc.centre or '')}")
    yield f"TRAJ_REF_FRAME = {plain(arc.frame or '')}"
    if arc.frame_epoch is not None:
        yield f"TRAJ_FRAME_EPOCH = {date(arc.scale or '', arc.frame_epoch)}"
    yield "TRAJ_TYPE = CARTPV"
    table = in_unit(np.hstack([arc.position, arc.velocity]), 1e3)
    for when, row in zip(dates(arc.scale or "", arc.epoch, arc.t), table.tolist(), strict=True):
        yield " ".join([when, *map(number, row)])
    yield from ("TRAJ_STOP", "")


def _physics(arc: Arc) -> Iterator[str]:
    """Mass, areas and coefficients, where they are known."""
    words = {"mass": "WET_MASS", "drag_coefficient": "DRAG_COEFF_NOM", "drag_area": "DRAG_CONST_AREA"}
    words |= {"radiation_coefficient": "SOLAR_RAD_COEFF", "radiation_area": "SRP_CONST_AREA"}
    known = dict(arc.spacecraft)
    order = ("drag_area", "drag_coefficient", "mass", "radiation_area", "radiation_coefficient")
    if known:
        yield from (
            "PHYS_START",
            *(f"{words[name]} = {number(known[name])}" for name in order if name in known),
            "PHYS_STOP",
            "",
        )


def _covariances(arc: Arc) -> Iterator[str]:
    """Blocks of covariances, each of one set of axes."""
    times = dates(arc.scale or "", arc.epoch, arc.covariance_t)
    lower = in_unit(arc.covariance, 1e6)[:, *_LOWER].tolist()
    for frame, group in groupby(zip(arc.covariance_frames, times, lower, strict=True), key=lambda row: row[0]):
        yield from ("COV_START", f"COV_REF_FRAME = {plain(frame)}", "COV_TYPE = CARTPV", "COV_ORDERING = LTM")
        for _, when, values in group:
            yield " ".join([when, *map(number, values)])
        yield from ("COV_STOP", "")


def _determination(given: Mapping[str, object]) -> Iterator[str]:
    if not given:
        return
    for keyword in given:
        if keyword not in DETERMINATION:
            raise ValueError(f"{keyword!r} is no keyword of an orbit determination{suggest(keyword, DETERMINATION)}")
    for keyword in ("OD_ID", "OD_METHOD", "OD_EPOCH"):
        if keyword not in given:
            raise ValueError(f"the block of a determination needs {keyword}")
    yield "OD_START"
    for keyword in DETERMINATION:
        if keyword in given:
            value = given[keyword]
            text = number(value) if isinstance(value, float) else plain(str(value))
            yield f"{keyword} = {text}"
    yield "OD_STOP"
