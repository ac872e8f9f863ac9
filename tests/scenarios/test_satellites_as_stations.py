"""Scenarios in which satellites are what is measured to: pseudoranges, and ranges to an orbit that is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.earth.sensors.visibility import rule
from piazzi.orbit.orbit_place import OrbitPlace
from piazzi.scenarios import load_scenario

C = 299792458.0
GM = earth.gravity_field("EGM2008").gm
R_EARTH = 6378137.0
NAVIGATION = [(0, 10), (60, 80), (120, 150), (180, 220), (240, 290), (300, 360)]  # deg: node, anomaly
TEXT = """
epoch = "2024-03-10T00:00:00 UTC"
earth = {{ degree = 2, bodies = [], tides = [], relativity = false }}
times = {{ step = 60.0, count = 40 }}
integrator = {{ method = "rk8", max_step = 60.0 }}
[prior]
a = "7000 km"
e = 0.001
i = "98 deg"
raan = "20 deg"
argp = "0 deg"
nu = "0 deg"
time = 0.0
sigma = [100, 100, 100, 0.1, 0.1, 0.1]
[sensors.gps]
kind = "pseudorange"
[sensors.link]
kind = "range"
path = "one-way"
aboard = true
visible = ["clear"]
[parameters]
clock = {{ value = 0.0, sigma = 3e5, role = "estimated" }}
clock_rate = {{ value = 0.0, sigma = 3e2, role = "estimated" }}
"""
STATION = """
[[stations]]
name = "G{k}"
sensor = "{sensor}"
noise = {{ sigma = 3.0 }}
orbit = {{ a = "26560 km", e = 0.01, i = "55 deg", raan = "{node} deg", argp = "0 deg", M = "{anomaly} deg" }}
{numbers}
"""


def written(folder, sensor):
    numbers = "numbers = { emitter_clock = 100.0 }" if sensor == "gps" else ""
    stations = [STATION.format(k=k, sensor=sensor, node=n, anomaly=m, numbers=numbers) for k, (n, m) in enumerate(NAVIGATION)]
    other = "link" if sensor == "gps" else "gps"
    text = TEXT.format()
    a = text.index(f"[sensors.{other}]")
    b = text.find("[parameters]" if other == "link" else "[sensors", a + 1)
    text = text[:a] + text[b:]
    text = text if sensor == "gps" else text[: text.index("[parameters]")]
    (folder / "s.toml").write_text(text + "".join(stations))
    return folder / "s.toml"


def test_the_place_is_the_orbit_of_two_bodies_and_velocity_its_rate():
    epoch = pz.Epoch("2024-03-10T06:00:00 UTC")
    state = (7e6, 1e5, -2e5, 1e2, 5e3, 5.5e3)
    place = OrbitPlace(state, epoch, GM)
    for t in (0.0, 450.0, 4321.0, -7000.0):
        r, v = pz.propagate_kepler(np.array(state[:3]), np.array(state[3:]), GM, t)
        assert_allclose(place.value(t)[:3], r, rtol=0, atol=1e-6)
        assert_allclose(place.value(t)[3:], v, rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["gps", "link"])
def test_what_is_simulated_is_found_within_its_sigma(tmp_path, sensor):
    problem, tracking = pz.load(written(tmp_path, sensor), seed=3)
    z = tracking.values[:, 0]
    satellites = [str(name) for name in tracking.row_stations]
    assert {*satellites} <= {f"G{k}" for k in range(6)} and np.isfinite(z).sum() > 40
    places = {s.name: s.place for s in problem.stations}
    truth = dict(zip(tracking.times.tolist(), tracking.truth, strict=True))
    for t, name, value in zip(tracking.row_times.tolist(), satellites, z, strict=True):
        if not np.isfinite(value):
            continue
        x, tau = truth[t], 0.07
        for _ in range(4):
            far = np.array(places[name].value(t - tau)[:3])
            tau = np.linalg.norm(x[:3] - far) / C
        clock = x[6] + x[7] * t - 100.0 if sensor == "gps" else 0.0
        assert abs(value - (C * tau + clock)) < 5 * 3.0
        line = x[:3] - far  # nothing is measured through the Earth
        share = np.clip(-(far @ line) / (line @ line), 0.0, 1.0)
        assert np.linalg.norm(far + share * line) > R_EARTH - 100e3
    found = pz.FactorGraph().estimate(problem, tracking)
    assert found.success, found.message
    off = found.mean[-1] - tracking.truth[-1]
    scale = np.sqrt(np.diag(found.covariance[-1]))
    squared = (off / scale) @ np.linalg.solve(found.covariance[-1] / np.outer(scale, scale), off / scale)
    assert squared < 27.0  # 99.9 % of eight degrees of freedom are below 26.1
    (tmp_path / "again.toml").write_text(problem.to_toml())
    assert load_scenario(tmp_path / "again.toml").problem.checksums == problem.checksums


@pytest.mark.parametrize(
    ("near", "far", "clear"),
    [
        ((7e6, 0.0, 0.0), (4.2e7, 1e5, 0.0), True), ((4.2e7, 1e5, 0.0), (7e6, 0.0, 0.0), True),
        ((7e6, 0.0, 0.0), (-2.6e7, 1e5, 0.0), False), ((-2.6e7, 1e5, 0.0), (7e6, 0.0, 0.0), False),
        ((7e6, 0.0, 0.0), (0.0, 2.6e7, 0.0), True), ((6.4e6, -3e7, 0.0), (6.4e6, 3e7, 0.0), True),
    ],
)  # fmt: skip
def test_the_earth_is_between_two_satellites_only_where_it_is(near, far, clear):
    text, definitions, _ = rule("clear")
    known = dict(zip("xyz", near, strict=True)) | {f"now_place_{a}": value for a, value in zip("xyz", far, strict=True)}
    known |= {"sqrt": np.sqrt, "max": max}
    for name, one in definitions.items():
        if "," not in name:
            known[name] = eval(one, {}, known)
    assert (eval(text, {}, known) > 0) == clear


def test_elements_that_are_missing_are_named(tmp_path):
    path = written(tmp_path, "gps")
    path.write_text(path.read_text().replace(' raan = "60 deg",', ""))
    with pytest.raises(ValueError, match=r"stations\[1\].orbit.raan.*missing"):
        pz.load(path)
