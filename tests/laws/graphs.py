"""Problems that the graph and the window are tried on beside the founding two, and what several of their tests share."""

from functools import cache

import numpy as np

import piazzi as pz
from tests.laws.problems import DEGREE, MU_EARTH, linear, random_covariance, random_stable
from tests.references.dense import Seen


class LinearCase:
    """A random linear-Gaussian problem with several stations and several rows per epoch, and the matrices of an oracle.

    `rank` is that of the process noise (None: full); `sure` makes the first state certain from the start.
    """

    def __init__(self, n, widths, seed, *, rank=None, missing=0.2, epochs=6, sure=False):
        rng = np.random.default_rng(seed)
        self.A = random_stable(rng, n) + 0.3 * np.eye(n)
        self.Q = np.zeros((n, n)) if rank == 0 else random_covariance(rng, n, rank)
        self.H = [rng.standard_normal((m, n)) for m in widths]
        self.R = [random_covariance(rng, m) for m in widths]
        self.m, self.P = rng.standard_normal(n), random_covariance(rng, n)
        if sure:
            self.P[0] = self.P[:, 0] = 0.0
        self.problem = linear(self.A, self.H, self.R, self.Q, pz.Gaussian(self.m, self.P))
        rows = [np.sort(rng.choice(len(widths), rng.integers(1, len(widths) + 1), replace=False)) for _ in range(epochs)]
        self.row_station = np.concatenate(rows)
        self.row_epoch = np.repeat(np.arange(epochs), [len(r) for r in rows])
        values = rng.standard_normal((len(self.row_station), max(widths)))
        for z, s in zip(values, self.row_station, strict=True):
            z[widths[s] :] = np.nan
            z[: widths[s]][rng.random(widths[s]) < missing] = np.nan
        values[0, 0] = 1.0
        self.values, self.epochs = values, epochs
        self.tracking = pz.Tracking(self.row_epoch.astype(float), values, [f"station{s}" for s in self.row_station])

    @property
    def seen(self):
        """What each epoch measured, stacked."""
        out = []
        for k in range(self.epochs):
            index = np.flatnonzero(self.row_epoch == k)
            stations = self.row_station[index]
            R = np.zeros((0, 0))
            for s in stations:
                R = np.block([[R, np.zeros((len(R), len(self.R[s])))], [np.zeros((len(self.R[s]), len(R))), self.R[s]]])
            z = np.concatenate([self.values[i, : len(self.H[s])] for i, s in zip(index, stations, strict=True)])
            out.append(Seen(z, np.vstack([self.H[s] for s in stations]), R))
        return out

    @property
    def chain(self):
        """Prior, transitions, noises and measurements, as the references take them."""
        return self.m, self.P, [self.A] * (self.epochs - 1), [self.Q] * (self.epochs - 1), self.seen


@cache
def spacecraft_model() -> pz.Model:
    """A satellite with a rotating thrust; a radar whose range has an unknown bias, and a Doppler receiver."""
    dx, dy = "(x - px)", "(y - py)"
    return pz.Model(
        ["x", "y", "vx", "vy"],
        ["vx", "vy", "-mu*x/hypot(x, y)**3 + thrust*cos(turn*t)", "-mu*y/hypot(x, y)**3 + thrust*sin(turn*t)"],
        [
            pz.Sensor("radar", {"range": f"hypot({dx}, {dy}) + bias", "azimuth": f"atan2({dy}, {dx})"}, angles=["azimuth"]),
            pz.Sensor("doppler", {"rate": f"({dx}*vx + {dy}*vy)/hypot({dx}, {dy})"}),
        ],
        [pz.Parameter("mu"), pz.Parameter("thrust"), pz.Parameter("turn"), pz.Parameter("bias", "estimated")],
    )


def spacecraft(**changes) -> pz.Problem:
    """Two radars with correlated noise and a Doppler receiver; accelerations as integrated white noise; an estimated bias."""
    R = np.array([[400.0, 0.01], [0.01, (0.05 * DEGREE) ** 2]])
    numbers = {
        "prior": pz.Gaussian([1.0e5, 7.2e6, 7400.0, -50.0], [1e8, 1e8, 1e4, 1e4]),
        "process_noise": pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4]),
        "stations": [
            pz.Station("north", "radar", R, {"px": 0.0, "py": 6.378e6}),
            pz.Station("east", "radar", 2 * R, {"px": 3.1e6, "py": 5.57e6}),
            pz.Station("ear", "doppler", 0.04, {"px": -2.0e6, "py": 6.05e6}),
        ],
        "parameters": {"mu": MU_EARTH, "thrust": 0.05, "turn": 0.01, "bias": pz.Gaussian(0.0, 1e4)},
        "integrator": pz.RungeKutta4(max_step=10.0),
        "truth": pz.Truth(parameters={"bias": 130.0}),
    }
    return pz.Problem(spacecraft_model(), **(numbers | changes))


def passes(problem, epochs=40, seed=3, start=0.0):
    """A tracking at irregular times by changing sets of stations, with missing components."""
    rng = np.random.default_rng(seed)
    times = start + np.cumsum(rng.uniform(2.0, 30.0, epochs))
    full = pz.simulate(problem, times, rng)
    values = np.where(rng.random(full.values.shape) < 0.2, np.nan, full.values)
    keep = rng.random(len(values)) < 0.7
    keep[full.first_row[:-1]] = True  # every epoch stays
    truth = full.truth
    return pz.Tracking(full.row_times[keep], values[keep], full.row_stations[keep], truth)
