"""Ephemerides as observations: each state is a fix of three rows, or six."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.arrays import Array
from piazzi.formats.conventions import Conventions, with_usual_sigmas
from piazzi.formats.ephemeris import Arc, Ephemeris
from piazzi.formats.joining import concatenate
from piazzi.formats.kinds import asked_sigmas
from piazzi.formats.observations import Observations, Segment

POSITION, VELOCITY = ("x", "y", "z"), ("vx", "vy", "vz")


USUAL = {"SP3": 0.1, "CPF": 0.1}  # m, of positions whose file says no accuracy


def fixes_of(ephemeris: Ephemeris, told: Conventions) -> Observations:
    """Rows of all states, those of one state after another; NaN positions are left out and counted.

    Sigmas are those of the states, or the roots of the diagonal of a covariance of the same instant and axes, or `USUAL`.
    Velocities of SP3 and CPF have none: they follow from the positions, and are used only where the user gives them one.
    Raises ValueError where there is no state: mean elements are no measurements.
    """
    if not ephemeris.arcs:
        raise ValueError(f"{ephemeris.file}: the file holds mean elements, which are no measurements: they can be a --guess")
    rows = concatenate(_fixes(arc, ephemeris.file) for arc in ephemeris.arcs)
    lost = sum(int(np.isnan(arc.position).any(axis=1).sum()) for arc in ephemeris.arcs)
    reasons = {"states without a position": lost, "sets of mean elements": len(ephemeris.mean)}
    left_out = (*ephemeris.left_out, *((reason, count) for reason, count in reasons.items() if count))
    if (usual := USUAL.get(ephemeris.format)) is not None:
        rows = _usual(
            replace(rows, assumed=ephemeris.assumed), told, usual, f"sigma of positions of {ephemeris.format}: {usual} m"
        )
        return replace(rows, open=ephemeris.open, left_out=left_out)
    lacking = [rows.kinds[i] for i in np.unique(rows.kind[np.isnan(rows.sigma)])]
    open_ = (*ephemeris.open, asked_sigmas(lacking)) if lacking else ephemeris.open
    return replace(rows, assumed=ephemeris.assumed, open=open_, left_out=left_out)


def _usual(rows: Observations, told: Conventions, sigma: float, what: str) -> Observations:
    rows = with_usual_sigmas(rows, told, np.where(rows.of_kind(*POSITION), sigma, np.nan), what)
    given = {kind for rule in told.sigmas for kind in rule.kinds}
    unused = rows.of_kind(*(kind for kind in VELOCITY if kind not in given))
    return replace(rows, used=~unused) if unused.any() else rows


def _fixes(arc: Arc, file: str) -> Observations:
    good = ~np.isnan(arc.position).any(axis=1)
    with_velocity = bool(len(arc)) and not np.isnan(arc.velocity[good]).any() and bool(good.any())
    kinds = (*POSITION, *VELOCITY) if with_velocity else POSITION
    parts = [arc.position, arc.velocity] if with_velocity else [arc.position]
    sigma = _sigmas(arc, len(kinds))
    frame, count, width = arc.frame, int(good.sum()), len(kinds)
    said = tuple(pair for pair in arc.said if pair[0] not in ("TIME_SYSTEM", "REF_FRAME"))
    return Observations(
        epoch=arc.epoch, t=np.repeat(arc.t[good], width), value=np.hstack(parts)[good].reshape(-1),
        kinds=kinds, kind=np.tile(np.arange(width), count), line=np.repeat(arc.lines[good], width),
        participants=(arc.name or arc.identifier,), object=np.array(0), files=(file,),
        segments=(Segment(arc.scale or "TT", participants=(arc.name or arc.identifier,), frame=frame, said=said),),
        sigma=np.array(np.nan) if np.isnan(sigma).all() else sigma[good].reshape(-1),
    )  # fmt: skip


def _sigmas(arc: Arc, width: int) -> Array:
    """(K, width) standard deviations, NaN where there is none."""
    out = np.full((len(arc), width), np.nan)
    out[:, :3] = arc.sigma
    same = [i for i, frame in enumerate(arc.covariance_frames) if frame == arc.frame]
    if same:
        times = arc.covariance_t[same]
        order = np.argsort(times, kind="stable")
        nearest = np.clip(np.searchsorted(times[order], arc.t), 0, len(same) - 1)
        hit = times[order][nearest] == arc.t
        roots = np.sqrt(np.maximum(np.diagonal(arc.covariance[same], axis1=1, axis2=2), 0.0))[order][nearest]
        out[hit] = roots[hit, :width]
    return out
