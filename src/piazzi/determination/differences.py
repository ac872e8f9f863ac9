"""Differences of when two stations receive one signal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from piazzi.determination.parts import Part
from piazzi.determination.ranging import by_kind, part_of, passes
from piazzi.determination.sites import Context
from piazzi.earth import Station, sensors
from piazzi.problem.checks import Array


def differences(context: Context, index: Array) -> Sequence[Part]:
    """Rows of delays between two stations as parts, one for each pass.

    A delay is when a signal arrives by the second path, less when it arrives by the first, whose station's times are those of
    rows.

    Raises
    ------
    ValueError
        Where the paths are not said, or not those of one signal to two stations, and for several second stations.
    """
    return [_part(context, rows) for _, own in by_kind(context, index) for rows in passes(context, own)]


def _part(context: Context, rows: Array) -> Part:
    observations = context.observations
    segment = observations.segments[observations.segment[rows[0]]]
    first, second = segment.path, segment.second_path
    if not (first and second and len(first) == len(second) == 2 and first[0] == second[0]):
        raise ValueError(
            f"{context.where}delays between stations are of one signal on two paths, as PATH_1 = 1,2 and PATH_2 = 1,3"
        )
    others = {one.second_path[-1] for one in observations.segments if one.second_path}
    if len(others) > 1:
        raise ValueError(
            f"{context.where}delays against several stations ({', '.join(sorted(others))}) are not determined from yet"
        )
    context.said["delays between stations are not corrected for the troposphere"] = None
    sensor = _sensor(context.site(observations.participants.index(second[-1])))
    given, rows = context.placed(sensor, rows)
    return part_of(context, sensor, given, rows, 1.0)


@lru_cache(maxsize=8)
def _sensor(second: Station) -> Any:
    return sensors.delay_difference(second)
