"""Simulated tracks of two-body motion, with light time, for tests of initial orbits; run it for tables and curves of many.

``python -m tests.references.tracks KIND COUNT``
"""

import sys
import time

import numpy as np

from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, RATE, Rows
from piazzi.orbit.modes import two_body_modes
from piazzi.orbit.region import Region

EARTH, RADIUS, TURN, LIGHT = 3.986004418e14, 6.378e6, 7.292115e-5, 299792458.0
SUN, AU = 1.32712440018e20, 1.495978707e11
ABOUT_EARTH = Region(EARTH, RADIUS + 120e3, 1e8)
ABOUT_SUN = Region(SUN, 0.05 * AU, 50 * AU, on_surface=False)
KINDS = {"range": RANGE, "rate": RATE, "direction": DIRECTION, "position": POSITION}


def station(latitude, longitude, t):
    """Place and velocity at a time, on a ball that turns."""
    a, flat = longitude + TURN * t, np.cos(latitude)
    place = RADIUS * np.array([flat * np.cos(a), flat * np.sin(a), np.sin(latitude)])
    return place, RADIUS * TURN * flat * np.array([-np.sin(a), np.cos(a), 0.0])


def orbit(rng, mu, a, e, cosine):
    """A state with a direction of the plane whose inclination has this cosine, the rest uniform."""
    node, perigee, M = rng.uniform(0, 2 * np.pi, 3)
    E = M
    for _ in range(60):
        E = M + e * np.sin(E)
    c, s, sine = np.cos(node), np.sin(node), np.sqrt(1 - cosine**2)
    plane = np.array([[c, s, 0.0], [-cosine * s, cosine * c, sine]])
    turn = np.array([[np.cos(perigee), np.sin(perigee)], [-np.sin(perigee), np.cos(perigee)]])
    P, Q = turn @ plane
    b = np.sqrt(1 - e * e)
    r = a * (np.cos(E) - e) * P + a * b * np.sin(E) * Q
    return np.concatenate([r, np.sqrt(mu * a) / np.linalg.norm(r) * (-np.sin(E) * P + b * np.cos(E) * Q)])


def seen(rng, x, observer, t, sigmas, mu=EARTH, lowest=5.0, offset=0.0):
    """Rows of (t, kind, observer, velocity, value, sigma, shared) at times of reception when it is above `lowest` degrees."""
    out = []
    for at in t:
        place, moves = observer(at)
        emitted = at
        for _ in range(4):
            r, v = propagate_kepler(x[:3], x[3:], mu, emitted)
            rho = np.linalg.norm(r - place)
            emitted = at - rho / LIGHT
        u = (r - place) / rho
        if lowest is not None and u @ place / np.linalg.norm(place) < np.sin(np.radians(lowest)):
            continue
        for what, sigma in sigmas.items():
            if what == "range":
                value = [rho + sigma * rng.normal(), 0, 0]
            elif what == "rate":
                value = [u @ (v - moves) + offset + sigma * rng.normal(), 0, 0]
            else:
                value = u + sigma * rng.normal(size=3)
                value = value / np.linalg.norm(value)
            out.append((at, KINDS[what], place, moves, value, [sigma, sigma], float(what == "rate")))
    return out


def packed(rows):
    """As `Rows`."""
    columns = [np.array(c, dtype=float) for c in zip(*rows, strict=True)]
    names = ("t", "kind", "observer", "observer_velocity", "value", "sigma", "shared")
    return Rows(**dict(zip(names, columns, strict=True)))


def low(rng, heights=(300e3, 1500e3)):
    """A low orbit, and where it stands overhead at time zero."""
    x = orbit(rng, EARTH, RADIUS + rng.uniform(*heights), min(abs(rng.normal()) * 0.01, 0.015), rng.uniform(-1, 1))
    up = x[:3] / np.linalg.norm(x[:3])
    return x, np.arcsin(up[2]), np.arctan2(up[1], up[0])


def near(rng, latitude, longitude, spread):
    """A station near a place."""
    latitude, longitude = latitude + spread * rng.normal(), longitude + spread * rng.normal()
    return lambda t: station(latitude, longitude, t)


def radar_pass(rng):
    x, *under = low(rng)
    return x, seen(rng, x, near(rng, *under, 0.1), np.arange(-450.0, 450.0, 10.0), {"range": 20.0, "direction": 2e-3}), 0.0


def two_optical_passes(rng):
    """Three minutes each, the second a revolution later."""
    x, *under = low(rng, (500e3, 1500e3))
    P = 2 * np.pi * np.sqrt((1 / (2 / np.linalg.norm(x[:3]) - x[3:] @ x[3:] / EARTH)) ** 3 / EARTH)
    here, there = near(rng, *under, 0.08), near(rng, under[0], under[1] - TURN * P, 0.08)
    rows = seen(rng, x, here, np.arange(-90.0, 90.0, 10.0), {"direction": 2e-5})
    return x, rows + seen(rng, x, there, P + np.arange(-90.0, 90.0, 10.0), {"direction": 2e-5}), 0.0


