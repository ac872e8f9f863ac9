"""Held-out test: rows that the orbit was not fitted to are predicted by the others, and compared with what was measured.

Without process noise an orbit without some rows is a step of Gauss and Newton from the one with all of them, taken again from
where it ends as long as that is another place.  With process noise the estimator begins at the whole solution.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.analysis import Analysis, analysed, of_orbit
from piazzi.determination.fit import estimate
from piazzi.determination.passes import labels_of, passes
from piazzi.determination.setup import Setup, scale_of
from piazzi.determination.sweep import swept
from piazzi.estimate.chi_square import quantile
from piazzi.estimate.estimator import Estimate, Estimator
from piazzi.evaluate.information import singular
from piazzi.evaluate.quantities import finite
from piazzi.problem.checks import Array
from piazzi.problem.inputs import wrapped
from piazzi.text import brief

NONE = "none"
MANY = 60  # passes, beyond which not each is left out unasked
SHARE = 0.25  # of the rows, the last ones, where passes are fewer or more
NEAR, ROUNDS = 0.1, 4  # sigma of a last step from solution to solution, and how many
WITHIN = 0.95  # of a row's own prediction: what coverage counts
GOOD = 2.0  # of the squares per degree of freedom, above which predictions are worse than their sigmas say


@dataclass(frozen=True, eq=False)
class Unseen:
    """One group of rows that was predicted without itself.

    Attributes
    ----------
    station, first, last : whose rows, and when (s past the epoch of the problem)
    rows : (R,), of the tracking
    residual : (R, m), measured less predicted, SI
    squares, freedom : of the prediction error in units of its covariance, rows of a pass together; and how many values
    inside : (R, m), whether a value lies within its own 95 %, NaN where there is none
    """

    station: str
    first: float
    last: float
    rows: Array
    residual: Array
    squares: float
    freedom: int
    inside: Array


@dataclass(frozen=True, eq=False)
class Held:
    """What became of all groups; `skipped` are those without which there is no orbit."""

    how: str
    groups: tuple[Unseen, ...]
    skipped: int

    __repr__ = brief

    @property
    def nees(self) -> float:
        """Normalised squared error of the predictions per degree of freedom: near 1 where the covariance is honest."""
        return sum(one.squares for one in self.groups) / max(self.freedom, 1)

    @property
    def freedom(self) -> int:
        """How many values were predicted."""
        return sum(one.freedom for one in self.groups)

    @property
    def coverage(self) -> float:
        """The share of values within their own 95 %."""
        inside = [one.inside.reshape(-1) for one in self.groups]
        return float(np.nanmean(np.concatenate(inside))) if inside else np.nan

    @property
    def honest(self) -> bool:
        """Whether predictions are as good as their covariances say, within a factor of two of the squares, or chance."""
        return self.nees <= max(GOOD, quantile(0.999, self.freedom) / self.freedom)


def check(how: Any) -> str | float:
    """A word, last, passes or none, or the share that a text such as 1/4 says; raises ValueError for anything else."""
    text = str(how).strip()
    if text in ("last", "passes", NONE):
        return text
    above, slash, below = text.partition("/")
    try:
        share = float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        share = np.nan
    if not 0.0 < share < 1.0:
        raise ValueError(f"{text[:40]!r} is no part of the rows: write last, passes, none, or a share such as 1/4")
    return share


def held(given: Setup, estimator: Estimator, answer: Estimate, analysis: Analysis, keep: Array, how: str | float) -> Held:
    """Predict groups of rows by the others, one group after the other.

    Parameters
    ----------
    given, estimator, answer, analysis, keep : of the determination with all rows
    how : "passes", each in turn; "last"; or a share, the last ones
    """
    groups = _groups(given, keep, how)
    tried: Iterable[Unseen | None]
    if given.problem.is_noise_free:
        tried = _by_steps(given, answer, analysis, keep, groups)
    else:
        tried = (_by_estimator(given, estimator, answer, without(keep, rows), rows) for rows in groups)
    found = tuple(one for one in tried if one is not None)
    return Held(how if isinstance(how, str) else f"{how:.3g}", found, len(groups) - len(found))


def without(keep: Array, rows: Array) -> Array:
    """The rows to keep (J,) but for a group of them."""
    rest = keep.copy()
    rest[rows] = False
    return rest


def unasked(given: Setup, keep: Array) -> str | float | None:
    """How to hold rows back where nobody says it and it costs next to nothing: each pass, or the last rows of one long arc."""
    if not given.problem.is_noise_free:
        return None
    return "passes" if 3 <= len(passes(given, keep)) <= MANY else SHARE


def _groups(given: Setup, keep: Array, how: str | float) -> Sequence[Array]:
    if how == "passes":
        return passes(given, keep)
    if how == "last":
        return passes(given, keep)[-1:]
    used = np.flatnonzero(keep & np.isfinite(given.tracking.values).any(axis=1))
    return [used[len(used) - max(round(float(how) * len(used)), 1) :]]


def _by_steps(given: Setup, answer: Estimate, analysis: Analysis, keep: Array, groups: Sequence[Array]) -> list[Unseen | None]:
    """From the whole solution by steps of Gauss and Newton, for each group; None where the rest determines nothing.

    What a step leaves grows with its square.  So the group goes first whose step is the longest, in sigma of the whole
    solution, and from one on that leaves next to nothing there the others are taken by their steps as they are.  Their own
    sigma is larger still.
    """
    unit = scale_of(given, answer.mean[0])
    whole = analysis.information(keep, unit)
    firsts: dict[int, _Step] = {}
    for i, rows in enumerate(groups):
        if (step := _stepped(analysis, without(keep, rows), unit)) is not None:
            firsts[i] = step
    found: list[Unseen | None] = [None] * len(groups)
    straight = False
    for i in sorted(firsts, key=lambda i: -float(np.linalg.norm(whole @ firsts[i].step))):
        rows, step, first = groups[i], firsts[i], answer.mean[0].copy()
        for left in reversed(range(ROUNDS)):
            if straight or step.length <= NEAR or not left:
                found[i] = _scored(given, step, rows, unit)
                break
            first = first + unit * step.step
            try:
                states, derivatives = swept(given.problem, given.tracking.times, first, given.chosen.max_step)
            except ValueError:
                break
            here = analysed(given, states, derivatives)
            if not np.isfinite(here.whitened[rows][np.isfinite(given.tracking.values[rows])]).all():
                break
            again = _stepped(here, without(keep, rows), unit)
            if again is None:
                break
            step, straight = again, left == ROUNDS - 1 and float(np.linalg.norm(whole @ again.step)) <= NEAR
    return found


@dataclass(frozen=True, eq=False)
class _Step:
    """What a solution leaves, and the step from there to that of the other rows: in units of the state, its length in sigma."""

    here: Analysis
    root: Array
    step: Array
    length: float


def _stepped(here: Analysis, rest: Array, unit: Array) -> _Step | None:
    """None where the rest determines nothing."""
    root = here.information(rest, unit)
    return _Step(here, root, *here.toward(rest, root, unit)) if singular(of_orbit(root))[0][-1] > 1.0 else None


def _scored(given: Setup, at: _Step, rows: Array, unit: Array) -> Unseen:
    """The rows as they are predicted after the step."""
    here, root, step = at.here, at.root, at.step
    own = np.nan_to_num(here.rows[rows]) * unit
    off = here.whitened[rows] - own @ step
    H = np.linalg.solve(root.T, own.reshape(-1, len(unit)).T).T
    there = np.isfinite(off).reshape(-1)
    H, flat = H[there], off.reshape(-1)[there]
    # of S = I + H H^T of all rows: nu^T S^-1 nu by the factor of I + H^T H, which has but the size of the state
    shared = np.asarray(np.linalg.qr(np.vstack([np.eye(len(unit)), H]), mode="r"))
    squares = float(flat @ flat - np.sum(np.linalg.solve(shared.T, H.T @ flat) ** 2))
    inside = np.full(off.size, np.nan)
    inside[there] = flat**2 <= quantile(WITHIN, 1) * (1.0 + np.sum(H**2, axis=1))
    sigma = _sigma(given, rows)
    return _told(given, rows, off * sigma, squares, int(there.sum()), inside.reshape(off.shape))


def _by_estimator(given: Setup, estimator: Estimator, answer: Estimate, rest: Array, rows: Array) -> Unseen | None:
    """By the estimator without these rows; each row is scored by itself, because a run gives no covariance between them."""
    delayed = answer.view == "delayed"
    found = estimate(replace(given, states=answer.mean) if delayed else given, estimator, rest)
    if not found.success:
        return None
    problem, tracking = given.problem, given.tracking
    which, k = tracking.stations_of(problem)[rows], np.searchsorted(tracking.times, tracking.row_times[rows])
    off, inside, squares = np.full((len(rows), tracking.values.shape[1]), np.nan), None, 0.0
    inside = off.copy()
    for s in distinct(which):
        own = np.flatnonzero(which == s)
        x, P, t = found.mean[k[own]], found.covariance[k[own]], tracking.row_times[rows[own]]
        name, m = problem.stations[s].name, len(problem.stations[s].noise)
        z, h = tracking.values[rows[own]][:, :m], problem.measure(name, x, t)
        apart = np.full((len(own), off.shape[1]), np.nan)
        apart[:, :m] = z - h
        nu, size = wrapped(problem, which[own], apart)[:, :m], on_sky(problem, int(s), h)
        nu, H = nu * size, problem.measurement_jacobian(name, x, t) * size[..., None]
        S = H @ P @ np.swapaxes(H, 1, 2) + problem.station_noise[s][:m, :m]
        off[own, :m] = nu
        inside[own, :m] = np.where(np.isfinite(nu), nu**2 <= quantile(WITHIN, 1) * np.diagonal(S, axis1=1, axis2=2), np.nan)
        for one, spread in zip(nu, S, strict=True):
            there = np.isfinite(one)
            squares += float(one[there] @ np.linalg.solve(spread[np.ix_(there, there)], one[there])) if there.any() else 0.0
    return _told(given, rows, off, squares, int(np.isfinite(off).sum()), inside)


def on_sky(problem: Any, s: int, h: Array) -> Array:
    """Factors (K, m) of components: the cosine of the partner of an angle that is measured on the sky."""
    sensor = problem.model.sensor(problem.stations[s].sensor)
    out = np.ones_like(h)
    for angle, partner in dict(sensor.on_sky or ()).items():
        out[:, sensor.components.index(angle)] = np.cos(h[:, sensor.components.index(partner)])
    return out


def _sigma(given: Setup, rows: Array) -> Array:
    which = given.tracking.stations_of(given.problem)[rows]
    return np.asarray(np.sqrt(np.diagonal(given.problem.station_noise, axis1=1, axis2=2))[which])


def _told(given: Setup, rows: Array, residual: Array, squares: float, freedom: int, inside: Array) -> Unseen:
    names = list(dict.fromkeys(labels_of(given)[rows].tolist()))
    t = given.tracking.row_times[rows]
    return Unseen(", ".join(map(str, names)), float(t[0]), float(t[-1]), rows, residual, squares, freedom, inside)


def rms(given: Setup, held: Held) -> list[dict[str, Any]]:
    """Root mean square of the unseen residuals, an entry for each component of the sensors."""
    found: dict[tuple[str, str], list[float]] = {}
    which = given.tracking.stations_of(given.problem)
    for group in held.groups:
        for row, values in zip(group.rows.tolist(), group.residual.tolist(), strict=True):
            sensor = given.problem.model.sensor(given.problem.stations[which[row]].sensor)
            for name, value in zip(sensor.components, values, strict=False):
                found.setdefault((name, dict(sensor.units).get(name, "rad")), []).append(value)
    return [
        {"component": name, "unit": unit, "rms": finite(float(np.sqrt(np.nanmean(np.square(values)))))}
        for (name, unit), values in found.items()
    ]


def to_dict(given: Setup, held: Held, scale: str) -> dict[str, Any]:
    """As the JSON of a determination has it."""
    zero = given.measured.epoch
    return {
        "how": held.how, "values": held.freedom, "nees_per_dof": finite(held.nees), "coverage_95": finite(held.coverage),
        "skipped": held.skipped, "rms": rms(given, held),
        "passes": [
            {
                "station": one.station, "first": (zero + one.first).to(scale), "last": (zero + one.last).to(scale),
                "values": one.freedom, "nees_per_dof": finite(one.squares / max(one.freedom, 1)),
            }
            for one in held.groups
        ],
    }  # fmt: skip
