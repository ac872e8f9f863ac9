"""What measurements say that are too few for an orbit: the attributable, and how probable each distance and its rate are.

A short arc of directions gives four of six numbers, a direction and its rate (Milani et al., Celestial Mechanics and
Dynamical Astronomy 90, 2004).  The two others lie in the admissible region: bound orbits above the surface.  At every place of
it the four are fitted anew, and what that leaves of the residuals weighs the place (systematic ranging:
Farnocchia, Chesley and Micheli, Icarus 258, 2015).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.earth import Epoch
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, RATE, Rows, Setting, fitted
from piazzi.orbit.modes import Mode
from piazzi.orbit.region import Region
from piazzi.orbit.starts import Moment, moment
from piazzi.problem.checks import Array

OPEN = 0.3  # of distance or speed, from which on a sigma is no point's
PLACES = (28, 15)  # distances and rates of the grid
ROUNDS, LEAST = 3, 1e-3  # a next grid is where the last has this share of its greatest weight
HELD = 1e-3  # relative sigma by which a place is held: much less than from one to the next
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, eq=False)
class Ridge:
    """Orbits that all fit, along a ridge.

    Attributes
    ----------
    epoch : of the states
    known : how many of the six numbers of an orbit the measurements determine
    attributable : right ascension, declination (rad) and their rates on the sky (rad/s), on the axes of the problem; None where
        no directions change
    sigma : of those four
    distance, rate : (K,), m and m/s from the observer, at the places of the admissible region that were tried
    states : (K, 6), about the centre
    probability : (K,), with the logarithm of the distance and the rate uniform before the measurements
    """

    epoch: Epoch
    known: int
    attributable: Array | None
    sigma: Array | None
    distance: Array
    rate: Array
    states: Array
    probability: Array

    def quantiles(self, values: Any) -> Array:
        """5, 50 and 95 % of values (K,) at the places, by their probability."""
        order = np.argsort(values)
        total = np.cumsum(self.probability[order])
        return np.asarray(np.asarray(values)[order][np.minimum(np.searchsorted(total, QUANTILES), len(order) - 1)])

    def to_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        there = self.attributable is not None and self.sigma is not None
        return {
            "epoch": str(self.epoch), "known": self.known,
            "attributable": {"mean": self.attributable.tolist(), "sigma": self.sigma.tolist()} if there else None,  # type: ignore[union-attr]
            "quantiles": list(QUANTILES),
            "distance": self.quantiles(self.distance).tolist() if len(self.distance) else None,
            "rate": self.quantiles(self.rate).tolist() if len(self.rate) else None,
        }  # fmt: skip

    def __str__(self) -> str:
        lines = [f"a ridge, no orbit: the measurements determine {self.known} of six numbers"]
        if self.attributable is not None and self.sigma is not None:
            place, moving = np.degrees(self.attributable[:2]), np.degrees(self.attributable[2:]) * 3600
            off = np.degrees(self.sigma) * 3600
            lines += [
                f"  on {self.epoch}:",
                f"  right ascension {place[0] % 360:.5f} deg, declination {place[1]:.5f} deg (+- {off[0]:.2g} arcsec),",
                f"  moving {moving[0]:.5g} arcsec/s east and {moving[1]:.5g} arcsec/s north (+- {off[2]:.2g})",
            ]
        if len(self.distance):
            low, middle, high = self.quantiles(self.distance) / 1e3
            slow, _, fast = self.quantiles(self.rate)
            lines += [
                f"  admissible: {middle:,.0f} km away, between {low:,.0f} and {high:,.0f} km with 90 %,",
                f"  going away at {slow:,.0f} to {fast:,.0f} m/s with 90 %",
            ]
        return "\n".join(lines)


def openness(mode: Mode) -> tuple[float, int]:
    """The largest sigma of a mode, as a share of distance and speed, and how many of six directions are below `OPEN`."""
    size = np.repeat([np.linalg.norm(mode.state[:3]), np.linalg.norm(mode.state[3:])], 3)
    values = np.linalg.svd(mode.root[:6, :6] * size, compute_uv=False)
    with np.errstate(divide="ignore"):
        sigma = 1.0 / values
    return float(sigma.max()), int((sigma < OPEN).sum())


def counted(rows: Rows) -> int:
    """How many of the six numbers of an orbit rows determine by their count: at one time a place and its rate at most."""
    numbers = {RANGE: (1, 0), RATE: (0, 1), DIRECTION: (2, 0), POSITION: (3, 0)}
    each = np.array([numbers[kind] for kind in rows.kind.tolist()])
    return min(sum(int(np.minimum(each[rows.t == t].sum(axis=0), 3).sum()) for t in np.unique(rows.t)), 6)


def ridge(rows: Rows, region: Region, begun: Epoch, known: int) -> Ridge:
    """The ridge of rows; `begun` is their time zero."""
    none = np.zeros(0)
    if not (rows.kind == DIRECTION).any():
        return Ridge(begun + float(np.median(rows.t)), known, None, None, none, none, np.zeros((0, 6)), none)
    span = float(np.ptp(rows.t))
    given = moment(rows, float(np.median(rows.t[rows.kind == DIRECTION])), span + 1.0)
    epoch = begun + given.t
    if given.direction is None or given.direction_rate is None or given.distance is not None:
        return Ridge(epoch, known, None, None, none, none, np.zeros((0, 6)), none)
    mean, sigma = _attributable(rows, given, span)
    box = np.array([_ends(given, region), (-1.0, 1.0)])
    for _ in range(ROUNDS):
        place, coordinates = _places(given, region, box)
        square, states = _tried(rows, given, region, place)
        good = np.isfinite(square) & region.holds(states)
        if not good.any():
            return Ridge(epoch, known, mean, sigma, none, none, np.zeros((0, 6)), none)
        room = _speeds(given, region, place[:, 0])[1]  # cells of the grid are as wide
        weight = np.where(good, np.exp(-0.5 * (square - square[good].min())) * room, 0.0)
        box = _smaller(box, coordinates[weight > LEAST * weight.max()])
    kept = weight > 0
    share = weight[kept] / max(weight.sum(), 1e-300)
    return Ridge(epoch, known, mean, sigma, place[kept, 0], place[kept, 1], states[kept], share)


def _attributable(rows: Rows, given: Moment, span: float) -> tuple[Array, Array]:
    """Direction and rate as angles, with sigmas of a straight line through the rows."""
    u, rate = np.asarray(given.direction), np.asarray(given.direction_rate)
    right, dec = float(np.arctan2(u[1], u[0])), float(np.arcsin(u[2]))
    east = np.array([-np.sin(right), np.cos(right), 0.0])
    own = rows.kind == DIRECTION
    dt = rows.t[own] - given.t
    line = np.stack([np.ones(len(dt)), dt / max(span, 1.0)], -1) / rows.sigma[own].max(axis=1)[:, None]
    root = np.linalg.qr(line, mode="r")
    spread = np.sqrt(np.sum(np.linalg.lstsq(root, np.eye(2), rcond=None)[0] ** 2, axis=1)) / [1.0, max(span, 1.0)]
    mean = np.array([right, dec, rate @ east, rate @ np.cross(u, east)])
    return mean, np.array([spread[0], spread[0], spread[1], spread[1]])


def _speeds(given: Moment, region: Region, distance: Array) -> tuple[float, Array]:
    """Rate of the distance of what stands still along the line, and the speed of escape at distances (K,)."""
    L = np.asarray(given.direction)
    r = given.observer + distance[:, None] * L
    return -float(given.velocity @ L), np.sqrt(2 * region.mu / np.linalg.norm(r, axis=1))


def _ends(given: Moment, region: Region) -> tuple[float, float]:
    """The least and the largest distance of the admissible region along the direction."""
    size = float(np.linalg.norm(given.observer))
    along = float(np.asarray(given.direction) @ given.observer)
    top = -along + np.sqrt(max(along**2 + region.highest**2 - size**2, 0.0))
    if not region.on_surface:
        return 1e-2 * size, float(top)  # nearer ones are the Earth's
    return max(float(-along + np.sqrt(max(along**2 + region.lowest**2 - size**2, 0.0))), 1e4), float(top)


def _places(given: Moment, region: Region, box: Array) -> tuple[Array, Array]:
    """Distances and rates (K, 2) within a box of distance and share of escape; and these: evenly in its logarithm and in it."""
    (low, top), (slow, fast) = box
    distance = low * (top / low) ** ((np.arange(PLACES[0]) + 0.5) / PLACES[0])
    share = slow + (fast - slow) * (np.arange(PLACES[1]) + 0.5) / PLACES[1]
    middle, reach = _speeds(given, region, distance)
    far = np.repeat(distance, PLACES[1])
    rate = (middle + reach[:, None] * share).reshape(-1)
    return np.stack([far, rate], -1), np.stack([far, np.tile(share, PLACES[0])], -1)


def _smaller(box: Array, likely: Array) -> Array:
    """The part of a box that holds likely places, and a cell around."""
    wider, cell = (box[0, 1] / box[0, 0]) ** (1.0 / PLACES[0]), (box[1, 1] - box[1, 0]) / PLACES[1]
    low, top = likely[:, 0].min() / wider, likely[:, 0].max() * wider
    slow, fast = likely[:, 1].min() - cell, likely[:, 1].max() + cell
    return np.array([[max(low, box[0, 0]), min(top, box[0, 1])], [max(slow, box[1, 0]), min(fast, box[1, 1])]])


def _tried(rows: Rows, given: Moment, region: Region, place: Array) -> tuple[Array, Array]:
    """Sums of squares (K,) and states (K, 6) of the best orbits at places."""
    setting = Setting(region.mu, given.t)
    found = [_held(rows, given, setting, d, v) for d, v in place]
    return np.array([f[0] for f in found]), np.array([f[1] for f in found]).reshape(-1, 6)


def _held(rows: Rows, given: Moment, setting: Setting, distance: float, rate: float) -> tuple[float, Array]:
    """Sum of squares and state of the best orbit that has this distance and rate at the moment."""
    L = np.asarray(given.direction)
    start = np.concatenate(
        [given.observer + distance * L, given.velocity + distance * np.asarray(given.direction_rate) + rate * L]
    )
    value = np.array([[distance, 0.0, 0.0], [rate, 0.0, 0.0]])
    sigma = np.array([[HELD * distance] * 2, [HELD * float(np.linalg.norm(start[3:]))] * 2])
    two = Rows(
        t=np.full(2, given.t), kind=np.array([float(RANGE), float(RATE)]), observer=np.tile(given.observer, (2, 1)),
        observer_velocity=np.tile(given.velocity, (2, 1)), value=value, sigma=sigma,
        across=np.tile([1.0, 0.0, 0.0], (2, 1)), shared=np.zeros(2),
    )  # fmt: skip
    names = ("t", "kind", "observer", "observer_velocity", "value", "sigma")
    both = replace(rows, **{n: np.concatenate([getattr(rows, n), getattr(two, n)]) for n in names}, **_rest(rows, two))
    found = fitted(both, start, replace(setting, steps=60))
    return (np.inf, start) if not len(found.square) else (float(found.square[0]), found.state[0])


def _rest(rows: Rows, two: Rows) -> dict[str, Any]:
    """Columns that rows may lack."""
    return {
        n: np.concatenate([getattr(rows, n), getattr(two, n)]) for n in ("across", "shared") if getattr(rows, n) is not None
    }
