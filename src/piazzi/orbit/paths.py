"""Orbits to compare, of whatever kind: rows of an ephemeris, mean elements or a function, all as states in the GCRF."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.earth import Epoch, rotation, transform
from piazzi.earth.forces import STATES
from piazzi.earth.rotation import frame_named
from piazzi.earth.subdaily import WITHIN_THE_DAY
from piazzi.formats import Arc, Ephemeris, read_ephemeris
from piazzi.formats.ephemeris import MeanElements
from piazzi.orbit.axes import orbit_axes
from piazzi.orbit.interpolation import interpolated
from piazzi.orbit.mean_elements import sgp4_states

_LOCAL = {"RTN": "RTN", "RSW": "RTN", "RIC": "RTN", "TNW": "TNW", "RTN_ROTATING": "RTN", "TNW_ROTATING": "TNW"}
_SAME = 1e-3  # s: a covariance is of a state that is as near as this
States = Callable[[Sequence[Epoch]], tuple[Any, Any]]


class Path(Protocol):
    """An orbit: its name, where it has rows of its own (s past an epoch), and what it is at other times."""

    name: str

    def rows(self) -> Array: ...
    def covered(self, t: Array) -> Array: ...
    def states(self, t: Array) -> tuple[Array, Array]: ...
    def covariances(self, t: Array, r: Array, v: Array) -> Array: ...
    def told(self) -> dict[str, Any]: ...


@dataclass(eq=False)
class Rows:
    """Arcs of one object, put into the GCRF once."""

    name: str
    arcs: tuple[Arc, ...]
    zero: Epoch
    degree: int | None

    def __post_init__(self) -> None:
        self._nodes = [_nodes(arc, self.zero) for arc in self.arcs]
        self._used = dict[str, Any](method="rows", degree=0, error=0.0)

    def rows(self) -> Array:
        """Times of all rows, and of all covariances."""
        dated = [arc.covariance_t + (arc.epoch - self.zero) for arc in self.arcs]
        return distinct(np.concatenate([*(nodes[0] for nodes in self._nodes), *dated]))

    def covered(self, t: Array) -> Array:
        """Whether an arc reaches over each time."""
        inside = np.zeros(len(t), dtype=bool)
        for arc, (nodes, _, _) in zip(self.arcs, self._nodes, strict=True):
            first, last = _span(arc, nodes, self.zero)
            inside |= (t >= first) & (t <= last)
        return inside

    def states(self, t: Array) -> tuple[Array, Array]:
        """By a polynomial; of two arcs that overlap, the later one."""
        r, v = np.full((len(t), 3), np.nan), np.full((len(t), 3), np.nan)
        for arc, (nodes, position, velocity) in zip(self.arcs, self._nodes, strict=True):
            first, last = _span(arc, nodes, self.zero)
            here = (t >= first) & (t <= last)
            if not here.any():
                continue
            told = arc.degree if self.degree is None else self.degree
            found = interpolated(nodes, position, velocity, t[here], told)
            r[here], v[here] = found.r, found.v
            between = ~np.isin(t[here], nodes)
            if between.any():
                self._used["method"] = found.method
                self._used["degree"] = max(self._used["degree"], found.degree)
                self._used["error"] = max(self._used["error"], found.error)
        return r, v

    def covariances(self, t: Array, r: Array, v: Array) -> Array:
        """Of positions, (K, 3, 3) in the GCRF; NaN where the file has none for that time."""
        out = np.full((len(t), 3, 3), np.nan)
        for arc in self.arcs:
            since = arc.epoch - self.zero
            own = np.isfinite(arc.sigma).all(axis=1)
            if own.any():
                blocks = np.eye(3) * arc.sigma[own][:, None, :] ** 2
                self._fill(out, t, r, v, arc.t[own] + since, blocks, str(arc.frame))
            for frame in dict.fromkeys(arc.covariance_frames):
                of = np.array([f == frame for f in arc.covariance_frames])
                self._fill(out, t, r, v, arc.covariance_t[of] + since, arc.covariance[of, :3, :3], frame)
        return out

    def _fill(self, out: Array, t: Array, r: Array, v: Array, when: Array, blocks: Array, frame: str) -> None:
        """Put blocks in axes of a `frame` where their times are among `t`, turned block by block."""
        order = np.argsort(when)
        place = np.clip(np.searchsorted(when[order], t - _SAME), 0, len(when) - 1)
        found = np.flatnonzero(np.abs(when[order][place] - t) < _SAME)
        P = blocks[order][place[found]]
        local = _LOCAL.get(frame.upper())
        dates = [self.zero + float(x) for x in t[found]]
        R = orbit_axes(r[found], v[found], local) if local else rotation("GCRF", frame, dates, WITHIN_THE_DAY)
        out[found] = np.swapaxes(R, -1, -2) @ P @ R

    def told(self) -> dict[str, Any]:
        """How states between the rows were made, and within how many metres."""
        return self._used


@dataclass(eq=False)
class Anywhere:
    """An orbit that has a state at every date."""

    name: str
    function: States
    zero: Epoch
    method: str

    def rows(self) -> Array:
        """None of its own."""
        return np.zeros(0)

    def covered(self, t: Array) -> Array:
        """Everywhere."""
        return np.ones(len(t), dtype=bool)

    def states(self, t: Array) -> tuple[Array, Array]:
        """What the function says."""
        r, v = (np.asarray(a, dtype=float) for a in self.function([self.zero + float(x) for x in t]))
        if r.shape != (len(t), 3) or v.shape != (len(t), 3):
            raise ValueError(f"{self.name} gives shapes {r.shape} and {v.shape} for {len(t)} dates; they must be ({len(t)}, 3)")
        return r, v

    def covariances(self, t: Array, r: Array, v: Array) -> Array:
        """None."""
        return np.full((len(t), 3, 3), np.nan)

    def told(self) -> dict[str, Any]:
        """Nothing is interpolated."""
        return {"method": self.method, "degree": 0, "error": 0.0}


def opened(what: Any, chosen: str | None) -> tuple[str, Any]:
    """The name and content of an orbit: a tuple of arcs, mean elements or a function.

    Raises
    ------
    ValueError
        For a file that has several objects of which none is chosen, or not that one, and what is no orbit.
    """
    if isinstance(what, (str, os.PathLike)):
        what = read_ephemeris(what)
    if isinstance(what, Arc):
        return what.name or "arc", (what,)
    if isinstance(what, MeanElements):
        return what.name or "mean elements", what
    if isinstance(what, Ephemeris):
        name = os.path.basename(what.file) or "ephemeris"
        objects = list(what.objects)
        if chosen is not None and len(objects) > 1:
            objects = [o for o in objects if o == chosen or (what.of(o) and what.of(o)[0].identifier == chosen)]
        if len(objects) != 1:
            listed = ", ".join(what.objects[:8]) + (f" and {len(what.objects) - 8} more" if len(what.objects) > 8 else "")
            raise ValueError(
                f"{name} holds {listed or 'no orbit'}; " + ("say which object" if chosen is None else f"not {chosen}")
            )
        return name, what.of(objects[0]) or next(m for m in what.mean if m.name == objects[0])
    if isinstance(what, tuple) and len(what) == 2 and hasattr(what[1], "truth"):
        return what[0].name or "truth", truth_of(*what)
    if callable(what):
        return str(getattr(what, "__name__", "function")), what
    raise ValueError(
        "an orbit is a file, an Ephemeris, an Arc, MeanElements, a problem with its tracking or a function of dates, "
        f"not a {type(what).__name__}"
    )


def truth_of(problem: Any, tracking: Any) -> tuple[Arc]:
    """The truth of a tracking as an arc.

    Raises
    ------
    ValueError
        Where there is none, no date, or states are not those of an orbit about the Earth.
    """
    who, states = problem.name or "the tracking", list(problem.model.states)
    if not {*STATES} <= {*states} or not {"field", "fixed", "free"} <= {*problem.functions}:
        raise ValueError(f"{who} is no orbit about the Earth: its states are {', '.join(states)}")
    if problem.epoch is None:
        raise ValueError(f"{who} has no epoch: its truth has no dates")
    if tracking.truth is None:
        raise ValueError(f"{who} has no truth")
    x = tracking.truth[:, [states.index(name) for name in STATES]]
    return (
        Arc(
            epoch=problem.epoch, t=tracking.times, position=x[:, :3], velocity=x[:, 3:], name=who, centre="EARTH", frame="GCRF",
            scale="UTC",
        ),
    )  # fmt: skip


def path_of(name: str, what: Any, zero: Epoch, degree: int | None) -> Path:
    """The orbit with times past `zero`."""
    if isinstance(what, MeanElements):
        return Anywhere(name, lambda dates: sgp4_states(what, dates, "GCRF"), zero, "SGP4")
    if callable(what):
        return Anywhere(name, what, zero, "function")
    return Rows(name, what, zero, degree)


def first_date(what: Any) -> Epoch | None:
    """An instant that the orbit is dated by, None for a function."""
    if isinstance(what, MeanElements):
        return what.epoch
    return None if callable(what) else what[0].epoch


def _nodes(arc: Arc, zero: Epoch) -> tuple[Array, Array, Array | None]:
    """Times past `zero`, positions and velocities in the GCRF of the rows that have a position."""
    who = arc.called
    if arc.frame is None:
        raise ValueError(f"the file does not say in which axes positions of {who} are")
    if arc.centre not in (None, "EARTH") or arc.frame_epoch is not None:
        raise ValueError(
            f"positions of {who} are about {arc.centre} in {arc.frame} of a date; orbits about the Earth are compared"
        )
    kept = np.isfinite(arc.position).all(axis=1)
    order = np.argsort(arc.t[kept], kind="stable")
    t, r, v = arc.t[kept][order], arc.position[kept][order], arc.velocity[kept][order]
    t, first = np.unique(t, return_index=True)
    r, v = r[first], v[first]
    if len(t) < 2:
        raise ValueError(f"an arc of {who} has {len(t)} position; two and more can be compared: propagate it first")
    has_velocity = bool(np.isfinite(v).all())
    if frame_named(arc.frame) not in ("GCRF", "ICRF"):
        dates = [arc.epoch + float(x) for x in t]
        r, turned = transform(r, v if has_velocity else None, arc.frame, "GCRF", dates, WITHIN_THE_DAY)
        v = np.asarray(turned) if has_velocity else v
    return t + (arc.epoch - zero), r, v if has_velocity else None


def _span(arc: Arc, nodes: Array, zero: Epoch) -> tuple[float, float]:
    first, last = arc.useable
    begin = float(nodes[0]) if first is None else max(float(nodes[0]), first - zero)
    return begin, float(nodes[-1]) if last is None else min(float(nodes[-1]), last - zero)
