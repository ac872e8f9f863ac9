"""From a guess to near the answer: damped least squares in elements at the date of the guess, over a span that grows.

An orbit that is a little wrong at its date is very wrong days later.  Corrected at the date of the guess, and in elements, it
bends less than anywhere else; and measurements that are near that date say in which turn the others are.  Nobody looks at the
others before.

What is found only says where estimators begin: their prior is about it, and much wider than what the measurements leave.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, pi

import numpy as np

from piazzi.arrays import median
from piazzi.determination.analysis import Analysis, analysed
from piazzi.determination.setup import Setup, follow, scale_of, with_prior
from piazzi.determination.sweep import swept
from piazzi.evaluate.information import factor
from piazzi.orbit import ModifiedEquinoctial
from piazzi.problem import Tracking
from piazzi.problem.checks import Array

ENOUGH = 9  # values that a span begins with
SHORT, LONG = 8, 40  # steps over a span that still grows, and over all
STILL = 1e-3  # of the cost, by which a step must lower it to be followed by another
LARGEST = 1e10  # of the damping
LEAST = 1e-8
WIDER = 100.0  # times the sigma that measurements leave is that of the prior: a share of 1e-4 of what they know
ROUGHLY = 2.0  # times the steps of the answer are those of trials: millimetres in a day
SPREAD = 2.5  # times the median residual, from which on a row counts less and less


@dataclass(frozen=True, eq=False)
class Place:
    """A trial: the state and constants at the date of the guess, and all that follows from it.

    `rows` are the derivatives of the whitened residuals by elements and constants; those of `analysis`, by the first state.
    """

    first: Array
    states: Array
    analysis: Analysis
    rows: Array

    @property
    def whitened(self) -> Array:
        """Residuals (J, m) in units of the noise."""
        return self.analysis.whitened


def approached(given: Setup) -> Setup:
    """The set-up with states, and a prior mean, that are near the answer; itself where nothing nearer was found.

    An orbit that was known before stays: it is the prior.
    """
    if given.before is not None:
        return given
    begun, before = _start(given)
    unit, first = scale_of(given, before), before
    away = np.abs(given.tracking.row_times - begun)
    there = np.isfinite(given.tracking.values)
    half = pi / given.measured.centre.turning(first[:3], first[3:6])
    while True:
        rows = away <= half
        whole = bool(rows.all())
        if there[rows].sum() >= ENOUGH or whole:
            near = given if whole else replace(given, tracking=part(given.tracking, rows), rows=given.rows[rows])
            here = _place(near, begun, first) or _place(near, begun, before)  # what fits few rows may not go through more
            if here is None:
                return given
            here = _fitted(near, begun, here, unit, before, LONG if whole else SHORT)
            if whole:
                return with_prior(given, here.states, _wide(given, here))
            first = here.first
        half *= 2.0


def part(tracking: Tracking, keep: Array) -> Tracking:
    """The rows to keep (J,) alone."""
    who = tracking.row_stations
    return Tracking(tracking.row_times[keep], tracking.values[keep], None if who is None else who[keep], epoch=tracking.epoch)


def refined(given: Setup) -> Setup:
    """The same of a set-up that is near but for unknowns that it has got since: over all measurements at once."""
    if given.before is not None:
        return given
    begun, first = _start(given)
    here = _place(given, begun, first)
    if here is None:
        return given
    before = np.concatenate([first[:6], given.problem.mean[6:]])
    here = _fitted(given, begun, here, scale_of(given, first), before, LONG)
    return with_prior(given, here.states, _wide(given, here))


def _start(given: Setup) -> tuple[float, Array]:
    """When to begin, and with which state."""
    times = given.tracking.times
    begun = float(np.clip(given.guess.epoch - given.measured.epoch, times[0], times[-1]))
    return begun, _state_at(given, begun)


def _wide(given: Setup, here: Place) -> Array:
    """Covariance (s, s) of a prior of states, `WIDER` than what the measurements leave, and nowhere wider than a guess.

    What they leave is that beside constants as uncertain as they are: with states last, a triangular root of the information
    of everything ends in that of the states alone.
    """
    unit = scale_of(given, here.states[0])
    keep = np.ones(len(given.rows), dtype=np.bool_)
    s = len(given.problem.model.states)
    everything = here.analysis.information(keep, unit)
    alone = factor(np.roll(everything, -s, axis=1))[-s:, -s:]
    root = factor(np.vstack([alone / WIDER, np.eye(s)]))
    inverse = np.linalg.solve(root, np.eye(s))
    return np.asarray(inverse @ inverse.T * np.outer(unit[:s], unit[:s]))


def _state_at(given: Setup, t: float) -> Array:
    """States and constants of the guess at a time within the measurements."""
    k = int(np.clip(np.searchsorted(given.tracking.times, t, side="right") - 1, 0, len(given.states) - 1))
    start = float(given.tracking.times[k])
    if t == start:
        return np.array(given.states[k])
    return np.asarray(follow(given.problem, np.array([start, t]), given.states[k], given.chosen.max_step)[0][-1])


def _place(given: Setup, begun: float, first: Array) -> Place | None:
    """All that follows from a state; None where the orbit ends, or measurements have no prediction."""
    times, step = given.tracking.times, ROUGHLY * given.chosen.max_step
    try:
        gap = abs(begun - float(times[0]))
        nodes = np.linspace(begun, float(times[0]), max(ceil(gap / step), 1) + 1) if gap > 0 else np.array([begun])
        back, Phi = follow(given.problem, nodes, first, step)
        states, derivatives = swept(given.problem, times, back[-1], step)
        found = analysed(given, states, derivatives)
        change = _change(first, given.measured.centre.mu)
    except ValueError:
        return None
    for one in Phi:
        change = one @ change
    there = np.isfinite(given.tracking.values)
    if not (np.isfinite(found.whitened[there]).all() and np.isfinite(found.rows[there]).all()):
        return None
    return Place(first, states, found, found.rows @ change)


def _moved(first: Array, step: Array, mu: float) -> Array:
    """The state after a step in elements and constants; raises ValueError where that is no orbit."""
    kind = ModifiedEquinoctial()
    elements = kind.from_state(first[:3], first[3:6], mu) + step[:6]
    r, v = kind.to_state(elements, mu)
    return np.concatenate([r, v, first[6:] + step[6:]])


def _fitted(given: Setup, begun: float, here: Place, unit: Array, before: Array, steps: int) -> Place:
    """The nearest minimum, by Levenberg and Marquardt's steps, with a loss that outliers do not rule."""
    damping = 1e-6
    for _ in range(steps):
        scale = _scale(here.whitened)
        cost = _cost(here, scale, unit, before)
        better = None
        while better is None and damping < LARGEST:
            trial = _tried(given, begun, here, unit, before, scale, damping)
            new = np.inf if trial is None else _cost(trial, scale, unit, before)
            if trial is not None and new < cost:
                better = trial
                damping = max(damping / 30.0, LEAST)
            else:
                damping *= 30.0
        if better is None:
            return here
        here = better
        if cost - new < STILL * cost:
            return here
    return here


