"""Simulated passes of every sensor of `earth.sensors`, determined by the graph: how far truths are off, in sigma.

``python -m tests.references.sensor_consistency N [NAME ...]`` prints the mean NEES over N seeds beside its bounds at 99.9 %.
"""

from __future__ import annotations

import sys

import numpy as np

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from piazzi.estimate.chi_square import quantile
from tests.references.signals import EPOCH, HERSTMONCEUX, YARRAGADEE, T, orbit

FORCES = earth.Forces(degree=4)
NEAR = earth.Station.geodetic("Near", np.radians(-33.0), np.radians(118.0), 100.0)
SITES = (YARRAGADEE, NEAR)
TIMES = T + np.arange(0.0, 301.0, 20.0)
GM = 3.986004418e14
NEAR_BY = 0.1  # of it between satellites: 300 m across a range of 300 km make 0.15 m, more than its noise
SPREAD = [300.0] * 3 + [0.3] * 3  # m, m/s of the prior, of which truths are drawn


def navigation(k):
    """The orbit of a navigation satellite, one of several, as a table."""
    t = np.arange(T - 600.0, T + 1200.0, 60.0)
    n, r = 2 * np.pi / 43082.0, 2.656e7
    a, tilt = n * t + 0.9 * k, np.radians(55.0 * (-1) ** k)
    c, s, zero = np.cos(a), np.sin(a), 0.0 * a
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    return pz.Table(t, np.hstack([r * np.stack([c, s, zero], -1) @ turn.T, n * r * np.stack([-s, c, zero], -1) @ turn.T]))


def twin():
    """The orbit of a satellite some 300 km behind, as a table."""
    x = orbit("LEO") + np.array([2e5, 1e5, -2e5, 20.0, -30.0, 10.0])
    t = np.arange(-900.0, 1200.0, 30.0)
    r, v = pz.propagate_kepler(x[:3], x[3:], GM, t)
    return pz.Table(t + T, np.hstack([r, v]))


# name: the sensor, its noise, and numbers of its stations
ONE = {
    "range, one-way": (lambda: sensors.range("one-way"), 1.0, {}),
    "range, two-way": (lambda: sensors.range("two-way", troposphere="saastamoinen", relativity=True), 1.0, {}),
    "range, three-way": (lambda: sensors.range("three-way", transmitter=HERSTMONCEUX), 1.0, {}),
    "range, bias estimated": (lambda: sensors.range("two-way", parameters=["range_bias"]), 1.0, {}),
    "range_rate, instant": (lambda: sensors.range_rate("two-way"), 0.01, {}),
    "range_rate, count": (lambda: sensors.range_rate("two-way", count="end"), 0.01, {"count": 10.0}),
    "azimuth_elevation": (lambda: sensors.azimuth_elevation(refraction="optical"), 1e-4, {}),
    "azimuth_elevation, xeyn": (lambda: sensors.azimuth_elevation(mount="xeyn"), 1e-4, {}),
    "right_ascension_declination": (lambda: sensors.right_ascension_declination("astrometric"), 1e-5, {}),
    "frequency": (lambda: sensors.frequency(437e6), 0.1, {"since": T}),
    "frequency, count": (lambda: sensors.frequency(437e6, count="start"), 0.1, {"since": T, "count": 10.0}),
    "returned_frequency": (
        sensors.returned_frequency, 0.1,
        {"transmit_frequency": 2.1e9, "transmit_rate": 20.0, "turnaround": 240 / 221, "since": T},
    ),
    "carrier_phase": (lambda: sensors.carrier_phase(passes=["Yarragadee", "Near"]), 0.2, {"cycles": 7.0}),
    "radar_delay": (sensors.radar_delay, 1e-8, {}),
    "radar_doppler": (sensors.radar_doppler, 0.1, {}),
    "delay_difference": (lambda: sensors.delay_difference(HERSTMONCEUX), 1e-8, {}),
}  # fmt: skip
PRIORS = {"range_bias": 10.0, "phase_Yarragadee": 1e6, "phase_Near": 1e6}
NAMES = (*ONE, "position", "pseudorange", "range, aboard", "satellite_range")