def geo_night(rng):
    x = orbit(rng, EARTH, 42164e3 + 3e4 * rng.normal(), 5e-4 * abs(rng.normal()), np.cos(0.05 * rng.normal()))
    longitude = np.arctan2(x[1], x[0]) + 0.5 * rng.normal()
    here = near(rng, rng.uniform(-0.8, 0.8), longitude, 0.0)
    return x, seen(rng, x, here, np.arange(0.0, 6 * 3600.0, 900.0), {"direction": 5e-6}, lowest=15.0), 0.0


def asteroid(rng):
    x = orbit(rng, SUN, rng.uniform(2.1, 3.3) * AU, rng.uniform(0, 0.25), np.cos(0.15 * rng.normal()))
    start = np.arctan2(x[1], x[0]) + 0.5 * rng.normal()

    def earth(t):
        a = start + 2 * np.pi * t / (365.25 * 86400)
        return AU * np.array([np.cos(a), np.sin(a), 0.0]), 29785.0 * np.array([-np.sin(a), np.cos(a), 0.0])

    t = np.concatenate([86400.0 * day + 1800.0 * np.arange(3) for day in (0, 3, 8)])
    return x, seen(rng, x, earth, t, {"direction": 2.4e-6}, mu=SUN, lowest=None), 0.0


def three_radars(rng):
    """Ranges only, over one revolution, of three radars far apart."""
    x, *_ = low(rng, (600e3, 1500e3))
    rows = []
    for at in rng.uniform(0, 6000.0, 3):
        up = propagate_kepler(x[:3], x[3:], EARTH, at)[0]
        under = np.arcsin(up[2] / np.linalg.norm(up)), np.arctan2(up[1], up[0]) - TURN * at
        rows += seen(rng, x, near(rng, *under, 0.05), np.arange(0.0, 6000.0, 20.0), {"range": 20.0})
    return x, rows, 0.0


def doppler(rng, known=False):
    """Two stations, two passes; the carrier is off by up to 5 kHz of 437 MHz."""
    x, *under = low(rng, (500e3, 1500e3))
    offset = 0.0 if known else rng.uniform(-1, 1) * 5e3 / 437e6 * LIGHT
    rows = []
    for _ in range(2):
        rows += seen(rng, x, near(rng, *under, 0.15), np.arange(-600.0, 7200.0, 20.0), {"rate": 7.0}, offset=offset)
    return x, rows, offset


def known_doppler(rng):
    return doppler(rng, known=True)


TRACKS = {f.__name__: f for f in (radar_pass, two_optical_passes, geo_night, asteroid, three_radars, known_doppler, doppler)}
OFFSET_SIGMA = {"doppler": 5e3 / 437e6 * LIGHT / np.sqrt(3)}


def track(kind, seed):
    """Truth, rows, offset: the first draw of this seed that gives enough rows."""
    rng = np.random.default_rng(seed)
    while True:
        x, rows, offset = TRACKS[kind](rng)
        if len(rows) >= (9 if kind == "asteroid" else 16):
            return x, packed(rows), offset


def solved(kind, seed):
    """The search, which mode holds the truth (None: no one), its squared distance from it."""
    x, rows, offset = track(kind, seed)
    region = ABOUT_SUN if kind == "asteroid" else ABOUT_EARTH
    search = two_body_modes(rows, region, offset_sigma=OFFSET_SIGMA.get(kind, 0.0))
    truth = np.concatenate([*propagate_kepler(x[:3], x[3:], region.mu, search.epoch), [offset]])
    squares = [float(np.sum((m.root @ (truth - np.append(m.state, m.offset))) ** 2)) for m in search.modes]
    found = next((k for k, s in enumerate(squares) if s < 60.0), None)
    return search, found, squares


if __name__ == "__main__":
    kind, count = sys.argv[1], int(sys.argv[2])
    missed, seconds, own, said, squares = [], [], [], [], []
    for seed in range(count):
        started, spent = time.perf_counter(), time.process_time()
        search, found, off = solved(kind, seed)
        seconds.append(time.perf_counter() - started)
        own.append(time.process_time() - spent)
        if found is None:
            missed.append(seed)
        said += [(m.probability, k == found) for k, m in enumerate(search.modes) if m.probability > 1e-3]
        squares += [] if found is None else [off[found]]
    print(f"{kind}: found {count - len(missed)} of {count}, missed {missed}")
    print(f"  median {np.median(seconds):.2f} s with simulation, {np.median(own):.2f} s of a processor")
    print(f"  mean squared distance from the truth {np.mean(squares):.2f} (6 or 7 is right), median {np.median(squares):.2f}")
    said = np.array(said)
    for low_end, high_end in ((0, 0.05), (0.05, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)):
        of = said[(said[:, 0] >= low_end) & (said[:, 0] < high_end)]
        if len(of):
            mean, true = of.mean(axis=0)
            print(f"  said {low_end:.2f} to {high_end:.2f}: {len(of)} modes, mean said {mean:.3f}, true {true:.3f}")
