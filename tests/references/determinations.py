"""Simulated determinations whose truth is drawn from what is assumed before: consistency of every estimated value.

``python -m tests.references.determinations KIND N`` prints the mean NEES over N runs of a kind, leo, geo or gto; of air,
process and other that of predictions, along R, T and N after one, two and three days, with the shares within 50 and 95 %,
below those of each run.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.beliefs import beliefs
from piazzi.determination.determining import _answered, prepared, ready, solved
from piazzi.determination.fit import estimators
from piazzi.determination.motion import Extra, instead
from piazzi.determination.orbit_forces import AirVaries
from piazzi.determination.physical import share_of
from piazzi.determination.setup import at_last_used, follow, renewed
from piazzi.earth.force_text import LATITUDE
from piazzi.earth.tabulated import Place
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.information import predicted
from piazzi.formats import Correction, Observations, Segment
from piazzi.orbit import state_axes
from piazzi.problem.inputs import prepare

EPOCH = pz.Epoch("2024-03-10T00:00:00 UTC")
MU = 3.986004418e14
SITES = {"NORTH": (78.2, 15.4), "WEST": (34.0, -118.0), "SOUTH": (-33.9, 18.4), "EAST": (35.7, 139.5)}
APPLIED = (Correction("troposphere", applied=True),)


@dataclass(frozen=True)
class Kind:
    """An orbit with its tracking, and the words that it is determined with."""

    state: np.ndarray
    sites: tuple[str, ...]
    hours: float
    every: float  # s
    sigma: float  # of ranges, m
    forces: str
    estimate: str
    manoeuvre: str = ""
    off: tuple[float, float] = (30.0, 0.03)  # m, m/s of the first state
    mask: float = 10.0  # deg

    @property
    def words(self):
        return {"forces": self.forces, "estimate": self.estimate, "manoeuvre": self.manoeuvre or ()}


def orbit(a, e, i, nu=0.0):
    """State (6,) of an orbit whose node and pericentre lie on the x axis, angles in degrees."""
    i, nu = np.radians(i), np.radians(nu)
    p = a * (1 - e**2)
    r, v = p / (1 + e * np.cos(nu)), np.sqrt(MU / p)
    u, w = np.array([np.cos(nu), np.sin(nu)]) * r, np.array([-np.sin(nu), e + np.cos(nu)]) * v
    turn = np.array([[1.0, 0.0], [0.0, np.cos(i)], [0.0, np.sin(i)]])
    return np.concatenate([turn @ u, turn @ w])


KINDS = {
    "leo": Kind(
        orbit(6828e3, 0.001, 97.3), ("NORTH", "WEST", "SOUTH"), 24.0, 20.0, 5.0,
        "gravity=EGM2008 degree=12 drag=exponential air_height=450000 radiation=no cd_a_m=0.02",
        "cd/8h=0.5 bias.range/pass=5m", "2024-03-10T11:30:00Z dv=0,0.2,0m/s sigma=0.02m/s",
    ),
    "geo": Kind(
        orbit(42164e3, 0.0002, 0.1, 358.0), ("WEST", "EAST"), 48.0, 1200.0, 3.0,
        "gravity=EGM2008 degree=8 radiation=cannonball cr_a_m=0.02", "cr=0.2 bias.range.WEST=10m",
        "2024-03-10T20:00:00Z dv=0,0.1,0m/s sigma=5% for=900s engine=A\n"
        "2024-03-11T08:00:00Z dv=0,0,1m/s sigma=5% for=1800s engine=A",
    ),
    "gto": Kind(
        orbit(24400e3, 0.728, 7.0, 180.0), ("WEST", "SOUTH", "EAST"), 36.0, 600.0, 5.0,
        "gravity=EGM2008 degree=20 radiation=cannonball cr_a_m=0.02", "cr=0.2 dv@2024-03-10T22:00:00Z=0.2m/s clock.SOUTH=1ms",
    ),
}  # fmt: skip


def station(name):
    latitude, longitude = np.radians(SITES[name])
    return earth.Station.geodetic(name, latitude, longitude, 100.0)


def ranges(kind, times, which):
    """Observations without values, of the rows of these stations at these times."""
    segment = Segment("UTC", way="two-way", range_is="half", tag="receive", corrections=APPLIED)
    return Observations(
        epoch=EPOCH, t=times, value=np.full(len(times), 1e6), kinds=("range",), kind=np.zeros(len(times), dtype=int),
        participants=(*kind.sites, "SAT"), station=which, object=len(kind.sites), segments=(segment,), sigma=kind.sigma,
    )  # fmt: skip


def seen_rows(kind):
    """Times and stations of the rows that are above the mask, as the orbit would be without any force but the Earth's."""
    t = np.arange(0.0, kind.hours * 3600.0, kind.every)
    r, _ = pz.propagate_kepler(kind.state[:3], kind.state[3:], MU, t)
    rows = []
    for k, name in enumerate(kind.sites):
        place = Place(station(name), EPOCH)
        place.block(float(t[0]), float(t[-1]))
        q = np.array([place.value(float(x))[:3] for x in t])
        d = r - q
        up = np.einsum("ij,ij->i", d, q) / np.linalg.norm(d, axis=1) / np.linalg.norm(q, axis=1)
        rows += [(x, k) for x in t[up > np.sin(np.radians(kind.mask))].tolist()]
    rows.sort()
    return np.array([x for x, _ in rows]), np.array([k for _, k in rows])