def problem_of(name):
    """A problem whose stations have one sensor."""
    if name == "satellite_range":
        return _both()
    places, numbers = {s.name: None for s in SITES}, {}
    if name == "position":
        made, sigma = sensors.position("position", velocity=True, frame="ITRF"), [3.0] * 3 + [0.01] * 3
        places = {"receiver": None}
    elif name == "pseudorange":
        made, sigma = sensors.pseudorange(), 1.0
        places = {f"G{k}": navigation(k) for k in range(5)}
    elif name == "range, aboard":
        made, sigma, places = sensors.range(aboard=True), 0.1, {"twin": twin()}
    else:
        make, sigma, numbers = ONE[name]
        made = make()
    known = dict(made.defaults)
    stations = []
    for site in SITES if None in places.values() and name != "position" else places:
        if isinstance(site, str):
            given = made.at(None, EPOCH, sigma, name=site, place=places[site])
        else:
            own = {key: value for key, value in numbers.items() if key in known}
            given = made.at(site, EPOCH, sigma, **own)
        stations.append(pz.Station(**given))
    priors = {n: pz.Gaussian(mean, spread**2) for n, (mean, spread) in dict(made.priors).items()}
    priors |= {n: pz.Gaussian(0.0, PRIORS[n] ** 2) for n in made.parameters if n in PRIORS}
    functions = {**FORCES.functions(EPOCH), **made.functions(EPOCH)}
    near = NEAR_BY if name == "range, aboard" else 1.0
    prior = pz.Gaussian(orbit("LEO"), np.square(near * np.array(SPREAD)))
    return pz.Problem(
        FORCES.model([made]), prior, None, stations, {**FORCES.values, **priors}, pz.RungeKutta8(20.0), prior_time=T,
        functions=functions, epoch=EPOCH,
    )  # fmt: skip


def _both():
    """Two satellites that range to one another, each seen from the ground."""
    own, between = sensors.range("two-way"), sensors.satellite_range("two-way")
    model = sensors.two_satellites(FORCES, [own, between])
    x = np.r_[orbit("LEO"), orbit("LEO") + np.array([2e5, 1e5, -2e5, 20.0, -30.0, 10.0])]
    stations = [pz.Station(**own.at(site, EPOCH, 1.0)) for site in SITES] + [pz.Station(**between.at(sigma=0.1))]
    prior = pz.Gaussian(x, np.square(NEAR_BY * np.array(SPREAD * 2)))
    return pz.Problem(
        model, prior, None, stations, FORCES.values, pz.RungeKutta8(20.0), prior_time=T,
        functions=FORCES.functions(EPOCH), epoch=EPOCH,
    )  # fmt: skip


def consistency(name, count, first=0):
    """NEES (count,) of all estimated values at the last time, and how many values there are."""
    problem, graph = problem_of(name), pz.FactorGraph()
    out = []
    for seed in range(first, first + count):
        tracking = pz.simulate(problem, TIMES, np.random.default_rng(seed))
        found = graph.estimate(problem, tracking)
        if not found.success:
            raise AssertionError(f"{name}, seed {seed}: {found.message}")
        P, error = found.covariance[-1], found.mean[-1] - tracking.truth[-1]
        scale = np.sqrt(np.diag(P))
        out.append(error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale))
    return np.array(out), len(problem.model.names)


def bounds(count, values):
    """Between which the sum of NEES is in 99.9 % of cases."""
    return quantile(0.0005, count * values), quantile(0.9995, count * values)


if __name__ == "__main__":
    runs = int(sys.argv[1])
    for kind in sys.argv[2:] or NAMES:
        squares, n = consistency(kind, runs)
        low, high = (end / (n * runs) for end in bounds(runs, n))
        print(
            f"{kind:28s} {n:2d} values, {runs} seeds: mean NEES / n {squares.mean() / n:.3f}, bounds {low:.3f} to {high:.3f}",
            flush=True,
        )
