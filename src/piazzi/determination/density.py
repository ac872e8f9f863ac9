"""How far the density of the air departs from that of its model: over the measurements, and behind them.

Density varies with the Sun and the geomagnetic field in ways that no model follows.  The share by which it departs is a
first-order Gauss-Markov process.  Where drag moves an orbit by more than a tenth of what its measurements leave open, the
process is estimated: its values at nodes that are equally far apart, from the first measurement or the orbit of before to the
last, are made of independent numbers of unit variance, and between them it is linear; there are as many as measurements tell
apart.  Beside it stand sine and cosine of the
argument of latitude, as models differ most in how much more air there is by day than by night.  So an orbit stays one arc,
which the first state and constants determine.  Behind the last node its mean goes back to zero, and what it may have become
meanwhile is added to covariances by the derivatives of the state by the coefficient of drag.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, pi, sqrt
from typing import Any

import numpy as np

from piazzi.determination.analysis import analysed
from piazzi.determination.motion import Extra, instead
from piazzi.determination.orbit_forces import AirVaries, Chosen
from piazzi.determination.physical import AIR, DENSITY, DRAG, SHARE, said_name, share_of, slope_of, value_of
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
WAVES = ("cos", "sin")
NAMES = {"cos": "cosine", "sin": "sine"}
BEHIND = np.geomspace(0.3, 30.0, 400)  # times what was found, that a coefficient may be
LEAST = 0.1  # of the usual coefficient, which shares are of at the least


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
    chosen = _with_process(_about(given, varies, last - first), given.measured.epoch, varies, np.linspace(first, last, count))
    text = f"the density over the measurements is estimated at {count} times, as drag moves the orbit"
    if told > count:
        text += (
            f"; the measurements tell {told:.0f} such values apart, so that sigmas are too small: "
            "determine shorter parts, each with --prior"
        )
    found = renewed(given, given.measured, chosen)
    place = found.problem.model.names.index(DRAG)
    found.states[:, place] = share_of(_coefficient(given) / float(found.problem.parameters[said_name(DRAG)]))
    return replace(found, assumed=(*given.assumed, text))


def _told_apart(moved: Array, varies: AirVaries, span: float) -> float:
    """How many nodes the measurements can tell apart, by what twice the drag moves their rows by, in sigma.

    Over a span T a Gauss-Markov process of sigma s and time tau is about a sum of cosines of k half waves, their amplitudes of
    sigma s sqrt(4 T/tau) / (pi k).  A constant change of an acceleration moves an orbit along by 3/2 a T^2, such a wave by
    3 a / (pi k/T)^2, which is 2 / (pi k)^2 of it.  Waves are left out that move all rows together by less than a sigma.
    """
    size = float(np.abs(moved).max()) * varies.sigma * sqrt(4.0 * span / varies.time) * 2.0 / pi**3
    return float((size * sqrt(0.5 * np.count_nonzero(moved))) ** (1.0 / 3.0))


def _coefficient(given: Setup) -> float:
    """That of drag which the states have."""
    share = float(given.states[0, given.problem.model.names.index(DRAG)])
    return float(given.problem.parameters[said_name(DRAG)]) * float(value_of(share))


def _about(given: Setup, varies: AirVaries, span: float) -> Chosen:
    """The forces with the usual coefficient that shares of the density are of: that which may stand behind what was found.

    The measurements tell the product of coefficient and density.  Where the density was low over them, what was found is less
    than the coefficient, of which the density varies by its shares later: its root mean square given what was found, by the
    belief in the coefficient before and the variance of the mean of a Gauss-Markov process over the measurements.
    """
    chosen, name = given.chosen, said_name(DRAG)
    old, before = float(chosen.values[name]), chosen.values[DRAG]
    found, spread = max(_coefficient(given), LEAST * old), sqrt(float(np.ravel(before.covariance)[0]))
    turns = span / varies.time
    share = varies.sigma * sqrt(2.0 * (exp(-turns) - 1.0 + turns)) / turns
    tried = found * BEHIND
    off = ((found / tried - 1.0) / share) ** 2 + ((tried / old - 1.0) / spread) ** 2
    weight = np.exp(-0.5 * (off - off.min()))
    new = sqrt(float(weight @ tried**2 / weight.sum()))
    scaled = Gaussian(share_of(old / new), float(np.ravel(before.covariance)[0]) * (old / new) ** 2)
    return replace(chosen, values={**chosen.values, name: new, DRAG: scaled})


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
        "new": varies.sigma * sqrt(1.0 - left**2),
    }  # fmt: skip
    nodes = {f"{AIR}at_1": f"{AIR}sigma*{AIR}1"}
    nodes |= {f"{AIR}at_{k}": f"{AIR}left*{AIR}at_{k - 1} + {AIR}new*{AIR}{k}" for k in range(2, count + 1)}
    hats = {f"{AIR}hat_{k}": f"max(1 - abs({AIR}within - {k - 1}), 0)*{AIR}at_{k}" for k in range(1, count + 1)}
    text = {
        **nodes,
        f"{AIR}place": f"(t - {AIR}first)/{AIR}step",
        f"{AIR}within": f"max(min({AIR}place, {count - 1}), 0)",
        **hats,
        **LATITUDE,
        f"{AIR}change": f"exp(-{AIR}rate*abs({AIR}place - {AIR}within))*({' + '.join(hats)})"
        + f" + {' + '.join(f'{DENSITY}{wave}*latitude_{wave}' for wave in WAVES)}",
    }
    every = {**chosen.forces.definitions, **chosen.extra.definitions}
    labels = {}
    for k in range(1, count + 1):
        when = (epoch + (first + step * (k - 1))).to("UTC")[:16].replace("T", " ")
        labels[f"{AIR}{k}"] = Label(f"{DENSITY}{k}", f"share by which the density of the air departs at {when}")
    for wave in WAVES:
        words = f"share by which the density departs: its {NAMES[wave]} over a turn"
        labels[f"{DENSITY}{wave}"] = Label(f"{DENSITY}{wave}", words)
    extra = Extra({**text, **instead(every, DRAG, f"({DRAG} + {AIR}change)")}, labels=labels)
    own = {f"{AIR}{k}": "estimated" for k in range(1, count + 1)} | {f"{AIR}{name}": "fixed" for name in numbers}
    own |= {f"{DENSITY}{wave}": "estimated" for wave in WAVES}
    values: dict[str, Any] = {f"{DENSITY}{wave}": Gaussian(0.0, varies.sigma**2) for wave in WAVES}
    values |= {f"{AIR}{k}": Gaussian(0.0, 1.0) for k in range(1, count + 1)} | {f"{AIR}{n}": v for n, v in numbers.items()}
    return replace(chosen, roles={**chosen.roles, **own}, values={**chosen.values, **values}, extra=chosen.extra.and_(extra))


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
    known = f"{AIR}1" in given.problem.model.names  # and of a share of the usual coefficient, else of that of the answer
    sigma = air.sigma * (1.0 if known else float(value_of(estimate.mean[-1, place])))
    first = 0.0 if known else sigma
    out[late] = departed(
        given.problem, given.chosen.max_step, start, estimate.mean[-1], place, (sigma, air.time, first), t[late]
    )
    return out


def departed(
    problem: Problem, step: float, start: float, x: Array, place: int, law: tuple[float, float, float], t: Array
) -> Array:
    """Covariance (K, 6, 6) at times, all after `start` or all before, by what drag departs by meanwhile.

    Parameters
    ----------
    problem, step : that moves the state `x` (n,), by steps of at most so many seconds
    place : of the coefficient of drag in it
    law : of the process: its steady sigma in that coefficient, its time (s), and its sigma at the start
    """
    sigma, time, first = law
    away = np.abs(t - start)
    every = time / PARTS if t[0] > start else min(step, time / PARTS)
    nodes = np.unique(np.concatenate([[0.0], np.arange(0.0, away.max(), every), away]))
    _, Phi = follow(problem, start + nodes if t[0] > start else start - nodes, x, step)
    S = np.zeros((7, 7))
    S[6, 6] = first**2
    found = {0.0: S[:6, :6].copy()}
    A = np.zeros((7, 7))
    for when, dt, one in zip(nodes[1:].tolist(), np.diff(nodes).tolist(), Phi, strict=True):
        left = exp(-dt / time)
        A[:6, :6], A[:6, 6], A[6, 6] = one[:6, :6], one[:6, place], left
        S = A @ S @ A.T
        S[6, 6] += sigma**2 * (1.0 - left**2)
        found[when] = S[:6, :6].copy()
    return np.array([found[when] for when in away.tolist()])


def _place(given: Setup) -> int | None:
    """Where the coefficient of drag stands, or that of the last part of the time; None where it is not estimated."""
    names = given.problem.model.names
    own = [n for n in names if n.startswith("cd_a_m") and n.endswith(SHARE)]
    return names.index(own[-1]) if own else None