def guess(kind):
    return Guess(EPOCH, kind.state[:3], kind.state[3:], "the orbit")


def begun(kind):
    """The setup of a kind, whose values are not measured yet."""
    t, which = seen_rows(kind)
    return prepared(ranges(kind, t, which), guess=guess(kind), stations=[station(n) for n in kind.sites], **kind.words)


def drawn(kind, given, seed):
    """The setup with measurements of a truth, and that truth (K, n)."""
    rng = np.random.default_rng(seed)
    first = given.states[0].copy()
    off = np.repeat(kind.off, 3)
    first[:6] += off * rng.standard_normal(6)
    spread = np.sqrt(np.diag(given.problem.covariance))[6:]
    first[6:] = given.problem.mean[6:] + spread * rng.standard_normal(len(spread))
    states = follow(given.problem, given.tracking.times, first, given.chosen.max_step)[0]
    z = predicted(given.problem, prepare(given.problem, given.tracking), states)
    z = z + kind.sigma * rng.standard_normal(z.shape)
    tracking = pz.Tracking(given.tracking.row_times, z, given.tracking.row_stations, epoch=given.tracking.epoch)
    return replace(given, tracking=tracking), states


def consistency(kind, count, first=0, given=None):
    """Squared errors in sigma: of the state (six together), and of each constant, (count, 1 + constants); their names."""
    given = given or begun(kind)
    names = ["state", *(given.labels[n].name if n in given.labels else n for n in given.problem.model.names[6:])]
    out = []
    for seed in range(first, first + count):
        one, truth = drawn(kind, given, seed)
        found = solved(ready(one), estimators(("graph",)))
        k = one.solution
        error, P = found.estimate.mean[k] - truth[k], found.estimate.covariance[k]
        scale = np.sqrt(np.diag(P))
        whole = error[:6] / scale[:6]
        state = whole @ np.linalg.solve(P[:6, :6] / np.outer(scale[:6], scale[:6]), whole)
        out.append([state, *(error[6:] / scale[6:]) ** 2])
    return names, np.array(out)


AIR = Kind(
    orbit(6828e3, 0.001, 97.3), ("NORTH", "WEST", "SOUTH"), 24.0, 20.0, 5.0,
    "gravity=EGM2008 degree=12 drag=harris-priester radiation=no cd_a_m=0.02", "cd=0.5",
)  # fmt: skip
PROCESS = replace(AIR, estimate="cd=0.5 cd~24h=0.32")
PIECE = 3600.0  # s, in which the density of a truth over that of its model is the same
TRUE = ("true_air", "true_cos", "true_sin")


def with_air(given):
    """The setup with the logarithm of the density over that of its model, and its waves over a turn, as constants."""
    every = {**given.chosen.forces.definitions, **given.chosen.extra.definitions}
    total = "true_air + true_cos*latitude_cos + true_sin*latitude_sin"
    extra = given.chosen.extra.and_(Extra({**LATITUDE, **instead(every, "cd_a_m", f"(cd_a_m*exp({total}))")}))
    roles = {**given.chosen.roles, **dict.fromkeys(TRUE, "estimated")}
    values = {**given.chosen.values, **dict.fromkeys(TRUE, pz.Gaussian(0.0, 1.0))}
    return renewed(given, given.measured, replace(given.chosen, roles=roles, values=values, extra=extra))


def flown(given, first, times, logarithms):
    """States (K, n) of an orbit through air whose density over that of its model has other logarithms in each hour."""
    place = given.problem.model.names.index(TRUE[0])
    out, x, t = [], first.copy(), float(times[0])
    for k, one in enumerate(logarithms.tolist()):
        end = min(PIECE * (k + 1), float(times[-1]))
        inside = times[(times > t) & (times <= end)]
        x[place] = one
        nodes = np.unique(np.concatenate([[t], inside, [end]]))
        states = follow(given.problem, nodes, x, given.chosen.max_step)[0]
        out.append(states[np.isin(nodes, inside if k else np.concatenate([times[:1], inside]))])
        x, t = states[-1].copy(), end
        if t >= times[-1]:
            break
    return np.concatenate(out)


