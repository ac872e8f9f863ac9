"""Positions and velocities as they are fixed: along any axes, off the centre of mass, by clocks that are late."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from tests.references.signals import EPOCH, T, Trajectory, orbit, problem, slopes

ARM = np.array([1.5, -0.7, 0.4])


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def axes(x):
    """Rows R, T, N."""
    r, v = x[:3], x[3:]
    n = np.cross(r, v)
    return np.stack([a / np.linalg.norm(a) for a in (r, np.cross(n, r), n)])


def fixed(sensor, x, **numbers):
    p = problem(sensor, numbers=numbers)
    return p, p.measure("position", x, T)


def test_a_fix_on_the_axes_of_the_states_is_the_state():
    x = orbit("LEO")
    np.testing.assert_array_equal(fixed(sensors.position(velocity=True), x)[1], x)


@pytest.mark.parametrize("frame", ["ITRF", "EME2000", "TEME"])
def test_positions_and_velocities_are_turned_as_the_routines_turn_them(frame):
    x = orbit("LEO")
    p, z = fixed(sensors.position(frame=frame, velocity=True), x)
    r, v = earth.transform(x[:3], x[3:], "GCRF", frame, EPOCH + T)
    np.testing.assert_allclose(z[:3], r, atol=1e-4)
    np.testing.assert_allclose(z[3:], v, atol=1e-6)
    H = p.measurement_jacobian("position", x, T)
    np.testing.assert_allclose(H, slopes(lambda y: p.measure("position", y, T), x), atol=1e-9)


def test_an_antenna_stands_off_along_the_axes_of_the_orbit_and_turns_with_them():
    x = orbit("LEO")
    p, z = fixed(sensors.position(velocity=True, lever=True), x, lever_radial=1.5, lever_along=-0.7, lever_cross=0.4)
    np.testing.assert_allclose(z[:3], x[:3] + axes(x).T @ ARM, atol=1e-8)
    path, h = Trajectory(p, x), 1.0
    there = [(y := path(T + d))[:3] + axes(y).T @ ARM for d in (-h, h)]
    np.testing.assert_allclose(
        z[3:] - x[3:], (there[1] - there[0]) / (2 * h) - (path(T + h) - path(T - h))[:3] / (2 * h), atol=2e-6
    )
    H = p.measurement_jacobian("position", x, T)
    np.testing.assert_allclose(H, slopes(lambda y: p.measure("position", y, T), x), atol=1e-8)  # rounding over 0.2 m/s


def test_late_clocks_see_what_was():
    x = orbit("LEO")
    p, z = fixed(sensors.position(frame="ITRF", velocity=True, time_bias=True), x, time_bias=0.01, position_y_bias=2.0)
    then = Trajectory(p, x)(T - 0.01)
    r, v = earth.transform(then[:3], then[3:], "GCRF", "ITRF", EPOCH + (T - 0.01))
    np.testing.assert_allclose(z[:3], r + np.array([0.0, 2.0, 0.0]), atol=1e-4)
    np.testing.assert_allclose(z[3:], v, atol=2e-6)


def test_a_fix_takes_a_whole_covariance_and_a_bias_of_a_pass():
    sensor = sensors.position(biases=["day1"])
    R = np.diag([1.0, 2.0, 3.0]) + 0.1
    station = pz.Station(**sensor.at(name="day1", covariance=R))
    assert station.place is None and station.numbers["is_day1"] == 1.0
    np.testing.assert_array_equal(station.noise, R)
    assert sensor.parameters == dict.fromkeys(
        ("position_x_bias_day1", "position_y_bias_day1", "position_z_bias_day1"), "estimated"
    )
    with pytest.raises(ValueError, match="XYZ"):
        sensors.position(frame="XYZ")
