"""Where fits of unknown orbits begin: what classical methods say, and a sample of all that one moment of tracking allows.

At one moment there are six numbers: direction (2), distance, their rates.  What the rows near it tell is taken, the rest is
drawn from a low-discrepancy sequence within the admissible region (Milani et al., Celestial Mechanics and Dynamical Astronomy
90, 2004; Tommei et al., 97, 2007): bound orbits that stay above the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from piazzi.arrays import Array, distinct
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, RATE, Rows
from piazzi.orbit.from_directions import gauss
from piazzi.orbit.gooding import gooding
from piazzi.orbit.lambert import lambert
from piazzi.orbit.region import Region
from piazzi.orbit.two_body import propagate_kepler

SAMPLES = {0: 1, 1: 64, 2: 512, 3: 2048, 4: 4096, 5: 8192, 6: 8192}
LINKED = 4096  # pairs of distances
SUBSETS = 12  # pairs or triples of rows for the classical methods
SLOW = 2  # triples that the method of Gooding takes: a tenth of a second each
_RATIOS = np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])


def halton(count: int, dimensions: int) -> Array:
    """Points (count, dimensions) of Halton's sequence (Numerische Mathematik 2, 1960), without its first."""
    out = np.zeros((count, dimensions))
    for d in range(dimensions):
        index, factor = np.arange(1, count + 1), 1.0
        while index.any():
            factor /= _RATIOS[d]
            index, digit = np.divmod(index, int(_RATIOS[d]))
            out[:, d] += factor * digit
    return out


@dataclass(frozen=True)
class Moment:
    """What rows of one observer tell about one moment: None where they do not."""

    t: float
    observer: Array
    velocity: Array
    direction: Array | None = None
    direction_rate: Array | None = None
    distance: float | None = None
    rate: float | None = None


def moment(rows: Rows, t: float, about: float) -> Moment:
    """Values and rates at `t`, by straight lines through the rows of the observer nearest in time, within `about` seconds."""
    nearest = int(np.argmin(np.abs(rows.t - t)))
    place, velocity = rows.observer[nearest], rows.observer_velocity[nearest]
    here = np.linalg.norm(rows.observer - place, axis=1) <= 1e3 + 2.0 * np.linalg.norm(velocity) * np.abs(
        rows.t - rows.t[nearest]
    )
    near = here & (np.abs(rows.t - rows.t[nearest]) <= about)
    t = float(rows.t[nearest])
    direction, direction_rate = _line(rows, near & (rows.kind == DIRECTION), t)
    if direction is not None:
        size = np.linalg.norm(direction)
        direction = direction / size
        if direction_rate is not None:
            direction_rate = (direction_rate - (direction_rate @ direction) * direction) / size
    distance, slope = _line(rows, near & (rows.kind == RANGE), t)
    rate, _ = _line(rows, near & (rows.kind == RATE), t)
    rate = slope if rate is None else rate
    return Moment(
        t, place, velocity, direction, direction_rate,
        None if distance is None else float(distance[0]), None if rate is None else float(rate[0]),
    )  # fmt: skip


def _line(rows: Rows, which: Array, t: float) -> tuple[Array | None, Array | None]:
    """Value and rate at `t` of a parabola (a line through fewer than five rows), None where there are too few."""
    if not which.any():
        return None, None
    dt, values = rows.t[which] - t, rows.value[which]
    if len(distinct(dt)) < 2:
        return values[np.argmin(np.abs(dt))], None
    degree = 2 if len(distinct(dt)) >= 5 else 1
    scale = np.abs(dt).max()
    found = np.linalg.lstsq(np.vander(dt / scale, degree + 1, increasing=True), values, rcond=None)[0]
    return found[0], found[1] / scale


