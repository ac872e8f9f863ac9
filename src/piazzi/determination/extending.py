"""Two-body orbits refined by the problem itself, over stretches of a tracking that grow as far as an orbit can be followed.

Rows that are far from a stretch tell something only where it is known how often the body has gone round in between; an orbit
reaches as far as the sigma of its mean motion leaves no doubt of that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from piazzi.determination.approach import part
from piazzi.determination.beliefs import carried_to
from piazzi.determination.centres import Centre
from piazzi.determination.initial_result import Beyond, OrbitMode
from piazzi.determination.orbit_forces import STEPS
from piazzi.determination.sights import observers
from piazzi.earth import Epoch
from piazzi.estimate.batch import BatchLeastSquares, undisturbed
from piazzi.estimate.estimator import Estimate
from piazzi.evaluate.information import along
from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import DIRECTION, POSITION, Rows
from piazzi.orbit.modes import SAME, Mode, Search, density, oblate_modes
from piazzi.problem import Gaussian, Problem, Tracking
from piazzi.problem.checks import Array
from piazzi.problem.inputs import prepare

LONGER = 4.0  # how much longer each next stretch is
WIDE = 0.3  # of distance and speed: the sigma of where a fit begins
NEAR = 0.05  # sigma, to which fits are taken: over weeks rounding moves them by hundredths
LEAST = 1e-6  # probability of an orbit that is told
MOST = 6  # two-body orbits that are refined, of those that are probable
FEW = 3  # of those that heed the flattening: where one is right, others fit far worse
FITS = 3.0  # sigma that residuals of an orbit that fits have at most, root mean square
KNOWN = np.pi / 3  # rad, sigma of the way round: three of them are half a turn, from which on turns cannot be counted


@dataclass(frozen=True, eq=False)
class Refined:
    """A fit of the problem to some rows: the estimate, six of its states at the first row, and what it leaves."""

    estimate: Estimate
    state: Array
    covariance: Array
    square: float
    count: int
    epoch: Epoch

    @property
    def fits(self) -> bool:
        """Whether the residuals are not many sigma."""
        return self.square <= FITS**2 * max(self.count - 6, 1)


def refined(
    problem: Problem, tracking: Tracking, rows: Rows, search: Search, ends: tuple[float, float], centre: Centre
) -> tuple[list[Refined], Array, Beyond | None]:
    """Fits of the problem from what two-body motion found, over the stretch between `ends` and then over longer ones.

    Where nothing says where the body is and no fit from the modes fits, two-body motion led astray: distances of one pass, to a
    centimetre, are fitted by a wrong orbit whose errors make up for what that motion lacks.  Then the flattening is heeded.

    Returns
    -------
    found : the different ones, the best first; none where none ends
    keep : (J,), rows of the tracking that they are fitted to
    beyond : what is said of the others; None where there are none
    """
    times = tracking.row_times
    low, high = ends
    keep = (times >= low) & (times <= high)

    def fits(modes: Iterable[Mode]) -> Iterator[Refined]:
        begun = (propagate_kepler(m.state[:3], m.state[3:], centre.mu, float(times[keep].min()) - search.epoch) for m in modes)
        return _fits(problem, tracking, keep, (np.concatenate([r, v, problem.mean[6:]]) for r, v in begun))

    tried = [*fits(search.best[:MOST])]
    if not (any(one.fits for one in tried) or np.isin(rows.kind, (DIRECTION, POSITION)).any()):
        closer = oblate_modes(rows, search, centre.region)
        for one in fits((*closer.modes, *closer.others)[:FEW]):
            tried.append(one)
            if one.fits:
                break
    found = _different(tried, observer(problem, tracking, keep))
    beyond = None
    while found and not keep.all():
        reach = KNOWN / drift(found[0], centre.mu)
        more = _longer(times, low, high, reach)
        if more is None:
            beyond = _beyond(problem, times, keep, drift(found[0], centre.mu))
            break
        low, high = more
        wider = (times >= low) & (times <= high)
        moved = _carried(problem, found, float(times[wider].min()), centre)
        again = _different(_fits(problem, tracking, wider, moved), observer(problem, tracking, wider))
        if not again:
            beyond = _beyond(problem, times, keep, 0.0)
            break
        found, keep = again, wider
    return found, keep, beyond


def observer(problem: Problem, tracking: Tracking, keep: Array) -> Array:
    """Where the earliest row to keep was measured from, (3,); the centre where its station has no place."""
    first = int(np.flatnonzero(keep)[np.argmin(tracking.row_times[keep])])
    station = problem.stations[int(tracking.stations_of(problem)[first])]
    if station.place is None:
        return np.zeros(3)
    return np.asarray(observers(problem.epoch, station, tracking.row_times[first : first + 1])[0][0])


def drift(one: Refined, mu: float) -> float:
    """Sigma of the mean motion, rad/s."""
    r, v = one.state[:3], one.state[3:]
    distance = float(np.linalg.norm(r))
    a = 1.0 / (2.0 / distance - float(v @ v) / mu)
    if not a > 0.0:
        return np.inf
    slope = 3.0 / np.sqrt(mu * a) * np.concatenate([mu / distance**3 * r, v])
    return float(np.sqrt(slope @ one.covariance @ slope))


def _longer(times: Array, low: float, high: float, reach: float) -> tuple[float, float] | None:
    """Ends of the next stretch, about four times as long; None where no further row is within reach."""
    gaps = np.where(times > high, times - high, low - times)
    outside = gaps[(times > high) | (times < low)]
    if outside.min() > reach:
        return None
    span = min(max((LONGER - 1) * (high - low), 180.0, float(outside.min())), reach)
    return low - span, high + span


def _beyond(problem: Problem, times: Array, keep: Array, rate: float) -> Beyond:
    """What is said of rows that are not kept, of which turns are known at a rate, rad/s."""
    first, last = float(times[keep].min()), float(times[keep].max())
    away = np.where(times > last, times - last, first - times)
    away = np.where(keep, np.inf, away)
    k = int(np.argmin(away))
    turns = rate * float(away[k]) / (2.0 * np.pi)
    return Beyond(int((~keep).sum()), problem.epoch + float(times[k]), float(away[k]), turns)


def _carried(problem: Problem, found: Sequence[Refined], first: float, centre: Centre) -> list[Array]:
    """States (n,) of fits, followed to another time by the forces of the problem; those that end on the way are left out."""
    out = []
    for one in found:
        x, start = one.estimate.mean[0], float(one.estimate.times[0])
        step = centre.longest_step(one.state[:3], one.state[3:], STEPS)
        if first != start:
            try:
                x = carried_to(problem, step, start, x, np.zeros((len(x), len(x))), np.array([first]))[0][0]
            except ValueError:
                continue
        out.append(x)
    return out


def _fits(problem: Problem, tracking: Tracking, keep: Array, starts: Iterable[Array]) -> Iterator[Refined]:
    """Fits to the rows to keep (J,), from states (n,) at the first of them.

    By batch least squares alone: where it ends from none, the two-body fits that are its starts stand as they are.  The full
    graph of the same rows and forces is many times the work, and six kernels more to compile.
    """
    times = tracking.row_times[keep]
    few = part(tracking, keep)
    for start in starts:
        sigma = WIDE * np.repeat([np.linalg.norm(start[:3]), np.linalg.norm(start[3:6])], 3)
        posed = problem.with_prior(Gaussian(start[:6], np.diag(sigma**2)), float(times.min()))
        solver = BatchLeastSquares(start=start, max_iterations=30, tolerance=NEAR, graph=False)
        try:
            estimate = solver.estimate(posed, few)
        except ValueError:
            continue
        if estimate.success:
            square, count = _square(posed, few, estimate)
            epoch = problem.epoch + float(estimate.times[0])
            yield Refined(estimate, estimate.mean[0, :6], estimate.covariance[0, :6, :6], square, count, epoch)


def _square(problem: Problem, tracking: Tracking, estimate: Estimate) -> tuple[float, int]:
    """Sum of squares of whitened residuals, and how many there are."""
    exact = problem if problem.is_noise_free else undisturbed(problem)
    left = along(exact, prepare(exact, tracking), estimate.mean).innovations
    there = np.isfinite(left)
    return float(np.sum(left[there] ** 2)), int(there.sum())


def _different(found: Iterable[Refined], here: Array) -> list[Refined]:
    """Those that are not the same as a better one, the best first; improbable ones left out."""
    kept: list[Refined] = []
    for one in sorted(found, key=lambda f: f.square):
        if all(_apart_in_sigmas(one, other) > SAME for other in kept):
            kept.append(one)
    return [one for one, share in zip(kept, shares(kept, here), strict=True) if share > LEAST]


def shares(found: Sequence[Refined], here: Array) -> list[float]:
    """Probabilities of fits to the same rows, the best first, of which the earliest was measured from `here`."""
    if not found:
        return []
    scale = max(found[0].square / max(found[0].count - 6, 1), 1.0)  # forces that are left out make all of them worse
    score = np.array([-0.5 * f.square / scale + 0.5 * np.linalg.slogdet(f.covariance)[1] for f in found])
    score += density(np.array([f.state for f in found]), here)
    weight = np.exp(score - score.max())
    return list((weight / weight.sum()).tolist())


def _apart_in_sigmas(one: Refined, other: Refined) -> float:
    root = np.linalg.cholesky(other.covariance + 1e-12 * np.diag(np.diag(other.covariance)))
    return float(np.sum(np.linalg.solve(root, one.state - other.state) ** 2))


def weighed(found: Sequence[Refined], here: Array) -> tuple[OrbitMode, ...]:
    """Fits with their probabilities, the most probable first; `here` is where the earliest row was measured from."""
    ordered = sorted(zip(shares(found, here), found, strict=True), key=lambda pair: -pair[0])
    return tuple(
        OrbitMode(f.epoch, f.state, f.covariance, p, float(np.sqrt(f.square / max(f.count, 1))), f.count) for p, f in ordered
    )
