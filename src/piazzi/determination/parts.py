"""Rows of one sensor and one station, as makers of them give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from piazzi.model import Sensor
from piazzi.problem.checks import Array


@dataclass(frozen=True, eq=False)
class Part:
    """Rows of one sensor and one station.

    Attributes
    ----------
    sensor, station : the sensor, and the name that users call the station by
    t, values, noise : (R,) s past the epoch of the observations, (R, m), (R, m, m)
    rows : (R, m), indices of the observations
    place, numbers : of the station, as `problem.Station` takes them
    functions, parameters : data of functions, and by name role and value, that the sensor needs
    assumed : what was assumed
    """

    sensor: Sensor
    station: str
    t: Array
    values: Array
    noise: Array
    rows: Array
    place: Any = None
    numbers: Mapping[str, Any] = field(default_factory=dict)
    functions: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, tuple[str, Any]] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
