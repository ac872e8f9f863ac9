"""A state to go on from: of a file of orbits, in the GCRF, with its covariance where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import Epoch, transform
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.formats.ephemeris import Arc, MeanElements
from piazzi.formats.ocm import used_by
from piazzi.orbit.axes import in_axes, state_axes
from piazzi.orbit.interpolation import interpolated
from piazzi.orbit.mean_elements import sgp4_covariance, sgp4_states
from piazzi.orbit.paths import opened

_LOCAL = {"RTN": "RTN", "RSW": "RTN", "RIC": "RTN", "TNW": "TNW", "RTN_ROTATING": "RTN_rotating"}
_SAME = 1e-3  # s: a covariance is of a state that is as near as this


@dataclass(frozen=True, eq=False)
class Start:
    """A state (6,) in m and m/s on the axes of the GCRF, its covariance (6, 6) or None, and where it is from.

    `used` are the first and the last measurement that it was determined from, where the file says them.
    """

    name: str
    epoch: Epoch
    state: Array
    covariance: Array | None
    source: str
    used: tuple[Epoch, Epoch] | None = None


def start_of(what: Any, near: Epoch | None = None, chosen: str | None = None) -> Start:
    """The state to go on from.

    Parameters
    ----------
    what : a file (OEM, OPM, OCM, SP3, CPF, two-line elements, OMM), an `Ephemeris`, an `Arc` or `MeanElements`
    near : of several states the nearest one is taken; default the last with a covariance, or else the last
    chosen : name or identifier of the object, where there are several

    Raises
    ------
    ValueError
        For several objects of which none is chosen, and where there is no state about the Earth.
    OSError
        Where a file cannot be read.
    """
    name, found = opened(what, chosen)
    if isinstance(found, MeanElements):
        at = found.epoch
        r, v = sgp4_states(found, at, "GCRF")
        said = "SGP4 at the epoch of the elements; its covariance is a rule of thumb, 1 km"
        return Start(found.name or name, at, np.concatenate([r, v]), sgp4_covariance(found, at), said)
    if callable(found):
        raise ValueError("a function of dates has no state of its own to go on from")
    arc = found[-1] if near is None else min(found, key=lambda one: float(np.abs(one.t - (near - one.epoch)).min()))
    return _of_arc(arc, name, near)


def _of_arc(arc: Arc, name: str, near: Epoch | None) -> Start:
    who = arc.name or name
    if arc.centre not in (None, "EARTH"):
        raise ValueError(f"positions of {who} are about {arc.centre}; orbits about the Earth are propagated")
    if arc.frame is None:
        raise ValueError(f"{name} does not say in which axes positions of {who} are")
    rows = np.flatnonzero(np.isfinite(arc.position).all(axis=1))
    if not rows.size:
        raise ValueError(f"{name} has no position of {who}")
    known = rows[[(np.abs(arc.covariance_t - arc.t[k]) < _SAME).any() for k in rows]] if len(arc.covariance_t) else rows[:0]
    if near is not None:
        k = int(rows[np.argmin(np.abs(arc.t[rows] - (near - arc.epoch)))])
    else:
        k = int(known[-1] if known.size else rows[-1])
    epoch, position, velocity = arc.instant(k), arc.position[k], arc.velocity[k]
    made = ""
    if not np.isfinite(velocity).all():
        if len(rows) < 3:
            raise ValueError(f"{name} has positions of {who} without velocities, and too few to make one of")
        velocity = interpolated(arc.t[rows], arc.position[rows], None, arc.t[[k]], arc.degree).v[0]
        made = ", its velocity from the positions around it"
    r, v = transform(position, velocity, arc.frame, "GCRF", arc.frame_epoch or epoch, WITHIN_THE_DAY)
    state = np.concatenate([r, np.asarray(v)])
    return Start(who, epoch, state, _covariance(arc, k, state), f"state {k + 1} of {len(arc)} in {name}{made}", used_by(arc))


def _covariance(arc: Arc, k: int, state: Array) -> Array | None:
    """That of the state, in the GCRF."""
    block = np.flatnonzero(np.abs(arc.covariance_t - arc.t[k]) < _SAME) if len(arc.covariance_t) else np.zeros(0, dtype=int)
    if not block.size:
        return None
    frame = arc.covariance_frames[block[0]]
    local = _LOCAL.get(frame.upper())
    J = state_axes(state[:3], state[3:], local).T if local else in_axes(frame, "GCRF", [arc.frame_epoch or arc.instant(k)])[0]
    P: Array = J @ arc.covariance[block[0]] @ J.T
    return 0.5 * (P + P.T)
