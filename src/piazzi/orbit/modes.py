"""All two-body orbits that fit some rows of tracking: many starts, many fits, merged and weighed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, compress

import numpy as np

from piazzi.arrays import Array, distinct, median
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, Fits, Rows, Setting, fitted, squares
from piazzi.orbit.oblate import oblate_fits
from piazzi.orbit.region import Region
from piazzi.orbit.starts import Moment, classical, linked, moment, sampled
from piazzi.orbit.two_body import propagate_kepler
from piazzi.text import brief

BEST = 60  # samples that are fitted
LONG = 120  # steps of the last fits: along a curved valley
SAME = 25.0  # squared Mahalanobis distance within which two ends are one
GAP, ENOUGH = 900.0, 4  # s between passes, and rows of one that a search can begin with
UNLIKELY = 60.0  # by which twice the logarithm of the evidence may be less


@dataclass(frozen=True, eq=False)
class Mode:
    """One orbit that fits.

    Attributes
    ----------
    state : (6,) position and velocity at the epoch
    root : (7, 7) upper triangle U with information U^T U of state and constant of the rates
    offset : the constant
    square : sum of squares of the residuals in units of their sigmas
    probability : among all modes, by Laplace's approximation of the evidence
    admissible : whether the orbit is bound and stays above the surface
    """

    state: Array
    root: Array
    offset: float
    square: float
    probability: float
    admissible: bool

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Search:
    """Modes, the most probable first, and how many starts and fits they come from.

    `others` are ends far less probable, the most probable first.  Where two-body motion lacks more than the sigmas of the rows
    its residuals say little about which end is nearest to the truth.
    """

    epoch: float
    modes: tuple[Mode, ...]
    starts: int
    fits: int
    others: tuple[Mode, ...] = ()

    @property
    def best(self) -> tuple[Mode, ...]:
        """The modes that are admissible; all where none is."""
        return tuple(m for m in self.modes if m.admissible) or self.modes

    __repr__ = brief


def two_body_modes(
    rows: Rows, region: Region, *, epoch: float | None = None, motion: float = 0.0, offset_sigma: float = 0.0
) -> Search:
    """Every two-body orbit that fits the rows.

    Parameters
    ----------
    rows : of one pass, or of passes within a few revolutions
    region : which orbits are admissible
    epoch : s, of the states; the middle row
    motion : m/s^2, what two-body motion lacks: by it rows count less, the farther they are from the epoch
    offset_sigma : of a constant that all rates share, m/s
    """
    epoch = median(rows.t) if epoch is None else epoch
    setting = Setting(region.mu, epoch, offset_sigma=offset_sigma, motion=motion)
    few = thinned(rows, 24)
    moments = _moments(rows, region)
    starts = [classical(rows, epoch, region), *(_best(few, m.t, sampled(m, region), setting) for m in moments)]
    starts += [_best(few, a.t, linked(a, b, region), setting) for a, b in combinations(sorted(moments, key=_time), 2)]
    drawn = np.concatenate(starts)
    if not len(drawn):
        return Search(epoch, (), 0, 0)
    found = fitted(few, drawn, setting)
    best = _distinct(found, 40)
    ends = np.hstack([found.state[best], found.offset[best, None]])
    found = fitted(thinned(rows, 200), ends, replace(setting, steps=LONG))
    nearest = int(np.argmin(np.abs(rows.t - epoch)))
    modes, others = _weighed(found, region, offset_sigma, rows.observer[nearest])
    return Search(epoch, modes, len(drawn), len(found.square), others)


def oblate_modes(rows: Rows, search: Search, region: Region) -> Search:
    """The modes of rows about a flattened body, from all ends of a search that did without, and from those of each pass."""
    setting = Setting(region.mu, search.epoch, steps=LONG)
    ends = [m.state for m in (*search.modes, *search.others)]
    parts = _passes(rows)
    for part in parts if len(parts) > 1 else []:
        own = two_body_modes(rows.of(part), region)
        for mode in (*own.modes, *own.others):
            r, v = propagate_kepler(mode.state[:3], mode.state[3:], region.mu, search.epoch - own.epoch)
            ends.append(np.concatenate([r, v]))
    found = oblate_fits(thinned(rows, 200), np.array(ends).reshape(-1, 6), setting, region)
    nearest = int(np.argmin(np.abs(rows.t - search.epoch)))
    modes, others = _weighed(found, region, 0.0, rows.observer[nearest])
    return Search(search.epoch, modes, search.starts, search.fits + len(found.square), others)


def _passes(rows: Rows) -> list[Array]:
    """Indices of the rows of each pass, where they are enough to begin with."""
    order = np.argsort(rows.t, kind="stable")
    return [part for part in np.split(order, np.flatnonzero(np.diff(rows.t[order]) > GAP) + 1) if len(part) >= ENOUGH]


def thinned(rows: Rows, most: int) -> Rows:
    """At most so many rows, evenly among those of every kind."""
    picks = []
    for kind in distinct(rows.kind):
        of = np.flatnonzero(rows.kind == kind)
        of = of[np.argsort(rows.t[of], kind="stable")]
        share = max(3, round(most * len(of) / len(rows)))
        picks.append(of[distinct(np.linspace(0, len(of) - 1, min(share, len(of))).astype(int))])
    return rows.of(np.sort(np.concatenate(picks)))


def _moments(rows: Rows, region: Region) -> list[Moment]:
    """Moments whose rows tell most: where there are directions, else distances, else rates."""
    if (rows.kind == POSITION).any():
        return []
    told = next(k for k in (DIRECTION, RANGE, 2) if (rows.kind == k).any())
    t = np.sort(rows.t[rows.kind == told])
    about = 0.01 * 2 * np.pi * np.sqrt(region.lowest**3 / region.mu)  # a hundredth of the shortest period
    return [moment(rows, float(t[int(q * (len(t) - 1))]), about) for q in (0.5, 0.1, 0.9)]


def _time(given: Moment) -> float:
    return given.t


def _best(few: Rows, t: float, states: Array, setting: Setting) -> Array:
    """The best of a sample of states at `t`, moved to the epoch."""
    if not len(states):
        return states
    there = replace(setting, epoch=t)
    best = np.argsort(squares(few, states, there), kind="stable")[:BEST]
    r, v = propagate_kepler(states[best, :3], states[best, 3:], setting.mu, setting.epoch - t)
    return np.hstack([r, v])


def _distinct(found: Fits, most: int) -> list[int]:
    """Ends that are not the same as a better one, by Mahalanobis' distance."""
    kept: list[int] = []
    unknowns = np.hstack([found.state, found.offset[:, None]])
    for k in range(len(unknowns)):
        if len(kept) == most:
            break
        if all(np.sum((found.root[i] @ (unknowns[k] - unknowns[i])) ** 2) > SAME for i in kept):
            kept.append(k)
    return kept


