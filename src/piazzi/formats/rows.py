"""Rows of a table as they are read, one measurement after the other: for formats that no one has a million lines of."""

from __future__ import annotations

from array import array
from collections.abc import Hashable, Mapping
from math import nan
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import distinct
from piazzi.formats.dates import Readings, instants
from piazzi.formats.kinds import TAGS
from piazzi.formats.observations import Observations, Segment

_REALS = ("day", "seconds", "value", "sigma", "correlation", "time_sigma")
_WHOLE = ("kind", "station", "object", "segment", "line", "place", "used")


class Row(NamedTuple):
    """What one look of one station at one object has in common; `day` (MJD) and `seconds` in the segment's scale."""

    day: float
    seconds: float
    station: str
    object: str
    segment: int
    line: int
    place: int = -1
    time_sigma: float = nan


class Rows:
    """A table that grows."""

    def __init__(self, extra: tuple[str, ...] = ()) -> None:
        self.columns: dict[str, Any] = {name: array("d") for name in _REALS} | {name: array("i") for name in _WHOLE}
        self.kinds: dict[str, int] = {}
        self.people: dict[str, int] = {}
        self.segments: list[Segment] = []
        self.places: list[tuple[float, float, float]] = []
        self.extra: dict[str, list[Any]] = {name: [] for name in extra}
        self.left_out: dict[str, int] = {}
        self._known: dict[Hashable, int] = {}

    def segment(self, key: Hashable, **conventions: Any) -> int:
        """Number of the conventions that go by that key, which are kept when they are first met."""
        if key not in self._known:
            self._known[key] = len(self.segments)
            self.segments.append(Segment(**conventions))
        return self._known[key]

    def skip(self, reason: str) -> None:
        """Count a line that is no row."""
        self.left_out[reason] = self.left_out.get(reason, 0) + 1

    def add(
        self,
        row: Row,
        kind: str,
        value: float,
        sigma: float = nan,
        correlation: float = nan,
        used: bool = True,
        extra: Mapping[str, Any] | None = None,
    ) -> None:
        """One number that was measured, SI, with all the further columns that the table was made with."""
        put = self.columns
        for name, number in zip(_REALS, (row.day, row.seconds, value, sigma, correlation, row.time_sigma), strict=True):
            put[name].append(number)
        whole = (
            self.kinds.setdefault(kind, len(self.kinds)),
            self.people.setdefault(row.station, len(self.people)) if row.station else -1,
            self.people.setdefault(row.object, len(self.people)) if row.object else -1,
            *(row.segment, row.line, row.place, used),
        )
        for name, index in zip(_WHOLE, whole, strict=True):
            put[name].append(index)
        for name, column in self.extra.items():
            column.append((extra or {})[name])

    def table(self, file: str, assumed: tuple[str, ...] = (), left_open: tuple[str, ...] = ()) -> Observations:
        """The rows so far, each time by the scale of its segment.

        Raises
        ------
        ValueError
            Where there are none, or dates are earlier than their scale is.
        """
        columns: dict[str, Any] = {name: np.array(values) for name, values in self.columns.items()}
        if not len(columns["day"]):
            raise ValueError("the file has no measurements")
        day, seconds, segment = columns.pop("day"), columns.pop("seconds"), columns["segment"]
        whole = np.floor(seconds)
        readings = day, whole, seconds - whole
        scale = np.array([s.scale for s in self.segments])[segment]
        epoch = instants(str(scale[0]), Readings(*(part[:1] for part in readings))).epoch
        t = np.empty(len(day))
        for name in distinct(scale):
            here = scale == name
            t[here] = instants(str(name), Readings(*(part[here] for part in readings)), epoch).t
        return Observations(
            epoch=epoch,
            t=t,
            tag=np.array([TAGS.index(one.tag or "") for one in self.segments])[segment],
            kinds=tuple(self.kinds),
            participants=tuple(self.people),
            segments=tuple(self.segments),
            files=(file,),
            places=np.array(self.places).reshape(-1, 3),
            extra={name: np.array(values) for name, values in self.extra.items()},
            assumed=assumed,
            open=left_open,
            left_out=tuple(self.left_out.items()),
            **columns,
        )