def _tried(given: Setup, begun: float, here: Place, unit: Array, before: Array, scale: float, damping: float) -> Place | None:
    w, J = here.whitened.reshape(-1), here.rows.reshape(-1, len(unit))
    there = np.isfinite(w)
    weight = 1.0 / np.sqrt(1.0 + (w[there] / scale) ** 2)
    mu = given.measured.centre.mu
    T = _change(here.first, mu)
    own = T / unit[:, None]  # of the prior, by elements and constants
    A = np.vstack([weight[:, None] * J[there], own])
    b = np.concatenate([weight * w[there], (before - here.first) / unit])
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    A = np.vstack([A / size, np.sqrt(damping) * np.eye(len(unit))])
    step = np.linalg.lstsq(A, np.append(b, np.zeros(len(unit))), rcond=None)[0] / size
    try:
        return _place(given, begun, _moved(here.first, step, mu))
    except ValueError:
        return None


def _change(first: Array, mu: float) -> Array:
    """Derivative (n, n) of a state and constants by elements and constants."""
    kind = ModifiedEquinoctial()
    out = np.eye(len(first))
    out[:6, :6] = kind.jacobian_to_state(kind.from_state(first[:3], first[3:6], mu), mu)
    return out


def _scale(whitened: Array) -> float:
    known = np.abs(whitened[np.isfinite(whitened)])
    return SPREAD * max(1.0, 1.4826 * median(known)) if known.size else SPREAD


def _cost(place: Place, scale: float, unit: Array, before: Array) -> float:
    """Cauchy's, and that of the prior."""
    w = place.whitened[np.isfinite(place.whitened)]
    return float(scale**2 * np.log1p((w / scale) ** 2).sum() + (((place.first - before) / unit) ** 2).sum())