def predictions(kind, count, other=None, days=(1, 2, 3), first=0, tell=lambda seed, found: None):
    """NEES per axis R, T, N (count, days, 3) of predictions, where the density of the truth varies, or is another model's.

    The truth is drawn from what the determination believes before: the logarithm of the density is a Gauss-Markov process, with
    waves over a turn where nothing is said of how drag varies.  Errors are those along the curved orbit, on the axes where
    the prediction stands, for which its covariance is: 40 km along the track are 120 m of the straight line's height.
    """
    given = begun(kind)
    truth, waves = with_air(given if other is None else begun(other)), given.chosen.air_varies is not None
    names, law = truth.problem.model.names, given.chosen.air_varies or AirVaries(0.32, 86400.0)
    place = names.index("cd_a_m_share")
    before, spread = truth.problem.mean[place], np.sqrt(truth.problem.covariance[place, place])
    rows, last = given.tracking.times, float(given.tracking.times[-1])
    ahead = np.array([last + 86400.0 * day for day in days])
    times = np.concatenate([rows, ahead])
    out = []
    for seed in range(first, first + count):
        rng = np.random.default_rng(seed)
        hours = int(times[-1] // PIECE) + 2
        change, left = np.zeros(hours), np.exp(-PIECE / law.time)
        change[0] = law.sigma * rng.standard_normal()
        for k in range(1, hours):
            change[k] = left * change[k - 1] + law.sigma * np.sqrt(1 - left**2) * rng.standard_normal()
        start = truth.states[0].copy()
        start[:6] += np.repeat(kind.off, 3) * rng.standard_normal(6)
        start[place] = before + spread * rng.standard_normal()
        if waves:  # the density is estimated, and the coefficient log-normal
            size = np.sqrt(np.log1p(spread**2))
            start[place] = share_of(np.exp(size * (start[place] - before) / spread - 0.5 * size**2))
        if waves and other is None:
            start[[names.index(name) for name in TRUE[1:]]] = law.sigma * rng.standard_normal(2)
        states = flown(truth, start, times, change - 0.5 * law.sigma**2 if other is None else 0.0 * change)
        z = predicted(truth.problem, prepare(truth.problem, truth.tracking), states[: len(rows)])
        z = z + kind.sigma * rng.standard_normal(z.shape)
        tracking = pz.Tracking(given.tracking.row_times, z, given.tracking.row_stations, epoch=given.tracking.epoch)
        near = ready(replace(given, tracking=tracking))
        keep, _, answer, _ = _answered(near, estimators(("graph",))["graph"])
        near = at_last_used(near, keep)
        mean, P = beliefs(near, answer, [near.measured.epoch + t for t in ahead.tolist()])
        out.append(curved(mean, P, states[len(rows) :]))
        tell(seed, out[-1])
    return np.array(out)


def curved(mean, covariance, truth):
    """Squared errors in sigma (K, 3) in height, along the curved orbit and across it, on axes of the mean (K, 6)."""
    axes = np.array([state_axes(x[:3], x[3:6])[:3, :3] for x in mean])
    r, (x, y, z) = np.linalg.norm(mean[:, :3], axis=1), np.einsum("kij,kj->ik", axes, truth[:, :3])
    distance = np.linalg.norm(truth[:, :3], axis=1)
    error = np.stack([distance - r, np.arctan2(y, x) * r, np.arcsin(z / distance) * r], axis=1)
    return error**2 / np.einsum("kij,kjl,kil->ki", axes, covariance[:, :3, :3], axes)


def within(values, degrees, sure=0.9995):
    """Whether sums of squares over runs are such as those of chi-square, by column."""
    n = len(values)
    total = values.sum(axis=0)
    return np.array([quantile(1 - sure, n * d) < s < quantile(sure, n * d) for s, d in zip(total, degrees, strict=True)])


def main(name, count):
    names, values = consistency(KINDS[name], count)
    degrees = [6, *[1] * (len(names) - 1)]
    good = within(values, degrees)
    for label, mean, d, ok in zip(names, values.mean(axis=0), degrees, good, strict=True):
        print(f"{name:4} {label:50} {mean / d:6.3f}  {'in' if ok else 'OUT'}")


def main_predictions(name, count, first=0):
    kinds = {"air": (AIR, None), "process": (PROCESS, None)}
    kinds["other"] = AIR, replace(AIR, forces=AIR.forces.replace("harris-priester", "exponential air_height=450000"))

    def tell(seed, found):
        print(name, seed, *(f"{value:.4f}" for value in found.ravel()), flush=True)

    found = predictions(kinds[name][0], count, kinds[name][1], first=first, tell=tell)
    for k, day in enumerate((1, 2, 3)):
        half, most = ((found[:, k] < quantile(share, 1)).mean(axis=0) for share in (0.5, 0.95))
        each = zip("RTN", found[:, k].mean(axis=0), half, most, strict=True)
        told = (f"{axis} {mean:7.3f} {low:4.0%} {high:4.0%}" for axis, mean, low, high in each)
        print(f"{name:8} {day} d  " + "  ".join(told))


if __name__ == "__main__":
    (main if sys.argv[1] in KINDS else main_predictions)(sys.argv[1], *map(int, sys.argv[2:]))
