"""Orbits about a flattened body, fitted to rows of tracking: two-body fits to rows moved by what the flattening does.

Distances of a laser are good to centimetres, and within a quarter of an hour the flattening of the Earth moves a satellite by
hundreds of metres.  A two-body fit puts that into the elements, and the end nearest to the truth need not fit best.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.fits import POSITION, Fits, Rows, Setting, fitted
from piazzi.orbit.region import Region

STEPS = 60  # in a turn of the lowest orbit: both motions are followed alike, so that only their difference matters
ROUNDS = 8  # of a fit each: along a curved valley they go slowly
BEST = 40  # fits that are gone on with


def displaced(states: Array, t: Array, region: Region) -> Array:
    """How far the flattening of `region` takes states (K, 6) by times t (J,) after them, or before: (K, J, 6), m and m/s.

    By steps of Runge and Kutta's method for motions with and without, their difference by cubics between them.
    """
    h = 2.0 * np.pi * np.sqrt(region.lowest**3 / region.mu) / STEPS
    out = np.empty((len(states), len(t), 6))
    for sign, side in ((1.0, t >= 0.0), (-1.0, t < 0.0)):
        if not side.any():
            continue
        far = max(float(np.abs(t[side]).max()), 1.0)
        count = int(np.ceil(far / h))
        step = sign * far / count
        y, nodes, rates = np.stack([states, states]), [np.zeros_like(states)], [_added(states, region)]
        for _ in range(count):
            a = _rate(y, region)
            b = _rate(y + 0.5 * step * a, region)
            c = _rate(y + 0.5 * step * b, region)
            d = _rate(y + step * c, region)
            y = y + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            nodes.append(y[1] - y[0])
            slope = _rate(y, region)
            rates.append(slope[1] - slope[0])
        k = np.minimum((t[side] / step).astype(int), count - 1)
        s = (t[side] / step - k)[:, None, None]
        y0, y1 = np.array(nodes)[k], np.array(nodes)[k + 1]
        f0, f1 = step * np.array(rates)[k], step * np.array(rates)[k + 1]
        bend, twist = 3.0 * (y1 - y0) - 2.0 * f0 - f1, f0 + f1 - 2.0 * (y1 - y0)
        out[:, side] = (y0 + s * (f0 + s * (bend + s * twist))).transpose(1, 0, 2)
    return out


def oblate_fits(rows: Rows, states: Array, setting: Setting, region: Region) -> Fits:
    """Fits from states (K, 6) at the epoch, the best first: each to rows that its own displacement is taken out of."""
    found: list[Fits] = []
    for _ in range(ROUNDS):
        moved = displaced(states, rows.t - setting.epoch, region)
        found = [fitted(_without(rows, d), x, setting) for x, d in zip(states, moved, strict=True)]
        found = sorted((one for one in found if len(one.state)), key=lambda one: float(one.square[0]))[:BEST]
        if not found:
            return fitted(rows, states[:0], setting)
        states = np.concatenate([one.state for one in found])
    return Fits(*(np.concatenate([getattr(one, name) for one in found]) for name in ("state", "offset", "square", "root")))


def _without(rows: Rows, moved: Array) -> Rows:
    """The rows as two-body motion would have them: seen from where the observer is, less the displacement (J, 6)."""
    fixes = (rows.kind == POSITION)[:, None]
    return replace(
        rows, observer=rows.observer - moved[:, :3], observer_velocity=rows.observer_velocity - moved[:, 3:],
        value=np.where(fixes, rows.value - moved[:, :3], rows.value),
    )  # fmt: skip


def _rate(y: Array, region: Region) -> Array:
    """Rates of states without flattening and with it, (2, K, 6)."""
    r2 = np.sum(y[..., :3] ** 2, axis=-1, keepdims=True)
    out = np.concatenate([y[..., 3:], -region.mu / r2**1.5 * y[..., :3]], axis=-1)
    out[1] += _added(y[1], region)
    return out


def _added(y: Array, region: Region) -> Array:
    """What the flattening adds to rates of states (K, 6)."""
    r2 = np.sum(y[:, :3] ** 2, axis=1, keepdims=True)
    tall = 5.0 * y[:, 2:3] ** 2 / r2
    pull = -1.5 * region.mu * region.bulge / r2**2.5 * y[:, :3] * (np.array([1.0, 1.0, 3.0]) - tall)
    return np.concatenate([np.zeros_like(pull), pull], axis=1)