def sampled(given: Moment, region: Region) -> Array:
    """States (K, 6) at the moment that agree with what is known there, and are admissible."""
    unknown = 2 * (given.direction is None) + (given.distance is None)
    turning = given.direction is not None and given.direction_rate is not None
    unknown += (given.rate is None) + (0 if turning else 2)
    count = SAMPLES[min(unknown, 6)]
    u = iter(halton(count, max(unknown, 1)).T)
    L = (
        np.tile(given.direction, (count, 1))
        if given.direction is not None
        else _directions(given.observer, next(u), next(u), region)
    )
    rho = np.full(count, given.distance) if given.distance is not None else _distances(given.observer, L, next(u), region)
    r = given.observer + rho[:, None] * L
    d = np.linalg.norm(r, axis=1)
    base = given.velocity + rho[:, None] * given.direction_rate if turning else np.broadcast_to(given.velocity, r.shape)
    along = np.sum(base * L, axis=1)
    escape = np.sqrt(2 * region.mu / d)
    if turning:
        room = np.maximum(escape**2 - np.sum(base**2, axis=1) + along**2, 0.0)
        speed = given.rate if given.rate is not None else -along + np.sqrt(room) * (2 * next(u) - 1)
        return _admissible(np.hstack([r, base + np.broadcast_to(speed, (count,))[:, None] * L]), region)
    rate = given.rate if given.rate is not None else _spread(next(u)) * escape - along
    size = np.sqrt(region.mu / d) * _speeds(next(u))  # of the whole velocity, circular ones foremost
    lengthwise = np.broadcast_to(rate, (count,)) + along
    across = np.sqrt(np.maximum(size**2 - lengthwise**2, 0.0))
    first = np.cross(L, np.eye(3)[np.argmin(np.abs(L), axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    angle = 2 * np.pi * next(u)
    v = lengthwise[:, None] * L + across[:, None] * (
        np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(L, first)
    )
    return _admissible(np.hstack([r, v]), region)


def linked(first: Moment, last: Moment, region: Region) -> Array:
    """States (K, 6) at the first moment on orbits through both directions, at distances drawn, both ways and with turns."""
    if first.direction is None or last.direction is None or not last.t > first.t:
        return np.zeros((0, 6))
    u = halton(LINKED, 2).T
    ends = [
        m.observer + _distances(m.observer, np.tile(m.direction, (LINKED, 1)), w, region)[:, None] * m.direction
        for m, w in zip((first, last), u, strict=True)
        if m.direction is not None
    ]
    dt, states = last.t - first.t, []
    for turns, late in _turns(dt, region):
        for prograde in (True, False):
            v, _ = lambert(ends[0], ends[1], dt, region.mu, prograde=prograde, turns=turns, late=late)
            states.append(np.hstack([ends[0], v]))
    nearly = replace(region, lowest=0.7 * region.lowest)  # distances are drawn coarsely
    return _admissible(np.concatenate(states), nearly)


def _spread(u: Array) -> Array:
    """From 0 to 1 to -1 to 1."""
    return 2.0 * u - 1.0


def _speeds(u: Array) -> Array:
    """Of the circular speed: half of them within a twentieth of it, the rest up to that of escape."""
    return np.where(u < 0.5, 0.95 + 0.2 * u, 0.75 + 0.66 * (2 * u - 1))


def _directions(observer: Array, u: Array, w: Array, region: Region) -> Array:
    """Unit vectors, above the horizon of an observer on a body."""
    height = u if region.on_surface else 2 * u - 1
    flat = np.sqrt(np.maximum(1 - height**2, 0.0))
    local = np.stack([flat * np.cos(2 * np.pi * w), flat * np.sin(2 * np.pi * w), height], -1)
    up = observer / max(float(np.linalg.norm(observer)), 1e-300)
    east = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    east /= np.linalg.norm(east)
    return np.asarray(local @ np.array([east, np.cross(up, east), up]))


def _distances(observer: Array, L: Array, u: Array, region: Region) -> Array:
    """Distances, uniform in the logarithm of what lies between the lowest and the highest orbit along each direction."""
    along, size = L @ observer, float(np.linalg.norm(observer))
    top = -along + np.sqrt(np.maximum(along**2 + region.highest**2 - size**2, 0.0))
    low = -along + np.sqrt(np.maximum(along**2 + region.lowest**2 - size**2, 0.0)) if region.on_surface else 0.01 * size
    low = np.maximum(low, 1e-6 * region.highest)
    return np.asarray(low * (np.maximum(top, 1.0001 * low) / low) ** u)


def _admissible(states: Array, region: Region) -> Array:
    return states[region.holds(states)]


def classical(rows: Rows, epoch: float, region: Region) -> Array:
    """States (K, 6) at `epoch` by every classical method that the rows allow, on well-spread subsets."""
    told = [*_by_positions(rows, region)] or _by_directions(rows, region)
    found = [s for s in told if np.isfinite(s[1]).all()]
    if not found:
        return np.zeros((0, 6))
    t, states = np.array([s[0] for s in found]), np.array([s[1] for s in found])
    keep = region.holds(states)
    if not keep.any():
        return np.zeros((0, 6))
    r, v = propagate_kepler(states[keep, :3], states[keep, 3:], region.mu, epoch - t[keep])
    return np.hstack([r, v])


def places(rows: Rows) -> tuple[Array, Array]:
    """Times and positions (K, 3) of the body: fixes, and distances with the direction of the same moment and observer."""
    fixes = rows.kind == POSITION
    t, r = [*rows.t[fixes]], [*rows.value[fixes]]
    seen = {(float(rows.t[j]), rows.observer[j].tobytes()): rows.value[j] for j in np.flatnonzero(rows.kind == DIRECTION)}
    for j in np.flatnonzero(rows.kind == RANGE):
        direction = seen.get((float(rows.t[j]), rows.observer[j].tobytes()))
        if direction is not None:
            t.append(rows.t[j])
            r.append(rows.observer[j] + rows.value[j, 0] * direction)
    order = np.argsort(np.array(t), kind="stable")
    return np.array(t)[order], np.array(r).reshape(-1, 3)[order]


def _by_positions(rows: Rows, region: Region) -> Iterator[tuple[float, Array]]:
    """Lambert's problem between places, near and far, both ways and with turns."""
    t, r = places(rows)
    for i, j in _pairs(t):
        for prograde in (True, False):
            for turns, late in _turns(t[j] - t[i], region):
                try:
                    v, _ = lambert(r[i], r[j], t[j] - t[i], region.mu, prograde=prograde, turns=turns, late=late)
                except ValueError:
                    continue
                yield float(t[i]), np.concatenate([r[i], v])


def _turns(dt: float, region: Region) -> list[tuple[int, bool]]:
    """Numbers of turns that the lowest orbit could make, each early and late; few of them."""
    lowest = 2 * np.pi * np.sqrt(region.lowest**3 / region.mu)
    return [(0, False)] + [(k, late) for k in range(1, min(int(dt / lowest), 6) + 1) for late in (False, True)]


def _pairs(t: Array) -> list[tuple[int, int]]:
    """Pairs of indices, from neighbours to both ends."""
    if len(t) < 2:
        return []
    picks = distinct(np.linspace(0, len(t) - 1, min(len(t), 5)).astype(int))
    pairs = [(0, len(t) - 1), *pairwise(picks.tolist()), *pairwise(range(0, len(t), max(1, len(t) // 4)))]
    return [(i, j) for i, j in dict.fromkeys(pairs) if t[j] > t[i]][:SUBSETS]


def _by_directions(rows: Rows, region: Region) -> Iterator[tuple[float, Array]]:
    """Gauss's method and Gooding's on three directions, in the middle and far apart."""
    seen = rows.of(np.flatnonzero(rows.kind == DIRECTION))
    order = np.argsort(seen.t, kind="stable")
    times = seen.t[order]
    for k, triple in enumerate(_triples(times)):
        three = order[list(triple)]
        t, L, R = seen.t[three], seen.value[three], seen.observer[three]
        for method in (gauss, gooding) if k < SLOW else (gauss,):
            try:
                for found in method(t, L, R, region.mu):
                    yield found.t, np.concatenate([found.r, found.v])
            except ValueError:
                continue


def _triples(t: Array) -> list[tuple[int, int, int]]:
    """Three times each: the whole span, its halves, and neighbourhoods."""
    found: list[tuple[int, int, int]] = []
    for a, b in ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0), (0.25, 0.75), (0.0, 0.25), (0.75, 1.0)):
        if len(t) < 3:
            break
        low, high = t[0] + a * (t[-1] - t[0]), t[0] + b * (t[-1] - t[0])
        picks = [int(np.argmin(np.abs(t - at))) for at in (low, 0.5 * (low + high), high)]
        if t[picks[0]] < t[picks[1]] < t[picks[2]]:
            found.append((picks[0], picks[1], picks[2]))
    return list(dict.fromkeys(found))[:SUBSETS]
