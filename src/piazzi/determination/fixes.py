"""Fixes of position, and of velocity, turned into the axes of the GCRF once, with their covariances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.parts import Part
from piazzi.determination.sites import Context
from piazzi.earth import rotation, sensors, transform
from piazzi.earth.rotation import TURNING, frame_named
from piazzi.earth.scales import Orientation
from piazzi.formats import Observations
from piazzi.model import Sensor
from piazzi.problem.checks import Array

POSITION = Sensor("position", {"px": "x", "py": "y", "pz": "z"}, units=dict.fromkeys(("px", "py", "pz"), "m"))
BOTH = Sensor(
    "position_velocity",
    {"px": "x", "py": "y", "pz": "z", "pvx": "vx", "pvy": "vy", "pvz": "vz"},
    units=dict.fromkeys(("px", "py", "pz"), "m") | dict.fromkeys(("pvx", "pvy", "pvz"), "m/s"),
)
STATION = "fixes"
_ORDER = ("x", "y", "z", "vx", "vy", "vz")


def fixes(context: Context, index: Array) -> Sequence[Part]:
    """Rows x, y, z of one time and object as positions, those that vx, vy, vz follow as positions with velocities.

    Raises
    ------
    ValueError
        For axes that are not known or not said, and rows that are no whole fix.
    """
    observations = context.observations
    place = np.array([_ORDER.index(kind) if kind in _ORDER else -1 for kind in observations.kinds])
    what = place[observations.kind[index]]
    starts = np.flatnonzero(what == 0)
    ends = np.append(starts[1:], len(index))
    if not len(starts) or starts[0] != 0 or not np.isin(ends - starts, (3, 6)).all():
        raise ValueError(_broken(observations, int(index[0])))
    found = []
    for width, sensor in ((3, POSITION), (6, BOTH)):
        own = starts[ends - starts == width]
        if len(own):
            rows = index[own[:, None] + np.arange(width)]
            if not (what[own[:, None] + np.arange(width)] == np.arange(width)).all():
                raise ValueError(_broken(observations, int(index[0])))
            if not (observations.t[rows] == observations.t[rows[:, :1]]).all():
                raise ValueError(_broken(observations, int(index[0])))
            found.append(_part(context, rows, sensor))
    return found


def _broken(observations: Observations, row: int) -> str:
    file = observations.files[observations.file[row]] if observations.files else "the fixes"
    return f"{file}: a fix is x, y and z of one time, and may have vx, vy and vz; there are rows that are less"


def _part(context: Context, rows: Array, sensor: Sensor) -> Part:
    """Fixes of (R, 3) or (R, 6) rows in the GCRF."""
    observations = context.observations
    t, values, sigma = observations.t[rows[:, 0]], observations.value[rows].copy(), observations.sigma[rows]
    noise = np.zeros((len(rows), rows.shape[1], rows.shape[1]))
    place = np.arange(rows.shape[1])
    noise[:, place, place] = sigma**2
    segments = observations.segment[rows[:, 0]]
    assumed: list[str] = []
    for i in distinct(segments):
        own = segments == i
        frame = _frame(observations, int(i))
        if frame in ("GCRF", "ICRF"):
            continue
        dates = [observations.epoch + float(x) for x in t[own]]
        velocity = values[own, 3:] if rows.shape[1] == 6 else None
        turned = transform(values[own, :3], velocity, frame, "GCRF", dates, context.eop)
        values[own] = turned[0] if velocity is None else np.hstack([turned[0], np.asarray(turned[1])])
        noise[own] = _turned(noise[own], frame, dates, context.eop)
        if velocity is not None and frame in TURNING:
            assumed.append("velocities of fixes are relative to the turning axes")
    if context.antenna is None:
        return Part(sensor, STATION, t, values, noise, rows, assumed=tuple(assumed))
    arm = sensors.position(f"{sensor.name}_of_antenna", velocity=sensor is BOTH, lever=True)
    stands: dict[str, Any] = dict(zip(("lever_radial", "lever_along", "lever_cross"), context.antenna, strict=True))
    numbers = arm.at(None, context.epoch, 1.0, name=STATION, **stands)["numbers"]
    return Part(arm, STATION, t, values, noise, rows, numbers=numbers, assumed=tuple(assumed))


def _turned(noise: Array, frame: str, dates: Sequence[Any], eop: Orientation | None) -> Array:
    """Covariances in the GCRF; the same where all directions are alike, so that rows of one sigma have one noise."""
    blocks = range(0, noise.shape[1], 3)
    if all(
        np.allclose(noise[:, k : k + 3, k : k + 3], noise[:, k, k, None, None] * np.eye(3), rtol=1e-12, atol=0) for k in blocks
    ):
        return noise
    R = rotation(frame, "GCRF", dates, eop)
    out = np.zeros_like(noise)
    for k in blocks:
        out[:, k : k + 3, k : k + 3] = R @ noise[:, k : k + 3, k : k + 3] @ np.swapaxes(R, 1, 2)
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)))


def _frame(observations: Observations, segment: int) -> str:
    frame = observations.segments[segment].frame
    file = f"{observations.files[0]}: " if observations.files else ""
    centre = dict(observations.segments[segment].said).get("CENTER_NAME", "EARTH").strip().upper()
    if centre != "EARTH":
        raise ValueError(f"{file}fixes are about {centre}; orbits about the Earth are determined")
    if frame is None:
        raise ValueError(f"{file}the file does not say in which axes fixes are: --frame ITRF or another")
    try:
        return frame_named(frame)
    except ValueError as error:
        raise ValueError(f"{file}{error}") from None
