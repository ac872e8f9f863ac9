"""When a station sees an orbit: spans of time as users say them, nights, and passes above the horizon."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.determination.looking import elevation_of
from piazzi.determination.words import date
from piazzi.earth import Epoch, Station
from piazzi.problem.checks import Array
from piazzi.units import positive_duration

DUSK = np.radians(-6.0)  # of the Sun's elevation: the end of civil twilight, when satellites are seen
MINUTE, DAY = 60.0, 86400.0
NARROWING = 9  # rounds by which a culmination or a crossing is found

Mount = Callable[[Array], Array]


@dataclass(frozen=True)
class Instant:
    """Where the object stands at a time: s past the epoch, azimuth and elevation (rad)."""

    time: float
    azimuth: float
    elevation: float


@dataclass(frozen=True)
class Passage:
    """A pass above the mask; rise or set are None where it is up at the beginning or the end of the span."""

    rise: Instant | None
    culmination: Instant
    set: Instant | None


def span_of(when: Any, station: Station, *, now: Epoch | None = None) -> tuple[Epoch, Epoch]:
    """The two ends of ``"tonight"``, ``"A .. B"``, ``"A .. +6h"`` or a single date.

    Raises
    ------
    ValueError
        For what cannot be read, or a night that does not come.
    """
    if isinstance(when, (list, tuple)) and len(when) == 2:
        begin, end = (Epoch(one) for one in when)
    elif isinstance(when, Epoch):
        return when, when
    else:
        text = str(when).strip()
        if text == "tonight":
            return tonight(station, Epoch(dt.datetime.now(dt.UTC)) if now is None else now)
        first, dots, last = (part.strip() for part in text.partition(".."))
        begin = date(first, "--when")
        if not dots:
            return begin, begin
        end = begin + positive_duration(last[1:], "--when") if last.startswith("+") else date(last, "--when")
    if end < begin:
        raise ValueError(f"--when {when!r}: it ends before it begins")
    return begin, end


def tonight(station: Station, now: Epoch) -> tuple[Epoch, Epoch]:
    """From now, or dusk, to dawn: the Sun is 6 degrees below the horizon; raises ValueError where no night comes in a day."""
    t = MINUTE * np.arange(2 * 1440 + 1)
    dark = elevation_of("sun", station, [now + float(x) for x in t]) < DUSK
    if not dark[:1441].any():
        raise ValueError(f'--when tonight: at {station.name} no night comes within a day of {now}; write "A .. B"')
    begin = int(np.argmax(dark))
    light = np.flatnonzero(~dark[begin:])
    end = begin + int(light[0]) if len(light) else min(begin + 1440, len(t) - 1)
    return now + float(t[begin]), now + float(t[end])


def passages(mount: Mount, t: Array, mask: float) -> list[Passage]:
    """All passes above an elevation between the first and the last of times.

    Parameters
    ----------
    mount : gives azimuth and elevation (K, 2) at times (K,)
    t : (K,), increasing: looks, so near that one rise and fall lies between no three of them; culminations between them are
        found, so that a pass may be shorter
    mask : rad
    """
    elevation = mount(t)[:, 1]
    top = np.flatnonzero((elevation[1:-1] >= elevation[:-2]) & (elevation[1:-1] > elevation[2:])) + 1
    peaks = _culminations(mount, t[top - 1], t[top + 1])
    nodes = np.concatenate([t, peaks])
    heights = np.concatenate([elevation, mount(peaks)[:, 1] if len(peaks) else peaks])
    order = np.argsort(nodes, kind="stable")
    nodes, heights = nodes[order], heights[order]
    up = heights > mask
    change = np.flatnonzero(up[1:] != up[:-1])
    edges = _crossings(mount, nodes[change], nodes[change + 1], heights[change] - mask, heights[change + 1] - mask, mask)
    starts = [0, *(change + 1).tolist()]
    stops = [*(change + 1).tolist(), len(nodes)]
    found = []
    for i, (first, stop) in enumerate(zip(starts, stops, strict=True)):
        if up[first]:
            best = first + int(np.argmax(heights[first:stop]))
            found.append((edges[i - 1] if i else None, nodes[best], edges[i] if i < len(edges) else None))
    return _told(mount, found)


def _culminations(mount: Mount, low: Array, high: Array) -> Array:
    """Times of the highest elevation between two, all of them narrowed at once."""
    for _ in range(NARROWING if len(low) else 0):
        inner = np.linspace(low, high, 6)
        heights = mount(inner.reshape(-1))[:, 1].reshape(inner.shape)
        best = np.clip(np.argmax(heights, axis=0), 1, 4)
        every = np.arange(len(low))
        low, high = inner[best - 1, every], inner[best + 1, every]
    return np.asarray((low + high) / 2)


def _crossings(mount: Mount, low: Array, high: Array, before: Array, after: Array, mask: float) -> Array:
    """Times at which an elevation passes the mask, by the Illinois method, all of them at once."""
    middle, side = low, np.zeros(len(low))
    for _ in range(NARROWING if len(low) else 0):
        middle = np.clip(low - before * (high - low) / (after - before), low, high)
        value = mount(middle)[:, 1] - mask
        right = np.sign(value) == np.sign(after)  # the crossing lies before the middle
        before = np.where(right, np.where(side > 0, before / 2, before), value)
        after = np.where(right, value, np.where(side < 0, after / 2, after))
        low, high = np.where(right, low, middle), np.where(right, middle, high)
        side = np.where(right, 1.0, -1.0)
    return middle


def _told(mount: Mount, found: list[tuple[float | None, float, float | None]]) -> list[Passage]:
    times = np.array([t for one in found for t in one if t is not None])
    looks = dict(zip(times.tolist(), mount(times).tolist(), strict=True)) if len(times) else {}

    def instant(t: float) -> Instant:
        azimuth, elevation = looks[float(t)]
        return Instant(float(t), azimuth % (2.0 * np.pi), elevation)

    return [Passage(None if a is None else instant(a), instant(b), None if c is None else instant(c)) for a, b, c in found]
