"""An orbit at many instants, with its covariance, fixed to the Earth and along its own axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.determination.beliefs import beliefs
from piazzi.earth import body, rotation
from piazzi.orbit import state_axes
from piazzi.problem.checks import Array

EACH = 96  # samples of a revolution, where that is not too many
MOST = 2000
LEAST = 240


@dataclass(frozen=True, eq=False)
class Sampled:
    """An orbit at T instants.

    Attributes
    ----------
    times : (T,), s past the epoch of the problem
    mean : (T, 6), GCRF
    covariance : (T, 6, 6), NaN beyond the measurements
    place : (T, 3), fixed to the Earth, m
    spread : (T, 6), covariance of the place, its upper triangle row by row
    turned : (T,), angle of the Earth, rad
    sun : (T, 3), direction of the Sun, fixed to the Earth
    period : of a revolution, s; that of the whole where it does not come back
    about : what it goes about; about the Sun places are those of the mean, and nothing turns
    """

    times: Array
    mean: Array
    covariance: Array
    place: Array
    spread: Array
    turned: Array
    sun: Array
    period: float
    about: str = "earth"

    @property
    def measured(self) -> Array:
        """Which samples lie between the first and the last measurement."""
        return np.asarray(np.isfinite(self.covariance).all(axis=(1, 2)))

    @property
    def sigmas(self) -> Array:
        """Standard deviations (T, 6) of position and velocity along R, T and N."""
        known = self.measured
        out = np.full((len(self.times), 6), np.nan)
        axes = state_axes(self.mean[known, :3], self.mean[known, 3:])
        turned = axes @ self.covariance[known] @ np.swapaxes(axes, 1, 2)
        out[known] = np.sqrt(np.maximum(np.diagonal(turned, axis1=1, axis2=2), 0.0))
        return out


def sampled(found: Any) -> Sampled | None:
    """The orbit of a determination over its measurements, and over a revolution at least; None where it leads nowhere.

    Of an arc with more revolutions than can be drawn it is the last ones.
    """
    estimate = found.estimate
    if not (np.isfinite(estimate.mean).all() and np.isfinite(estimate.covariance).all()):
        return None
    first, last = float(estimate.times[0]), float(estimate.times[-1])
    centre = found.setup.measured.centre
    if centre.name != "earth":
        return _about_sun(found, first, last)
    period = _period(estimate.mean[found.setup.solution, :6], last - first, centre.mu)
    for end in (max(last, first + period), last):
        start = max(first, end - period * MOST / EACH)
        times = np.linspace(start, end, int(np.clip((end - start) / period * EACH, LEAST, MOST)))
        try:
            return _at(found, times, last, period)
        except ValueError:  # it meets the Earth, or tables end
            continue
    return None


def _at(found: Any, times: Array, last: float, period: float) -> Sampled:
    epochs = [found.setup.measured.epoch + float(t) for t in times]
    mean, P = beliefs(found.setup, found.estimate, epochs)
    place, turned, R = fixed(mean[:, :3], epochs)
    P = np.where((times > last + 1e-6)[:, None, None], np.nan, P)
    spread = (R @ P[:, :3, :3] @ np.swapaxes(R, 1, 2))[:, *np.triu_indices(3)]
    sun = np.einsum("tij,tj->ti", R, body("sun", epochs)[0])
    return Sampled(times, mean, P, place, spread, turned, sun / np.linalg.norm(sun, axis=1)[:, None], period)


def fixed(position: Array, epochs: Any) -> tuple[Array, Array, Array]:
    """Positions (T, 3) of the GCRF on axes fixed to the Earth, the angle (T,) by which these have turned, and the matrices."""
    R = rotation("GCRF", "ITRF", epochs)
    angle = np.arctan2(R[:, 0, 1] - R[:, 1, 0], R[:, 0, 0] + R[:, 1, 1])
    return np.einsum("tij,tj->ti", R, position), angle, R


def _about_sun(found: Any, first: float, last: float) -> Sampled | None:
    """Over the measurements and as long again, which is the prediction."""
    for end in (2.0 * last - first, last):
        times = np.linspace(first, end, LEAST)
        try:
            mean, P = beliefs(found.setup, found.estimate, [found.setup.measured.epoch + float(t) for t in times])
        except ValueError:  # tables end
            continue
        still = np.zeros(LEAST)
        return Sampled(times, mean, P, mean[:, :3], np.full((LEAST, 6), np.nan), still, mean[:, :3], last - first, "sun")
    return None


def _period(state: Array, otherwise: float, mu: float) -> float:
    """Of the ellipse that it is on."""
    energy = 0.5 * float(state[3:] @ state[3:]) - mu / float(np.linalg.norm(state[:3]))
    return float(2.0 * np.pi * np.sqrt((-0.5 * mu / energy) ** 3 / mu)) if energy < 0 else max(otherwise, 1.0)
