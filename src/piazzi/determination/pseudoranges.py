"""Pseudoranges that the object measures to navigation satellites, whose orbits and clocks are given."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from piazzi.determination.frequencies import beliefs
from piazzi.determination.parts import Part
from piazzi.determination.ranging import part_of, passes
from piazzi.determination.sites import Context
from piazzi.earth import sensors
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.problem import Station, Tracking
from piazzi.problem.checks import Array

NAME = "pseudorange"
FARTHEST = 1e8  # m, that a signal comes from: a row beyond it is wrong, and its time of sending is not asked of an ephemeris
ENOUGH, MOST = 4, 40  # rows of one time for a fix, and times of which fixes are made


def pseudoranges(context: Context, index: Array) -> Sequence[Part]:
    """Rows of pseudoranges as parts, one for each navigation satellite and pass.

    The clock of who sends is taken from its ephemeris, when it sent: that is when it was received, less the pseudorange over
    the speed of light, whatever the clock of the receiver says.

    Raises
    ------
    ValueError
        For a satellite whose orbit nobody gave.
    """
    return list(_parts(context, index))


def _parts(context: Context, index: Array) -> Iterator[Part]:
    observations = context.observations
    for rows in passes(context, index):
        number = int(observations.station[rows[0]])
        partner = context.partner(number)
        if partner is None:
            name = observations.participants[number] if number >= 0 else "the satellite that sent"
            raise ValueError(f"{context.where}where was {name}? Give orbits and clocks with --participant FILE (SP3)")
        sensor = _sensor()
        given, rows = context.placed(sensor, rows)  # noqa: PLW2901
        if not len(rows):
            continue
        part = part_of(context, sensor, given, rows, 1.0, parameters=beliefs(sensor))
        sent = part.t - np.clip(part.values[:, 0], 0.0, FARTHEST) / SPEED_OF_LIGHT
        ahead = partner.clock(observations.epoch, sent)
        if ahead is None:
            context.said[f"the clock of {partner.name} is right: its ephemeris says nothing of it"] = None
            ahead = np.zeros(len(rows))
        else:
            context.said[
                "clocks of those who sent are of their ephemerides, which leave out what eccentric orbits do to them"
            ] = None
        context.said[
            "ionosphere is not in pseudoranges (of two frequencies), nor how far antennas are from centres of mass"
        ] = None
        part.values[:, 0] += SPEED_OF_LIGHT * ahead
        yield part


@lru_cache(maxsize=1)
def _sensor() -> Any:
    return sensors.pseudorange(name=NAME, relativity=True)


def positions(stations: Sequence[Station], tracking: Tracking) -> tuple[Array, Array]:
    """Times (N,) and positions (N, 3) of the object where four and more pseudoranges of one time give it, with its clock."""
    places = {s.name: s.place for s in stations if s.sensor == NAME}
    own = np.flatnonzero(np.isin(tracking.row_stations, list(places)) & np.isfinite(tracking.values[:, 0]))
    times, first, count = np.unique(tracking.row_times[own], return_index=True, return_counts=True)
    found = []
    for t, k, n in [each for each in zip(times, first, count, strict=True) if each[2] >= ENOUGH][:MOST]:
        rows = own[k : k + n]
        z = tracking.values[rows, 0]
        sent = t - z / SPEED_OF_LIGHT
        there = np.array([places[tracking.row_stations[i]].value(s)[:3] for i, s in zip(rows, sent, strict=True)])
        found.append((float(t), _fix(there, z)))
    return np.array([t for t, _ in found]), np.array([r for _, r in found]).reshape(-1, 3)


def _fix(there: Array, z: Array) -> Array:
    """The position (3,) that is as far from places (K, 3) as pseudoranges (K,) say, all of them off by one clock."""
    x = np.zeros(4)
    for _ in range(12):
        line = x[:3] - there
        distance = np.linalg.norm(line, axis=1)
        A = np.column_stack([line / distance[:, None], np.ones(len(z))])
        x = x + np.linalg.lstsq(A, z - distance - x[3], rcond=None)[0]
    return x[:3]
