"""Fits that heed the flattening of the Earth: the motion keeps what it must, and laser passes are found by it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import POSITION, Setting
from piazzi.orbit.modes import oblate_modes, two_body_modes
from piazzi.orbit.oblate import displaced, oblate_fits
from tests.references.tracks import ABOUT_EARTH, EARTH, LIGHT, RADIUS, TURN, near, orbit, packed

SIGMA = 1.0  # m: light takes a moment in which the flattening moves it by centimetres
FLAT = replace(ABOUT_EARTH, bulge=1.0826e-3 * RADIUS**2)


def moved(x, t):
    """States (K, 6) at times about the flattened Earth."""
    r, v = propagate_kepler(x[:3], x[3:], EARTH, t)
    return np.hstack([r, v]) + displaced(x[None], t, FLAT)[0]


def energy(x, bulge):
    """With the potential of the flattening, whose derivative is nowhere written here."""
    r = np.linalg.norm(x[:, :3], axis=1)
    return 0.5 * np.sum(x[:, 3:] ** 2, axis=1) - EARTH / r * (1.0 + 0.5 * bulge / r**2 * (1.0 - 3.0 * (x[:, 2] / r) ** 2))


def test_energy_and_the_momentum_about_the_axis_are_kept():
    t = np.sort(np.random.default_rng(1).uniform(-5000.0, 9000.0, 60))
    x = orbit(np.random.default_rng(2), EARTH, 7.6e6, 0.05, 0.3)
    path = moved(x, t)
    whole, spin = energy(path, FLAT.bulge), path[:, 0] * path[:, 4] - path[:, 1] * path[:, 3]
    without = np.hstack(propagate_kepler(x[:3], x[3:], EARTH, t))
    assert np.ptp(whole) < 2e-3 * np.ptp(energy(without, FLAT.bulge))
    assert np.ptp(spin) < 1e-6 * spin[0]
    assert_allclose(path[:, 3:], 0.5 * (moved(x, t + 1.0) - moved(x, t - 1.0))[:, :3], rtol=0, atol=0.01)


def passes(seed, count, each, every, observers):
    """Ranges of so many passes of a satellite like LAGEOS, good to a metre, with its state at time zero."""
    rng = np.random.default_rng(seed)
    x = orbit(rng, EARTH, 12.2e6, 0.01, 0.6)
    rows = []
    for k in range(count):
        t = k * 5400.0 + every * np.arange(each)
        up = moved(x, t[each // 2 :][:1])[0]
        here = near(rng, np.arcsin(up[2] / np.linalg.norm(up[:3])), np.arctan2(up[1], up[0]) - TURN * t[each // 2], observers)
        place, moves = (np.array(v) for v in zip(*map(here, t), strict=True))
        rho = np.zeros(each)
        for _ in range(3):
            rho = np.linalg.norm(moved(x, t - rho / LIGHT)[:, :3] - place, axis=1)
        noisy = rho + SIGMA * rng.normal(size=each)
        values = [[r, 0.0, 0.0] for r in noisy]
        rows += [(at, 1, p, v, z, [SIGMA, SIGMA], 0.0) for at, p, v, z in zip(t, place, moves, values, strict=True)]
    return x, packed(rows)


def test_fixes_are_fitted_to_their_sigma_where_two_body_motion_is_kilometres_off():
    x, rows = passes(3, 1, 3, 120.0, 0.2)
    t = np.linspace(-3000.0, 3000.0, 20)
    noise = np.random.default_rng(4).normal(size=(20, 3))
    blank = np.zeros((20, 3))
    fixes = replace(
        rows, t=t, kind=np.full(20, float(POSITION)), observer=blank, observer_velocity=blank, shared=np.zeros(20),
        value=moved(x, t)[:, :3] + noise, sigma=np.ones((20, 2)),
    )  # fmt: skip
    start = x[None] + np.array([3e3, -2e3, 1e3, 1.0, -2.0, 1.0])
    found = oblate_fits(fixes, start, Setting(EARTH, 0.0), FLAT)
    off = found.root[0, :6, :6] @ (found.state[0] - x)
    assert off @ off < 30.0 and found.square[0] < 100.0
    assert oblate_fits(fixes, start, Setting(EARTH, 0.0), ABOUT_EARTH).square[0] > 1e4  # of a round one


@pytest.mark.slow
def test_passes_of_a_laser_give_their_orbit():
    """Three passes within a turn, of twenty minutes each: the best that is found is within its sigmas."""
    x, rows = passes(5, 3, 9, 120.0, 0.3)
    found = oblate_modes(rows, two_body_modes(rows, FLAT), FLAT)
    best = found.modes[0]
    truth = moved(x, np.array([found.epoch]))[0]
    off = best.root[:6, :6] @ (best.state - truth)
    assert off @ off < 60.0
    assert_allclose(best.probability, 1.0)
