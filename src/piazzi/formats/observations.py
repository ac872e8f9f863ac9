"""`Observations`: what tracking files hold, as columns, with the conventions that they state and those that they leave open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.earth import Epoch
from piazzi.formats.copying import reduced
from piazzi.formats.kinds import KINDS, TAGS
from piazzi.text import brief, listed, nearest


class Correction(NamedTuple):
    """A correction that a file speaks of: its size in SI where it is given, and whether the values have it; None: not said."""

    name: str
    value: float | None = None
    applied: bool | None = None


@dataclass(frozen=True)
class Segment:
    """Conventions of a run of rows, as the file states them; None where it does not say.

    Attributes
    ----------
    scale : time scale of the file's dates
    participants, path, second_path : names; a path in the order of the signal (the second of a difference)
    mode : ``sequential`` or ``single_diff``
    way : ``one-way``, ``two-way``, ``three-way`` or ``relayed``
    range_is : ``half`` of the legs of a closed path, or their ``sum``
    range_modulus : m (RU for ranges in range units), 0 where ranges are unambiguous
    range_mode : ``coherent``, ``constant`` or ``one_way``
    tag : ``transmit``, ``bounce`` or ``receive``, what the times of the rows are
    interval, interval_reference : s, and which part of it the time is: ``start``, ``middle`` or ``end``
    corrections : what is or is to be corrected for, by name
    frame : axes of directions and fixes, by their CCSDS name
    angles : ``astrometric``, ``geocentric`` or ``apparent``, see `kinds.ANGLES`
    frequencies : Hz, by what they are: ``carrier``, ``transmit``, ``offset`` (already added to the values), ...
    turnaround : ratio of the transponder
    delays : s, by participant: ``transmit DSS-25``
    wavelength : m, of a laser
    quality : ``raw``, ``validated`` or ``degraded``
    said : every other keyword with its text, so that nothing is lost
    """

    scale: str
    participants: tuple[str, ...] = ()
    path: tuple[str, ...] | None = None
    second_path: tuple[str, ...] | None = None
    mode: str | None = None
    way: str | None = None
    range_is: str | None = None
    range_modulus: float | None = None
    range_mode: str | None = None
    tag: str | None = None
    interval: float | None = None
    interval_reference: str | None = None
    corrections: tuple[Correction, ...] = ()
    frame: str | None = None
    angles: str | None = None
    frequencies: tuple[tuple[str, float], ...] = ()
    turnaround: float | None = None
    delays: tuple[tuple[str, float], ...] = ()
    wavelength: float | None = None
    quality: str | None = None
    said: tuple[tuple[str, str], ...] = ()

    __repr__ = brief


_INDICES = {"kind": np.int16, "station": np.int32, "object": np.int32, "participant": np.int32, "segment": np.int32}
_INDICES |= {"tag": np.int8, "file": np.int16, "line": np.int32, "place": np.int32}
NUMBERS = ("sigma", "correlation", "time_sigma", "pressure", "temperature", "humidity")
COLUMNS = ("t", "value", *NUMBERS, *_INDICES, "used")  # of one entry a row, besides `extra`


@dataclass(frozen=True, eq=False, kw_only=True)
class Observations:
    """Rows of measurements in the order of their files, one number a row, as columns of J rows.

    A position fix is three rows ``x``, ``y``, ``z`` of one time and object (six with velocities); a direction is two rows.
    Partners stand one after the other, and `correlation` is that with the row before.

    Parameters
    ----------
    epoch : Epoch
        Time zero.
    t : (J,), seconds of TT past `epoch`; `seconds` gives those of TDB
    value : (J,), in the SI unit of the row's kind; radians
    kinds, kind : names of `kinds.KINDS`, and an index into them for each row
    participants : names of all who take part
    station, object, participant : index into `participants`, -1 where it is not said
        Who received (or measured), who is seen, and whom a row is about that names one (``TRANSMIT_FREQ_2``).
    segments, segment : conventions, and which of them are a row's
    files, file, line : where a row stands; lines count from 1, 0 where there are none
    sigma : standard deviation, NaN where the file gives none
    correlation, time_sigma : with the row before; s
    pressure, temperature, humidity : Pa, K, 0 to 1; NaN where there is none
    tag : index into `kinds.TAGS`, which event the time is of; 0 where it is not said
    used : False for rows that the file itself says are not to be used
    place, places : index into places (P, 3) in m of observers that move, -1 for none; axes as `Segment.frame` or `extra` say
    extra : further columns of (J,), by name, as a reader gives them
    assumed, open : what was assumed; what is not said, each with the option that would say it
    left_out : reasons and counts of lines that are no rows

    A column may be one number, which then holds for all rows and takes no memory.
    """

    epoch: Epoch
    t: Array
    value: Array
    kinds: tuple[str, ...]
    kind: Array
    segments: tuple[Segment, ...]
    participants: tuple[str, ...] = ()
    station: Array = -1  # type: ignore[assignment]  # numbers become columns
    object: Array = -1  # type: ignore[assignment]
    participant: Array = -1  # type: ignore[assignment]
    segment: Array = 0  # type: ignore[assignment]
    files: tuple[str, ...] = ()
    file: Array = 0  # type: ignore[assignment]
    line: Array = 0  # type: ignore[assignment]
    sigma: Array = np.nan  # type: ignore[assignment]
    correlation: Array = np.nan  # type: ignore[assignment]
    time_sigma: Array = np.nan  # type: ignore[assignment]
    pressure: Array = np.nan  # type: ignore[assignment]
    temperature: Array = np.nan  # type: ignore[assignment]
    humidity: Array = np.nan  # type: ignore[assignment]
    tag: Array = 0  # type: ignore[assignment]
    used: Array = True  # type: ignore[assignment]
    place: Array = -1  # type: ignore[assignment]
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))
    extra: Mapping[str, Array] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    left_out: tuple[tuple[str, int], ...] = ()

    def __post_init__(self) -> None:
        put, rows = object.__setattr__, len(np.atleast_1d(self.t))
        for name in ("t", "value", *NUMBERS):
            put(self, name, _column(name, getattr(self, name), np.float64, rows))
        for name, kind in _INDICES.items():
            put(self, name, _column(name, getattr(self, name), kind, rows))
        put(self, "used", _column("used", self.used, np.bool_, rows))
        put(self, "places", np.array(self.places, dtype=float).reshape(-1, 3))
        self.places.setflags(write=False)
        columns = {name: _column(name, values, None, rows) for name, values in self.extra.items()}
        put(self, "extra", MappingProxyType(columns))
        for name in self.kinds:
            if name not in KINDS:
                raise ValueError(f"{name!r} is no kind of measurement{nearest(name, KINDS)}")
        people, parts = len(self.participants), len(self.segments)
        ends = {"kind": (0, len(self.kinds)), "segment": (0, parts), "tag": (0, len(TAGS)), "place": (-1, len(self.places))}
        for name, (least, end) in ends.items() | {(n, (-1, people)) for n in ("station", "object", "participant")}:
            column = getattr(self, name)
            if rows and not (least <= column.min() and column.max() < end):
                raise ValueError(f"column {name!r} goes from {column.min()} to {column.max()}; there are {end} of them")
        if not np.isfinite(self.t).all():
            raise ValueError(f"the time of row {int(np.flatnonzero(~np.isfinite(self.t))[0])} is not finite")

    def __repr__(self) -> str:
        """In short: how many rows, of what, by whom, when."""
        kinds = listed(kind for kind in self.kinds if self.of_kind(kind).any())
        people = "".join(f" {word} {listed(names)}" for word, names in (("by", self.stations), ("of", self.objects)) if names)
        span = f"; {self.epoch + float(self.t.min())} to {self.epoch + float(self.t.max())}" if len(self) else ""
        return f"<Observations: {len(self)} rows, {kinds}{people}{span}>"

    def __len__(self) -> int:
        return len(self.t)

    def __reduce__(self) -> tuple[Any, ...]:
        return reduced(self)

    def __getitem__(self, rows: Any) -> Observations:
        """The rows of a mask, a slice or an array of indices, with all names and conventions."""
        if isinstance(rows, (int, np.integer)):
            rows = [rows]
        chosen: dict[str, Any] = {name: _chosen(getattr(self, name), rows) for name in COLUMNS}
        return replace(self, **chosen, extra={name: _chosen(values, rows) for name, values in self.extra.items()})

    def of_kind(self, *names: str) -> Array:
        """(J,) mask of the rows of these kinds."""
        return np.isin(self.kind, [i for i, kind in enumerate(self.kinds) if kind in names])

    @property
    def measured(self) -> Array:
        """(J,) mask of rows that measure the orbit: not of frequencies sent, weather or brightness."""
        return self.of_kind(*(name for name in self.kinds if not KINDS[name].auxiliary))

    @property
    def stations(self) -> tuple[str, ...]:
        """Names of those who measured, in the order of `participants`."""
        return tuple(self.participants[i] for i in distinct(self.station) if i >= 0)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of those who were seen, in the order of `participants`."""
        return tuple(self.participants[i] for i in distinct(self.object) if i >= 0)

    @property
    def scales(self) -> tuple[str, ...]:
        """Time scales that the files' dates are in."""
        return tuple(dict.fromkeys(segment.scale for segment in self.segments))

    def instant(self, row: int) -> Epoch:
        """When a row was measured."""
        return self.epoch + float(self.t[row])

    def in_order(self) -> Observations:
        """The same rows in order of time, those of one time as they stand."""
        if np.all(self.t[1:] >= self.t[:-1]):
            return self
        return self[np.argsort(self.t, kind="stable")]

    def seconds(self, scale: str) -> Array:
        """(J,) seconds of TT or TDB past `epoch`."""
        if scale == "TT":
            return self.t
        if scale != "TDB":
            raise ValueError(f"uniform time is TT or TDB, not {scale!r}")
        from piazzi.earth.scales import offset

        whole = self.epoch.whole + np.floor(self.t)
        fraction = self.epoch.fraction + (self.t - np.floor(self.t))
        zero = offset("TDB", np.array(self.epoch.whole), np.array(self.epoch.fraction))
        return np.asarray(self.t - (offset("TDB", whole, fraction) - zero))


def _column(name: str, values: Any, kind: Any, rows: int) -> Array:
    """A read-only column of one type; one number becomes a view of `rows` of them."""
    column: Array = np.asarray(values) if kind is None else np.asarray(values, dtype=kind)
    if column.ndim == 0:
        return np.broadcast_to(column, (rows,))
    if column.shape != (rows,):
        raise ValueError(f"column {name!r} has shape {column.shape}; there are {rows} rows")
    if column.flags.writeable:
        column = column.view()
        column.setflags(write=False)
    return column


def is_constant(column: Array) -> bool:
    """Whether it is one number seen many times."""
    return len(column) > 0 and column.strides == (0,)


def _chosen(column: Array, rows: Any) -> Array:
    if not is_constant(column):
        return np.asarray(column[rows])
    return np.broadcast_to(column[0], np.empty(len(column), dtype=np.bool_)[rows].shape)
