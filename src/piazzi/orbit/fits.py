"""Two-body orbits fitted to a few rows of tracking from many starts at once, and what classical methods start from: `Rows`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.orbit.library import fit_library
from piazzi.text import brief

RANGE, RATE, DIRECTION, POSITION = 1, 2, 3, 4
_ROW = 20  # numbers of a row, as the kernel reads them


@dataclass(frozen=True, eq=False, kw_only=True)
class Rows:
    """Measurements of one body as vectors, in one set of axes that do not turn, about the centre of attraction.

    Attributes
    ----------
    t : (J,), s, of reception
    kind : (J,), `RANGE`, `RATE` (positive when receding), `DIRECTION` or `POSITION`
    observer, observer_velocity : (J, 3), m, m/s
    value : (J, 3), a number in the first column, a unit vector towards the body, or a position
    sigma : (J, 2), of the value (m, m/s), of both components of a direction (rad), or of each component of a position
    across : (J, 3), unit vector across a direction, along which its first sigma is; None where both are alike
    shared : (J,), 1 for rates that share one unknown constant, else 0
    """

    t: Array
    kind: Array
    observer: Array
    observer_velocity: Array
    value: Array
    sigma: Array
    across: Array | None = None
    shared: Array | None = None

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.t)

    def of(self, rows: Any) -> Rows:
        """Only these rows."""
        fields = ("t", "kind", "observer", "observer_velocity", "value", "sigma", "across", "shared")
        return replace(self, **{name: a[rows] for name in fields if (a := getattr(self, name)) is not None})

    def at(self, epoch: float, motion: float) -> Array:
        """What the kernel reads: times from `epoch`; `motion` (m/s^2) is what two-body motion lacks, in the sigmas."""
        out = np.zeros((len(self), _ROW))
        dt = self.t - epoch
        out[:, 0], out[:, 1], out[:, 2:5], out[:, 5:8] = dt, self.kind, self.observer, self.observer_velocity
        seen = self.kind == DIRECTION
        out[:, 8:11] = self.value
        first, second = _across(self.value[seen], None if self.across is None else self.across[seen])
        out[seen, 8:17] = np.hstack([first, second, self.value[seen]])
        away = 0.5 * motion * dt**2  # m
        lacking = np.where(self.kind == RATE, motion * np.abs(dt), away)
        if seen.any():
            lacking[seen] = away[seen] / np.maximum(np.linalg.norm(self.observer[seen], axis=1), 1.0)
        out[:, 17:19] = np.hypot(self.sigma, lacking[:, None])
        if self.shared is not None:
            out[:, 19] = self.shared
        return out


@dataclass(frozen=True, eq=False)
class Fits:
    """Fits from K starts, the best first.

    Attributes
    ----------
    state : (K, 6), position and velocity at the epoch
    offset : (K,), the constant of the rates
    square : (K,), sum of squares of all residuals in units of their sigmas
    root : (K, 7, 7), upper triangles U with information U^T U of states and constant
    """

    state: Array
    offset: Array
    square: Array
    root: Array


@dataclass(frozen=True)
class Setting:
    """What all fits of one set of rows share.

    Attributes
    ----------
    mu : m^3/s^2
    epoch : s, time of the states
    light : m/s, speed of light
    offset_sigma : m/s, of the constant that rates share; 0: there is none
    motion : m/s^2, what two-body motion lacks
    steps : most steps of a fit
    """

    mu: float
    epoch: float
    light: float = 299792458.0
    offset_sigma: float = 0.0
    motion: float = 0.0
    steps: int = 30

    def numbers(self) -> Array:
        return np.array([self.mu, 1.0 / self.light, self.offset_sigma, float(self.steps), 1e-7])


def squares(rows: Rows, starts: Any, setting: Setting) -> Array:
    """Sums of squares (K,) of starts (K, 6 or 7); infinite where there is no number."""
    starts = _unknowns(starts)
    out = np.empty(len(starts))
    data = rows.at(setting.epoch, setting.motion)
    fit_library().two_body_costs(starts, data, setting.numbers(), np.zeros(160), out, len(starts), len(data))
    return np.where(np.isfinite(out), out, np.inf)


def fitted(rows: Rows, starts: Any, setting: Setting) -> Fits:
    """Fits from starts (K, 6 or 7) by Levenberg's and Marquardt's method, those without an end left out."""
    starts = _unknowns(starts)
    out, data = np.empty((len(starts), 65)), rows.at(setting.epoch, setting.motion)
    fit_library().two_body_fits(starts, data, setting.numbers(), np.zeros(160), out, len(starts), len(data))
    out = out[np.isfinite(out).all(axis=1)]
    out = out[np.argsort(out[:, 7], kind="stable")]
    return Fits(out[:, :6], out[:, 6], out[:, 7], out[:, 9:].reshape(-1, 7, 8)[:, :, :7])


def _unknowns(starts: Any) -> Array:
    starts = np.atleast_2d(np.asarray(starts, dtype=float))
    return np.ascontiguousarray(starts if starts.shape[1] == 7 else np.hstack([starts, np.zeros((len(starts), 1))]))


def _across(direction: Array, across: Array | None) -> tuple[Array, Array]:
    """Two unit vectors across each direction, the first as given."""
    if across is None:
        least = np.eye(3)[np.argmin(np.abs(direction), axis=1)] if len(direction) else np.zeros((0, 3))
        across = np.cross(direction, least)
    across = across - np.sum(across * direction, axis=1, keepdims=True) * direction
    across = across / np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(direction, across)
