"""Pseudoranges from navigation satellites, and ranges between two satellites, against repetition along propagated orbits."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from tests.references.signals import EPOCH, C, T, Trajectory, light_time, orbit, problem, slopes

FORCES = earth.Forces(degree=4, radiation="cannonball")


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def circle(t):
    """A navigation satellite."""
    n, r = 2 * np.pi / 43082.0, 2.656e7
    a = n * np.asarray(t) + 0.4
    zero = 0.0 * a
    p = r * np.stack([np.cos(a), np.sin(a), zero + 0.3], -1)
    return np.concatenate([p, n * r * np.stack([-np.sin(a), np.cos(a), zero], -1)], -1)


def test_pseudorange_is_the_way_from_where_the_signal_was_sent_and_both_clocks():
    times = np.arange(-7200.0, 7200.0, 60.0)
    sensor = sensors.pseudorange()
    clocks = {name: pz.Gaussian(mean, sigma**2) for name, (mean, sigma) in dict(sensor.priors).items()}
    numbers = {"emitter_clock": 12.0, "emitter_clock_rate": 0.01, "pseudorange_bias": 3.0}
    p = problem(sensor, parameters=clocks, place=pz.Table(times, circle(times)), numbers=numbers)
    x = orbit("LEO")
    tau, _ = light_time(lambda d: circle(T + d), x, -1)
    y = np.r_[x, 500.0, -0.2]
    assert p.model.names[6:] == ("clock", "clock_rate")
    expected = C * tau + 500.0 - 0.2 * T - 12.0 - 0.01 * T + 3.0
    assert p.measure("pseudorange", y, T)[0] == pytest.approx(expected, abs=1e-6)
    H = p.measurement_jacobian("pseudorange", y, T)
    D = slopes(lambda v: p.measure("pseudorange", np.r_[v, y[6:]], T), x)
    np.testing.assert_allclose(H[:, :6], D, atol=1e-7)
    np.testing.assert_array_equal(H[0, 6:], [1.0, T])


def pair(*given):
    model = sensors.two_satellites(FORCES, given, {"cr_a_m": "estimated", "cr_a_m2": "considered"}, own=("cr_a_m",))
    x = np.r_[orbit("LEO"), orbit("LEO") + np.array([0.0, 2e5, 1e5, 30.0, 0.0, -40.0])]
    stations = [pz.Station(**s.at(sigma=1.0)) for s in given]
    values = {**FORCES.values, "cr_a_m": pz.Gaussian(0.02, 1e-4), "cr_a_m2": pz.Gaussian(0.03, 1e-4)}
    functions = FORCES.functions(EPOCH)
    prior = pz.Gaussian(x, [1.0] * 12)
    return pz.Problem(model, prior, None, stations, values, prior_time=0.0, functions=functions, epoch=EPOCH), x


def test_two_satellites_move_as_each_alone():
    both, x = pair(sensors.satellite_range())
    f = both.dynamics(np.r_[x, 0.02], T)
    for start, cr in ((0, 0.02), (6, 0.03)):
        values = {**FORCES.values, "cr_a_m": cr}
        alone = pz.Problem(
            FORCES.model(), pz.Gaussian(x[:6], [1.0] * 6), None, (), values, functions=FORCES.functions(EPOCH), epoch=EPOCH
        )
        np.testing.assert_allclose(f[start : start + 6], alone.dynamics(x[start : start + 6], T), rtol=1e-13)


@pytest.mark.parametrize("path", ["one-way", "two-way"])
def test_range_between_two_satellites_is_that_of_light_times_by_repetition(path):
    p, x = pair(sensors.satellite_range(path))
    y = np.r_[x, 0.02]
    both = Trajectory(p, y)
    down, there = light_time(lambda d: both(T + d)[6:12], x[:6], -1)
    up, _ = light_time(lambda d: both(T - down + d)[:6], there, -1)
    expected = C * (down if path == "one-way" else (down + up) / 2)
    assert p.measure("satellite_range", y, T)[0] == pytest.approx(expected, abs=1e-6)
    H = p.measurement_jacobian("satellite_range", y, T)
    for start in (0, 6):

        def h(v, start=start):
            z = y.copy()
            z[start : start + 6] = v
            return p.measure("satellite_range", z, T)

        np.testing.assert_allclose(H[:, start : start + 6], slopes(h, x[start : start + 6]), atol=1e-7)
