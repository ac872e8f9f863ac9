"""Initial orbits: every orbit that the first stretch of a tracking allows, refined by the full model and weighed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from piazzi.determination.centres import Centre, centre_of
from piazzi.determination.initial_result import InitialOrbits, OrbitMode, Parting
from piazzi.determination.ridge import OPEN, openness, ridge
from piazzi.determination.sights import observers, rows_of
from piazzi.earth import Epoch
from piazzi.estimate.batch import BatchLeastSquares, undisturbed
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.information import along
from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import Rows
from piazzi.orbit.modes import SAME, Mode, Search, two_body_modes
from piazzi.orbit.starts import Region
from piazzi.problem import Gaussian, Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

LONGER = 4.0  # how much longer each next stretch is
ENOUGH = 5  # rows of a stretch
MOST = 6  # two-body orbits that are refined
WIDE = 0.3  # of distance and speed: the sigma of where a fit begins


def initial_orbits(problem: Problem, tracking: Tracking, region: Region | None = None) -> InitialOrbits:
    """All orbits that fit a tracking, from any mix of sensors, without a guess.

    Every classical method that the rows allow, and a sample of the admissible region, start two-body fits; the best are refined
    by batch least squares of the problem itself over longer and longer stretches of the tracking, merged and weighed.

    Parameters
    ----------
    problem : states x, y, z, vx, vy, vz (m, m/s), with an epoch; its prior is not used.  Orbits go about the Sun where its
        stations are seen from there (``earth.Place(..., about="sun")``).
    tracking : rows of positions, distances, their rates, or directions
    region : which orbits are admissible; default bound ones above the surface, out to a million km or 60 astronomical units

    Where the rows leave a ridge of orbits, there are no modes and `ridge` says what they do determine.

    Raises
    ------
    ValueError
        Where no row says where the body is, or nothing fits.
    """
    if problem.model.states[:6] != ("x", "y", "z", "vx", "vy", "vz") or problem.epoch is None:
        raise ValueError("initial orbits need a problem with states x, y, z, vx, vy, vz and an epoch")
    centre = _centre(problem)
    region = centre.region if region is None else region
    rows, index = rows_of(problem, tracking)
    first = first_stretch(rows, centre.stretch)
    search = two_body_modes(rows.of(first), region)
    if not search.modes and len(np.unique(rows.t)) > 2:
        raise ValueError(f"no orbit fits the {len(np.unique(index[first]))} rows of the first stretch ({search.starts} starts)")
    inside = [m for m in search.modes if m.admissible] or list(search.modes)
    wide, known = openness(inside[0]) if inside else (np.inf, 0)
    if wide > OPEN and len(first) == len(rows):
        found = ridge(rows, region, problem.epoch, known)
        return InitialOrbits((), search.starts, search.fits, None, centre.name, found)
    begin = float(rows.t[first].min())
    refined = [*_refined(problem, tracking, search, inside[:MOST], begin, float(rows.t[first].max()), region)]
    modes = _weighed(refined) or tuple(_unrefined(problem, search, inside[:MOST], len(np.unique(index[first]))))
    apart = _apart(problem, tracking, modes, centre) if len(modes) > 1 else None
    return InitialOrbits(modes, search.starts, search.fits, apart, centre.name)


def _centre(problem: Problem) -> Centre:
    return centre_of(next((p.about for s in problem.stations if (p := s.place) is not None and hasattr(p, "about")), "earth"))


def first_stretch(rows: Rows, length: float) -> Array:
    """Indices of the stretch of so many seconds that holds most rows, the earliest of equals; longer where it holds too few."""
    order = np.argsort(rows.t, kind="stable")
    t = rows.t[order]
    while True:
        last = np.searchsorted(t, t + length, side="right")
        held = last - np.arange(len(t))
        k = int(np.argmax(held))
        if held[k] >= min(ENOUGH, len(t)) or length > t[-1] - t[0]:
            return order[k : last[k]]
        length *= LONGER


@dataclass(frozen=True, eq=False)
class _Refined:
    state: Array
    covariance: Array
    square: float
    count: int
    epoch: Epoch


def _refined(
    problem: Problem, tracking: Tracking, search: Search, modes: list[Mode], begin: float, end: float, region: Region
) -> Iterator[_Refined]:
    """Fits of the problem itself, over the stretch from `begin` to `end` and then over longer ones."""
    times = tracking.row_times
    for mode in modes:
        r, v = propagate_kepler(mode.state[:3], mode.state[3:], region.mu, begin - search.epoch)
        state, low, high, best = np.concatenate([r, v]), begin, end, None
        while True:
            keep = (times >= low) & (times <= high)
            found = _fit(problem, tracking, keep, state)
            if found is None:
                break
            estimate, best = found
            state = estimate.mean[0, :6]
            if keep.all():
                break
            span = (LONGER - 1) * max(high - low, 60.0)
            at, low, high = float(estimate.times[0]), low - span, high + span
            first = float(times[times >= low].min())
            if first < at:
                r, v = propagate_kepler(state[:3], state[3:], region.mu, first - at)
                state = np.concatenate([r, v])
        if best is not None:
            yield best


def _fit(problem: Problem, tracking: Tracking, keep: Array, state: Array) -> tuple[Estimate, _Refined] | None:
    times = tracking.row_times[keep]
    sigma = np.concatenate([np.full(3, WIDE * np.linalg.norm(state[:3])), np.full(3, WIDE * np.linalg.norm(state[3:]))])
    few = Tracking(times, tracking.values[keep], tracking.row_stations[keep], epoch=tracking.epoch)
    start = np.concatenate([state, problem.mean[6:]])
    prior = Gaussian(state, np.diag(sigma**2))
    posed = replace(problem, prior=prior, prior_time=float(times.min()))
    try:
        estimate = BatchLeastSquares(start=start, max_iterations=30, tolerance=1e-3).estimate(posed, few)
    except ValueError:
        return None
    if not estimate.success:
        return None
    square, count = _square(posed, few, estimate)
    epoch = problem.epoch + float(estimate.times[0])
    return estimate, _Refined(estimate.mean[0, :6], estimate.covariance[0, :6, :6], square, count, epoch)


def _square(problem: Problem, tracking: Tracking, estimate: Estimate) -> tuple[float, int]:
    """Sum of squares of whitened residuals, and how many there are."""
    exact = problem if problem.is_noise_free else undisturbed(problem)
    left = along(exact, prepare(exact, tracking), estimate.mean).innovations
    there = np.isfinite(left)
    return float(np.sum(left[there] ** 2)), int(there.sum())


def _weighed(found: list[_Refined]) -> tuple[OrbitMode, ...]:
    """The different ones, with probabilities; only those that were fitted to the most rows count."""
    most = max((f.count for f in found), default=0)
    ordered = sorted((f for f in found if f.count == most), key=lambda f: f.square)
    kept: list[_Refined] = []
    for one in ordered:
        if all(_apart_in_sigmas(one, other) > SAME for other in kept):
            kept.append(one)
    if not kept:
        return ()
    scale = max(kept[0].square / max(most - 6, 1), 1.0)  # forces that are left out make all of them worse
    score = np.array([-0.5 * f.square / scale + 0.5 * np.linalg.slogdet(f.covariance)[1] for f in kept])
    weight = np.exp(score - score.max())
    share = weight / weight.sum()
    return tuple(
        OrbitMode(f.epoch, f.state, f.covariance, float(p), float(np.sqrt(f.square / max(f.count, 1))), f.count)
        for p, f in sorted(zip(share.tolist(), kept, strict=True), key=lambda pair: -pair[0])
        if p > 1e-6
    )


def _apart_in_sigmas(one: _Refined, other: _Refined) -> float:
    root = np.linalg.cholesky(other.covariance + 1e-12 * np.diag(np.diag(other.covariance)))
    return float(np.sum(np.linalg.solve(root, one.state - other.state) ** 2))


def _unrefined(problem: Problem, search: Search, modes: list[Mode], rows: int) -> Iterator[OrbitMode]:
    """Two-body modes as they are, where the full model ended from none."""
    epoch = problem.epoch + search.epoch
    for mode in modes:
        half = np.linalg.lstsq(mode.root[:6, :6], np.eye(6), rcond=None)[0]
        rms = float(np.sqrt(mode.square / max(rows, 1)))
        yield OrbitMode(epoch, mode.state, half @ half.T, mode.probability, rms, rows)


def _apart(problem: Problem, tracking: Tracking, modes: tuple[OrbitMode, ...], centre: Centre) -> Parting | None:
    """Where the first two are farthest apart within six `stretch` after the last row, for a station that sees one."""
    last = float(tracking.row_times.max())
    t = last + centre.stretch * np.linspace(1 / 240, 6.0, 720)
    paths = []
    for mode in modes[:2]:
        begin = mode.epoch - problem.epoch
        paths.append(propagate_kepler(mode.mean[:3], mode.mean[3:], centre.mu, t - begin)[0])
    away = np.linalg.norm(paths[0] - paths[1], axis=1)
    best: Parting | None = None
    for station in problem.stations:
        if station.place is None:
            continue
        place, _ = observers(problem.epoch, station, t)
        lines = [p - place for p in paths]
        far = [np.linalg.norm(line, axis=1) for line in lines]
        above = np.ones(len(t), dtype=bool)
        if centre.name == "earth" and place.any():
            up = place / np.linalg.norm(place, axis=1)[:, None]
            above = np.any([np.sum(line * up, axis=1) > 0.1 * d for line, d in zip(lines, far, strict=True)], axis=0)
        k = int(np.argmax(np.where(above, away, 0.0)))
        if above[k] and (best is None or away[k] > best.distance):
            one, other = (line[k] / d[k] for line, d in zip(lines, far, strict=True))
            angle = float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
            best = Parting(problem.epoch + float(t[k]), station.name, float(away[k]), angle)
    return best
