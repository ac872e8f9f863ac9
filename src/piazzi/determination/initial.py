"""Initial orbits: every orbit that the first stretch of a tracking allows, refined by the full model and weighed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.approach import part
from piazzi.determination.beliefs import carried_to
from piazzi.determination.centres import Centre, centre_of
from piazzi.determination.extending import LONGER, MOST, observer, refined, weighed
from piazzi.determination.initial_result import InitialOrbits, OrbitMode, Parting, UndeterminedError
from piazzi.determination.orbit_forces import STEPS
from piazzi.determination.ridge import OPEN, counted, openness, ridge
from piazzi.determination.sights import observers, rows_of
from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import Rows
from piazzi.orbit.modes import Search, two_body_modes
from piazzi.orbit.region import Region
from piazzi.problem import Problem, Tracking
from piazzi.problem.checks import Array

ENOUGH = 5  # rows of a stretch
THROUGH = "no orbit for a whole turn"
WIDEST = 16.0  # stretches, within which two-body motion still says what to begin with


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
    rows, index = rows_of(problem, _around(tracking, centre.stretch))
    first, search = _looked(rows, centre.stretch, region)
    if not search.modes and len(distinct(rows.t)) > 2:
        raise ValueError(f"no orbit fits the {len(distinct(index[first]))} rows of the first stretch ({search.starts} starts)")
    wide, known = openness(search.best[0]) if search.best else (np.inf, counted(rows.of(first)))
    ends = float(rows.t[first].min()), float(rows.t[first].max())
    found, keep, beyond = refined(problem, tracking, rows.of(first), search, ends, centre)
    if wide > OPEN and ((tracking.row_times[keep] <= ends[1]) & (tracking.row_times[keep] >= ends[0])).all():
        what = ridge(rows.of(first), region, problem.epoch, known)
        return InitialOrbits((), search.starts, search.fits, None, centre.name, what, beyond)
    modes = weighed(found, observer(problem, tracking, keep))
    modes = modes or tuple(_unrefined(problem, search, len(distinct(index[first]))))
    modes = tuple(replace(mode, why_not=_why_not(mode.mean, region, centre)) for mode in modes)
    apart = _apart(problem, tracking, modes, centre) if len(modes) > 1 else None
    return InitialOrbits(modes, search.starts, search.fits, apart, centre.name, None, beyond)


def orbit_paths(problem: Problem, tracking: Tracking) -> list[Array]:
    """States (K, n) at all times of a tracking, of every orbit that fits, the most probable first.

    Raises
    ------
    UndeterminedError
        Where the measurements leave a ridge.
    ValueError
        As `initial_orbits` does.
    """
    found = initial_orbits(problem, tracking)
    if not found.modes:
        raise UndeterminedError(found)
    return [_path(problem, mode, tracking.times, centre_of(found.about)) for mode in found.modes]


def _path(problem: Problem, mode: OrbitMode, t: Array, centre: Centre) -> Array:
    """States (K, n) of an orbit at times, by the forces of the problem."""
    x, begin = np.concatenate([mode.mean, problem.mean[6:]]), mode.epoch - problem.epoch
    out, nothing = np.tile(x, (len(t), 1)), np.zeros((len(x), len(x)))
    for side in (t > begin, t < begin):
        if side.any():
            step = centre.longest_step(mode.mean[:3], mode.mean[3:], STEPS)
            out[side] = carried_to(problem, step, begin, x, nothing, t[side])[0]
    return out


def _around(tracking: Tracking, length: float) -> Tracking:
    """The rows of the first stretch, and those that are near it."""
    times = tracking.row_times
    own = times[first_stretch(times, length, WIDEST * length)]
    return part(tracking, (times >= own.min() - WIDEST * length) & (times <= own.max() + WIDEST * length))


def _looked(rows: Rows, length: float, region: Region) -> tuple[Array, Search]:
    """The stretch whose rows are looked at first, and what fits them: longer while they leave a ridge and others are near."""
    longest = WIDEST * length
    first = first_stretch(rows.t, length, longest)
    search = two_body_modes(rows.of(first), region)
    while len(first) < len(rows) and length < longest:
        if search.best and openness(search.best[0])[0] <= OPEN:
            break
        length *= LONGER
        more = first_stretch(rows.t, length, longest)
        if len(more) > len(first):
            first, search = more, two_body_modes(rows.of(more), region)
    return first, search


def _centre(problem: Problem) -> Centre:
    return centre_of(next((p.about for s in problem.stations if (p := s.place) is not None and hasattr(p, "about")), "earth"))


def first_stretch(times: Array, length: float, longest: float = np.inf) -> Array:
    """Indices of the stretch of so many seconds that holds most times, the earliest of equals; longer where too few."""
    order = np.argsort(times, kind="stable")
    t = times[order]
    while True:
        last = np.searchsorted(t, t + length, side="right")
        held = last - np.arange(len(t))
        k = int(np.argmax(held))
        if held[k] >= min(ENOUGH, len(t)) or length > min(t[-1] - t[0], longest / 1.5):
            return order[k : last[k]]
        length *= LONGER


def _why_not(state: Array, region: Region, centre: Centre) -> str:
    """Why a state (6,) is on no admissible orbit; empty for one that is."""
    if region.holds(state[None])[0]:
        return ""
    r, h = float(np.linalg.norm(state[:3])), np.cross(state[:3], state[3:])
    inverse = 2.0 / r - float(state[3:] @ state[3:]) / region.mu  # of the semi-major axis
    p = float(h @ h) / region.mu
    nearest = p / (1.0 + np.sqrt(max(1.0 - p * inverse, 0.0)))
    if nearest <= region.lowest:
        through = "through the Earth" if centre.name == "earth" else "into the Sun"
        return f"{THROUGH}: it goes {through}, down to {nearest / 1e3:,.0f} km from the centre"
    return "it is not bound" if inverse <= 0.0 else f"it goes farther than {region.highest / 1e3:,.0f} km from the centre"


def _unrefined(problem: Problem, search: Search, rows: int) -> Iterator[OrbitMode]:
    """Two-body modes as they are, where the full model ended from none."""
    epoch = problem.epoch + search.epoch
    for mode in search.best[:MOST]:
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
        if not hasattr(station.place, "at"):  # none, or one in orbit, which is not known so far ahead
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