def density(state: Array, observer: Array) -> Array:
    """Logarithm of the density of states (K, 6) before the measurements, up to a constant.

    Directions and their rates are uniform, and so are the rate of the distance and the logarithm of the distance (which has no
    unit that it prefers): of d^3r d^3v this is distance^-5.  A density that is uniform in states would call what is far away,
    and fast, more probable than what is near.
    """
    return np.asarray(-5.0 * np.log(np.maximum(np.linalg.norm(state[:, :3] - observer, axis=1), 1.0)))


def _weighed(found: Fits, region: Region, offset_sigma: float, observer: Array) -> tuple[tuple[Mode, ...], tuple[Mode, ...]]:
    """Modes with their evidence, and those far below the best."""
    kept = _distinct(found, len(found.square))
    if not kept:
        return (), ()
    used = slice(7 if offset_sigma > 0 else 6)
    least = 1e-300  # of rows that leave a direction open, where the evidence has no bound
    volume = np.array([np.log(np.maximum(np.abs(np.diag(found.root[k])[used]), least)).sum() for k in kept])
    score = -0.5 * found.square[kept] - volume + density(found.state[kept], observer)
    inside = region.holds(found.state[kept])
    top = score[inside].max() if inside.any() else score.max()
    weight = np.where(inside, np.exp(np.minimum(score - top, 0.0)), 0.0)
    share = weight / weight.sum() if weight.sum() > 0 else weight
    order = np.argsort(-score - 1e6 * inside, kind="stable")
    ends = [
        Mode(found.state[k], found.root[k], float(found.offset[k]), float(found.square[k]), float(share[i]), bool(inside[i]))
        for i, k in ((int(i), kept[int(i)]) for i in order)
    ]
    near = score[order] > top - 0.5 * UNLIKELY
    return tuple(compress(ends, near)), tuple(compress(ends, ~near))
