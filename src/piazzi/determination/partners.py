"""Participants in orbit whose ephemerides are given: places that measurements are made from, and clocks of what they send."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.sites import ABOARD, aboard, matched, sites_of
from piazzi.earth import Epoch
from piazzi.earth.constants import SPEED_OF_LIGHT
from piazzi.formats import Ephemeris, Observations, read_ephemeris
from piazzi.opening import opened as opened_file
from piazzi.outside.table import Table
from piazzi.problem.checks import Array
from piazzi.text import brief, listed

STEP = 60.0  # s, of the table that stands for an orbit
MORE = 8.0  # steps of it beyond the rows, where the ephemeris goes on
BEFORE = 1.0  # s, that signals may have been on their way
BISECTIONS = 40
_NAME = 60  # letters of a name, at most


@dataclass(frozen=True, eq=False)
class Partner:
    """A participant in orbit: a file or an ephemeris, and its name there, None where that has one orbit."""

    name: str
    source: Any
    chosen: str | None
    _paths: dict[Any, Any] = field(default_factory=dict, repr=False)

    __repr__ = brief

    @property
    def arcs(self) -> tuple[Any, ...]:
        """Arcs of its ephemeris, none where it is known otherwise."""
        from piazzi.orbit.paths import opened

        found = opened(self.source, self.chosen)[1] if isinstance(self.source, Ephemeris) else ()
        return found if isinstance(found, tuple) else ()

    def path(self, epoch: Epoch) -> tuple[Any, Any]:
        """Functions of times (K,) past `epoch`: whether it is known, and states (K, 6) in the GCRF."""
        key = epoch.whole, epoch.fraction
        if key not in self._paths:
            self._paths[key] = self._path(epoch)
        return self._paths[key]  # type: ignore[no-any-return]

    def _path(self, epoch: Epoch) -> tuple[Any, Any]:
        from piazzi.determination.course import course_of
        from piazzi.orbit.paths import opened, path_of

        if isinstance(self.source, Ephemeris):
            path = path_of(self.name, opened(self.source, self.chosen)[1], epoch, None)
            return path.covered, lambda t: np.hstack(path.states(t))
        course = course_of(self.source, epoch)
        off = epoch - course.epoch

        def known(t: Array) -> Array:
            inside = [(t + off >= first) & (t + off <= last) for first, last in course.spans]
            return np.any(inside, axis=0) if inside else np.ones(len(t), dtype=bool)

        return known, lambda t: course.beliefs(t + off)[0]

    def place(self, epoch: Epoch, t: Array) -> tuple[Table, Array]:
        """The table of its place, past `epoch`, and at which of the times (K,) it has been known long enough."""
        known, states = self.path(epoch)
        coarse = np.arange(np.floor(t.min() / STEP) - MORE, np.ceil(t.max() / STEP) + MORE + 1.0) * STEP
        there = np.flatnonzero(known(coarse))
        if len(there) < 2:
            return Table([0.0, 1.0], np.zeros((2, 6))), np.zeros(len(t), dtype=bool)
        first = _edge(known, coarse[there[0]], coarse[max(there[0] - 1, 0)])
        last = _edge(known, coarse[there[-1]], coarse[min(there[-1] + 1, len(coarse) - 1)])
        nodes = np.linspace(first, last, int(np.ceil((last - first) / STEP)) + 1)
        nodes = nodes[known(nodes)]
        after = np.clip(np.searchsorted(nodes, t), 1, len(nodes) - 1)
        usable = (t >= nodes[0] + BEFORE) & (t <= nodes[-1]) & (nodes[after] - nodes[after - 1] < 1.5 * STEP)
        return Table(nodes, states(nodes)), usable

    def clock(self, epoch: Epoch, t: Array) -> Array | None:
        """How far its clock is ahead (s) at times (K,) past `epoch`, with what its orbit makes of it; None: nobody says."""
        dated = [(arc.t + (arc.epoch - epoch), arc.clock) for arc in self.arcs]
        times, clocks = (np.concatenate([pair[i] for pair in dated]) if dated else np.zeros(0) for i in (0, 1))
        there = np.isfinite(clocks)
        if not there.any():
            return None
        order = np.argsort(times[there], kind="stable")
        x = self.path(epoch)[1](t)
        periodic = -2.0 * np.sum(x[:, :3] * x[:, 3:], axis=1) / SPEED_OF_LIGHT**2
        return np.asarray(np.interp(t, times[there][order], clocks[there][order]) + periodic)


def partners_of(given: Any) -> dict[str, Partner]:
    """Participants by name, of texts ``NAME=FILE`` or ``FILE`` (all of its objects), or a mapping from names to orbits.

    Raises
    ------
    OSError, ValueError
        Where a file cannot be read, or has several objects and none of that name.
    """
    if given is None:
        return {}
    if isinstance(given, Mapping) and all(isinstance(one, Partner) for one in given.values()):
        return dict(given)
    if isinstance(given, Mapping):
        pairs = [(str(name), orbit) for name, orbit in given.items()]
    else:
        texts = [given] if isinstance(given, str | os.PathLike) else list(given)
        pairs = [_split(os.fspath(text) if isinstance(text, str | os.PathLike) else text) for text in texts]
    found: dict[str, Partner] = {}
    for name, orbit in pairs:
        try:
            found |= _read(name, orbit)
        except ValueError as error:
            raise ValueError(f"--participant {name[:_NAME]}{'=' if name else ''}{error}") from None
    return found


def _split(text: Any) -> tuple[str, Any]:
    name, equals, path = text.partition("=") if isinstance(text, str) else ("", "", text)
    if not equals or os.path.exists(text):
        return "", text
    if not name.strip() or not path.strip():
        raise ValueError(f"--participant {text[:_NAME]!r}: write NAME=FILE, or FILE alone")
    return name.strip(), path


def _read(name: str, orbit: Any) -> dict[str, Partner]:
    from piazzi.determination.course import HDF5, JSON, course_of
    from piazzi.orbit.paths import opened

    if isinstance(orbit, str | os.PathLike):
        with opened_file(orbit) as file:
            start = file.read(512)
        if not start.startswith(HDF5) and not start.lstrip().startswith(JSON):
            orbit = read_ephemeris(orbit)
    if not isinstance(orbit, Ephemeris):
        named = name or course_of(orbit, Epoch.at(0.0)).name
        if not named:
            raise ValueError(f"{orbit}: nobody says whose orbit it is: NAME={orbit}")
        return {named: Partner(named, orbit, None)}
    if not name:
        return {one: Partner(one, orbit, one) for one in orbit.objects}
    identifiers = {arc.identifier for arc in orbit.arcs}
    chosen = name if name in orbit.objects or name in identifiers else None
    opened(orbit, chosen)
    return {name: Partner(name, orbit, chosen)}


def check_partners(rows: Observations, partners: Mapping[str, Partner], stations: Any) -> None:
    """Raise ValueError for participants of which the tracking knows nothing, and for the object itself among them."""
    if not partners:
        return
    own = {name: np.flatnonzero(rows.object == k) for k, name in enumerate(rows.participants) if name in partners}
    if not {*rows.participants} & partners.keys():
        raise ValueError(f"--participant {listed(partners)}: the tracking does not name it: it has {listed(rows.participants)}")
    lasers = any(segment.wavelength is not None for segment in rows.segments)
    sites = sites_of("ilrs" if lasers and stations is None else stations)
    for name, there in own.items():
        observers = {rows.participants[k] for k in distinct(rows.station[there]) if k >= 0} - partners.keys()
        ground = sorted(one for one in observers if sites is not None and matched(one, sites))
        if ground:
            raise ValueError(f"--participant {name}: that is what {listed(ground)} measured, the object itself: leave it out")


def with_partners(rows: Observations, partners: Mapping[str, Partner]) -> Observations:
    """The rows with participants whose orbits are given as those who measured, whoever received; without rows between two.

    Rows that the object itself received are 1 in the column `ABOARD`.
    """
    if not partners:
        return rows
    given = np.array([*(name in partners for name in rows.participants), False])
    turned = given[rows.object] & ~given[rows.station]
    between = given[rows.object] & given[rows.station]
    left_out = dict(rows.left_out)
    if between.any():
        left_out["rows between participants whose orbits are given"] = int(between.sum())
    rows = replace(
        rows,
        station=np.where(turned, rows.object, rows.station),
        object=np.where(turned, rows.station, rows.object),
        extra={**rows.extra, ABOARD: aboard(rows) | turned | (given[rows.station] & rows.of_kind("pseudorange"))},
    )
    return replace(rows[~between], left_out=tuple(left_out.items()))


def _edge(known: Any, inside: float, outside: float) -> float:
    """The time farthest from one at which it is known, towards another."""
    for _ in range(BISECTIONS if inside != outside else 0):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if known(np.array([middle]))[0] else (inside, middle)
    return inside
