"""How far the density of the air departs from that of its model: over the measurements, and behind them.

Density varies with the Sun and the geomagnetic field in ways that no model follows.  The logarithm of what it is over that of
its model is a first-order Gauss-Markov process: models are judged by ratios of densities (Bruinsma and Boniface 2021, J.
Space Weather Space Clim.  11, 47), and a density is positive.  Its mean is minus half its variance, so that the mean density
is that of the model, but for the waves.  Where drag moves an orbit by more than a tenth of what its measurements leave open,
the process is estimated: its values at nodes that are equally far apart, from the first measurement or the orbit of before to
the last, are made of independent numbers of unit variance, and between them it is linear; there are as many as measurements
tell apart.  Beside it stand sine and cosine of the argument of latitude, as models differ most in how much more air there is
by day than by night.  The coefficient of drag is log-normal too, of the mean and sigma that it has before.  So an orbit stays
one arc, which the first state and constants determine.  Waves are of the same sigma, their mean is zero.  Behind the last node
the mean of the density goes back to that of the model, and what it may have become meanwhile is added to covariances by the
derivatives of the state by the coefficient of drag.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, factorial, log, log1p, pi, sqrt
from typing import NamedTuple

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.analysis import analysed
from piazzi.determination.motion import Extra, instead
from piazzi.determination.orbit_forces import AirVaries, Chosen
from piazzi.determination.physical import (
    AIR,
    BEND,
    DENSITY,
    DRAG,
    DRAG_LOGARITHM,
    WAVES,
    is_coefficient,
    slope_of,
    value_of,
    worth,
)
from piazzi.determination.setup import Setup, follow, renewed
from piazzi.determination.unknowns import Label
from piazzi.earth import Epoch
from piazzi.earth.force_text import LATITUDE
from piazzi.estimate.estimator import Estimate
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

COUNTS = 8, 12, 16, 24  # nodes over the measurements: each number compiles kernels of its own
SMALL = 0.1  # of a sigma, by which drag may move the solution before the density counts
PARTS = 20.0  # of the process's time behind the measurements, in each of which it is constant
ORDERS = range(1, 5)  # of the logarithm's covariance C in exp(C) - 1, that of the density: sigma is at most a half
NAMES = {"density_cos": "cosine", "density_sin": "sine"}


def with_density(given: Setup) -> Setup:
    """The set-up with the density as an unknown, where drag matters and the user says nothing of how it varies.

    Its states are those of the set-up, with the density as the model has it.
    """
    varies, names = given.chosen.air_varies, given.problem.model.names
    if varies is None or DRAG not in names or not np.isfinite(given.states).all():
        return given
    first, last = _span(given)
    moved = np.nan_to_num(analysed(given, given.states).rows[..., names.index(DRAG)])
    if not (last > first and np.linalg.norm(moved) > SMALL):
        return given
    share = float(given.states[0, names.index(DRAG)])
    told = _told_apart(moved * float(value_of(share) / slope_of(share)), varies, last - first)
    count = next((count for count in COUNTS if count >= told), COUNTS[-1])
    chosen = _with_process(given.chosen, given.measured.epoch, varies, np.linspace(first, last, count))
    text = f"the density over the measurements is estimated at {count} times, as drag moves the orbit"
    if told > count:
        text += (
            f"; the measurements tell {told:.0f} such values apart, so that sigmas are too small: "
            "determine shorter parts, each with --prior"
        )
    found = renewed(given, given.measured, chosen)
    found.states[:, found.problem.model.names.index(DRAG_LOGARITHM)] = (
        log(value_of(share)) + 0.5 * varies.sigma**2
    )  # as much drag
    return replace(found, assumed=(*given.assumed, text))


def _told_apart(moved: Array, varies: AirVaries, span: float) -> float:
    """How many nodes the measurements can tell apart, by what twice the drag moves their rows by, in sigma.

    Over a span T a Gauss-Markov process of sigma s and time tau is about a sum of cosines of k half waves, their amplitudes of
    sigma s sqrt(4 T/tau) / (pi k).  A constant change of an acceleration moves an orbit along by 3/2 a T^2, such a wave by
    3 a / (pi k/T)^2, which is 2 / (pi k)^2 of it.  Waves are left out that move all rows together by less than a sigma.
    """
    size = float(np.abs(moved).max()) * varies.sigma * sqrt(4.0 * span / varies.time) * 2.0 / pi**3
    return float((size * sqrt(0.5 * np.count_nonzero(moved))) ** (1.0 / 3.0))


def _span(given: Setup) -> tuple[float, float]:
    """The first node and the last: an orbit of before goes on from where it ended."""
    times = given.tracking.times
    begun = float(times[0])
    if given.earlier is not None and given.problem.prior_time is not None:
        begun = min(begun, float(given.problem.prior_time))
    return begun, float(times[-1])


def _with_process(chosen: Chosen, epoch: Epoch, varies: AirVaries, times: Array) -> Chosen:
    """The forces with it at its nodes: all is text, and times and sigmas are parameters, so that others compile nothing."""
    count, first = len(times), float(times[0])
    step = (float(times[-1]) - first) / (count - 1)
    left = exp(-step / varies.time)
    numbers = {
        "first": first, "step": step, "rate": step / varies.time, "sigma": varies.sigma, "left": left,
        "new": varies.sigma * sqrt(1.0 - left**2), "mean": -0.5 * varies.sigma**2,
    }  # fmt: skip
    nodes = {f"{AIR}at_1": f"{AIR}sigma*{AIR}1"}
    nodes |= {f"{AIR}at_{k}": f"{AIR}left*{AIR}at_{k - 1} + {AIR}new*{AIR}{k}" for k in range(2, count + 1)}
    hats = {f"{AIR}hat_{k}": f"max(1 - abs({AIR}within - {k - 1}), 0)*{AIR}at_{k}" for k in range(1, count + 1)}
    waves = " + ".join(f"{wave}*{wave.replace(DENSITY, 'latitude_')}" for wave in WAVES)
    text = {
        **nodes,
        f"{AIR}place": f"(t - {AIR}first)/{AIR}step",
        f"{AIR}within": f"max(min({AIR}place, {count - 1}), 0)",
        **hats,
        **LATITUDE,
        f"{AIR}left_now": f"exp(-{AIR}rate*abs({AIR}place - {AIR}within))",
        f"{AIR}change": f"{AIR}left_now*({' + '.join(hats)} + {AIR}mean*{AIR}left_now) + {waves}",
        f"{AIR}factor": f"exp({DRAG_LOGARITHM} + {AIR}change)",
    }
    every = {**chosen.forces.definitions, **chosen.extra.definitions}
    labels = {DRAG_LOGARITHM: chosen.extra.labels[DRAG]}
    for k in range(1, count + 1):
        when = (epoch + (first + step * (k - 1))).to("UTC")[:16].replace("T", " ")
        labels[f"{AIR}{k}"] = Label(f"{DENSITY}{k}", f"logarithm of the density over the model's at {when}")
    for wave in WAVES:
        labels[wave] = Label(wave, f"logarithm of the density over the model's: its {NAMES[wave]} over a turn")
    share = f"({AIR}factor - {BEND!r}/{AIR}factor)"
    extra = Extra({**text, **instead(every, DRAG, share)}, labels=labels)
    drag = log1p(float(np.ravel(chosen.values[DRAG].covariance)[0]))
    unknown = {DRAG_LOGARITHM: Gaussian(-0.5 * drag, drag)}
    unknown |= {f"{AIR}{k}": Gaussian(0.0, 1.0) for k in range(1, count + 1)}
    unknown |= {wave: Gaussian(0.0, varies.sigma**2) for wave in WAVES}
    fixed = {f"{AIR}{name}": number for name, number in numbers.items()}
    roles = {**chosen.roles, **dict.fromkeys(unknown, "estimated"), **dict.fromkeys(fixed, "fixed")}
    values = {**chosen.values, **unknown, **fixed}
    del roles[DRAG], values[DRAG]
    return replace(chosen, roles=roles, values=values, extra=chosen.extra.and_(extra))


def departure(given: Setup, estimate: Estimate, t: Array) -> Array:
    """Covariance (K, 6, 6) that the departure adds at times, zero up to the last measurement."""
    out = np.zeros((len(t), 6, 6))
    air, place = given.chosen.air_varies, _place(given)
    measured = np.isfinite(given.tracking.values).any(axis=1)
    last = float(given.tracking.row_times[measured][-1]) if measured.any() else np.inf
    start = float(estimate.times[-1])
    late = np.flatnonzero(t > max(last, start))
    if air is None or place is None or not len(late) or not given.problem.is_noise_free:
        return out
    x, P = estimate.mean[-1], estimate.covariance[-1]
    value, slope = worth(given.problem.model.names[place], float(x[place]))
    size = sqrt((value / slope) ** 2 + float(P[place, place]))
    law = Law(air.sigma, air.time, f"{AIR}1" in given.problem.model.names)
    out[late] = departed(given.problem, given.chosen.max_step, start, x, (place, size), law, t[late])
    return out


class Law(NamedTuple):
    """Sigma of the logarithm of the density, its time (s), and whether it is known at the start."""

    sigma: float
    time: float
    known: bool

    def variances(self, away: float) -> Array:
        """Of its powers, those of C^k/k! for the covariance C of the logarithm, so many seconds from the start."""
        new = self.sigma**2 * (1.0 - (exp(-2.0 * away / self.time) if self.known else 0.0))
        return np.array([new**k / factorial(k) for k in ORDERS])


def departed(problem: Problem, step: float, start: float, x: Array, drag: tuple[int, float], law: Law, t: Array) -> Array:
    """Covariance (K, 6, 6) at times, all after `start` or all before, by what the density departs by meanwhile.

    The covariance of a log-normal density, as a share of its mean, is exp(C) - 1 with that C of its logarithm.  Powers of a C
    that is Markov are Markov too: the sum of processes of rates k/time has that covariance, and they stand beside the state.

    Parameters
    ----------
    problem, step : that moves the state `x` (n,), by steps of at most so many seconds
    drag : place of its coefficient in it, and the root mean square of that
    law : of the density
    """
    place, size = drag
    away = np.abs(t - start)
    every = law.time / PARTS if t[0] > start else min(step, law.time / PARTS)
    nodes = distinct(np.concatenate([[0.0], np.arange(0.0, away.max(), every), away]))
    _, Phi = follow(problem, start + nodes if t[0] > start else start - nodes, x, step)
    rates, own = np.array(ORDERS) / law.time, slice(6, None)
    S, A = np.zeros((2, 6 + len(rates), 6 + len(rates)))
    S[own, own] = np.diag(law.variances(0.0))
    found = {0.0: S[:6, :6].copy()}

    def later(S: Array, begin: float, end: float) -> Array:
        """The same with the processes at another time."""
        left = np.concatenate([np.ones(6), np.exp(-rates * (end - begin))])
        S = S * np.outer(left, left)
        S[own, own] += np.diag(law.variances(end) - left[own] ** 2 * law.variances(begin))
        return S

    for begin, end, one in zip(nodes[:-1].tolist(), nodes[1:].tolist(), Phi, strict=True):
        middle = 0.5 * (begin + end)  # whose values stand for those of the whole part
        A[:6, :6], A[:6, own], A[own, own] = one[:6, :6], size * one[:6, place, None], np.eye(len(rates))
        S = later(A @ later(S, begin, middle) @ A.T, middle, end)
        found[end] = S[:6, :6].copy()
    return np.array([found[when] for when in away.tolist()])


def _place(given: Setup) -> int | None:
    """Where the coefficient of drag stands, or that of the last part of the time; None where it is not estimated."""
    names = given.problem.model.names
    own = [n for n in names if n.startswith("cd_a_m") and is_coefficient(n)]
    return names.index(own[-1]) if own else None
