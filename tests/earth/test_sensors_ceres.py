"""Sensors of a minor planet seen from the Earth, against light times by repetition along its propagated orbit about the Sun.

The Earth goes on straight here, so that its place at every event is known; light takes 22 minutes.
"""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from piazzi.outside.table import Table
from tests.references.signals import EPOCH, C, T, Trajectory, legs, slopes

CERES = np.array([-2.9e11, 2.5e11, 1.2e11, -1.15e4, -1.1e4, -3.4e3])  # m, m/s, ICRF, from the Sun
Q, V = np.array([-1.2e11, 8.0e10, 3.5e10]), np.array([-1.8e4, -2.2e4, -9.6e3])
FORCES = earth.Forces(about="sun", bodies=())
STEP = 100.0  # s, of the trajectory: a ten thousandth of a radian of its orbit


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def site(t):
    """Where the station is that all sensors are at."""
    return np.concatenate([Q + V * t, V])


def problem(*given):
    times = np.arange(-86400.0, 90000.0, 3600.0)
    place = Table(times, np.stack([site(t) for t in times]))
    functions = FORCES.functions(EPOCH)
    for sensor in given:
        functions |= sensor.functions(EPOCH)
    stations = [pz.Station(**(sensor.at(None, EPOCH, 1.0, name=sensor.name, place=place))) for sensor in given]
    return pz.Problem(
        FORCES.model(given), pz.Gaussian(CERES, [1.0] * 6), None, stations, FORCES.values, pz.RungeKutta8(3600.0),
        prior_time=0.0, functions=functions, epoch=EPOCH,
    )  # fmt: skip


@pytest.mark.parametrize("steps", [False, True])
@pytest.mark.parametrize("tag", ["reception", "bounce", "transmission"])
def test_ranges_are_those_of_light_times_by_repetition_to_a_metre(tag, steps):
    p = problem(*(sensors.range(path, name=path, tag=tag, steps=steps) for path in ("one-way", "two-way")))
    down, up, *_ = legs("two-way", tag, Trajectory(p, CERES, step=STEP), site, site)
    assert abs(p.measure("two-way", CERES, T)[0] - C * (down + up) / 2) < 1.0
    down, *_ = legs("one-way", tag, Trajectory(p, CERES, step=STEP), site, site)
    assert 2.9e11 > C * down > 1e11
    assert abs(p.measure("one-way", CERES, T)[0] - C * down) < 1.0
    H = p.measurement_jacobian("two-way", CERES, T)
    np.testing.assert_allclose(H, slopes(lambda y: p.measure("two-way", y, T), CERES), rtol=1e-6, atol=1e-6)


def test_directions_are_those_of_the_line_along_the_light():
    """To a metre across the line of sight."""
    p = problem(sensors.right_ascension_declination("geocentric"))
    down, _, rec, sat, _ = legs("one-way", "reception", Trajectory(p, CERES, step=STEP), site, site)
    line = sat[:3] - rec[:3]
    expected = np.array([np.arctan2(line[1], line[0]), np.arctan2(line[2], np.hypot(line[0], line[1]))])
    z = p.measure("right_ascension_declination", CERES, T)
    assert np.abs((z - expected) * [np.cos(z[1]), 1.0]).max() * C * down < 1.0


def test_rates_are_those_of_the_range():
    """Of both legs, to a micrometre a second and the last digits of a range."""
    p = problem(sensors.range_rate("two-way"), sensors.range("two-way", steps=True))
    h = 200.0

    def length(t):
        path = Trajectory(p, CERES, step=STEP)
        down, up, *_ = legs("two-way", "reception", path, site, site, T + t)
        return C * (down + up) / 2

    rate = (8 * (length(h) - length(-h)) - (length(2 * h) - length(-2 * h))) / (12 * h)
    assert p.measure("range_rate", CERES, T)[0] == pytest.approx(rate, abs=1e-3)
