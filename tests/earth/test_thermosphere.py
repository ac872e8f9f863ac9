"""Density by NRLMSIS as a table about an arc: against the model itself, with space weather from a file."""

import sys

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth.thermosphere import REMAKE

pymsis = pytest.importorskip("pymsis")
EPOCH = pz.Epoch("2015-03-17T04:00:00 UTC")
HEADER = (
    "DATE,BSRN,ND,KP1,KP2,KP3,KP4,KP5,KP6,KP7,KP8,KP_SUM,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,CP,C9,ISN,F10.7_OBS,"
    "F10.7_ADJ,F10.7_DATA_TYPE,F10.7_OBS_CENTER81,F10.7_OBS_LAST81,F10.7_ADJ_CENTER81,F10.7_ADJ_LAST81"
)
AP = {14: [4] * 8, 15: [6] * 8, 16: [9] * 8, 17: [15, 27, 80, 94, 111, 132, 179, 154], 18: [67, 48, 39, 56, 39, 32, 27, 48]}
X = np.array([6.62e6, 0.9e6, 1.1e6, -1505.0, 2264.0, 7204.0])  # 390 to 500 km


@pytest.fixture
def weather(tmp_path):
    """A storm, as rows of SW-All.csv."""
    rows = [HEADER]
    for day in range(10, 22):
        ap = AP.get(day, [5] * 8)
        flux = 113 + day % 5
        cells = [f"2015-03-{day}", "2477", "1", *["20"] * 8, "160", *map(str, ap), f"{np.mean(ap):.0f}", "0.5", "2", "60"]
        rows.append(",".join([*cells, str(flux), str(flux), "OBS", "126.0", "125.0", "126.0", "125.0"]))
    path = tmp_path / "SW-All.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def density(weather, position, epoch):
    """The model called directly, at a place on the axes of the GCRF."""
    i = earth.read_space_weather(weather).at(epoch)
    fixed = earth.transform(position, None, "GCRF", "ITRF", epoch)[0]
    latitude, longitude, height = earth.position_to_geodetic(fixed)
    when = np.datetime64(epoch.to("UTC", digits=3).removesuffix(" UTC"))
    out = pymsis.calculate(
        [when], [np.degrees(longitude)], [np.degrees(latitude)], [height / 1e3], [i.f107], [i.f107_average], [i.ap],
        version=2.1, geomagnetic_activity=-1,
    )  # fmt: skip
    return float(np.ravel(out)[0]), float(height)


def test_the_table_is_the_model_about_its_arc(weather):
    """Over hours of a storm, at the arc and to three scale heights beside it; the gradient by differences of the model."""
    air = earth.Thermosphere(EPOCH, X, weather)
    two_bodies = [pz.propagate_kepler(X[:3], X[3:], 3.986004415e14, t)[0] for t in (100.0, 4000.0, 9000.0)]
    for t, place in zip((100.0, 4000.0, 9000.0), two_bodies, strict=True):
        for beside in (0.0, -60e3, 40e3, 120e3):
            there = place * (1 + beside / np.linalg.norm(place))
            expected, height = density(weather, there, EPOCH + t)
            *powers, arc_height, reach = air.value(t)
            got = np.exp(np.polyval(powers[::-1], (height - arc_height) / reach))
            assert got == pytest.approx(expected, rel=0.03)  # 20 km along the track, of two bodies, among it
    t = 100.0
    *powers, arc_height, reach = air.value(t)
    up = [density(weather, two_bodies[0] * (1 + d / 7e6), EPOCH + t) for d in (-2e3, 2e3)]
    slope = (np.log(up[1][0]) - np.log(up[0][0])) / (up[1][1] - up[0][1])
    own = np.polyval(np.polyder(powers[::-1]), (np.mean([up[0][1], up[1][1]]) - arc_height) / reach) / reach
    assert own == pytest.approx(slope, rel=0.02)


def test_between_nodes_the_table_is_the_model_too(weather):
    air = earth.Thermosphere(EPOCH, X, weather)
    times = np.random.default_rng(5).uniform(0.0, 40000.0, 40)
    direct = air.at([EPOCH + float(t) for t in times])
    table = np.array([air.value(t) for t in times])
    np.testing.assert_allclose(table[:, 0], direct[:, 0], atol=2e-3)  # of the logarithm


def test_drag_by_the_table(weather, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    forces = earth.Forces(degree=2, bodies=(), tides=(), relativity=False, drag="msis")
    p = pz.Problem(
        forces.model(), pz.Gaussian(X, [1.0] * 6), parameters={**forces.values, "cd_a_m": 0.01},
        functions=forces.functions(EPOCH, air=earth.Thermosphere(EPOCH, X, weather)), epoch=EPOCH, prior_time=0.0,
    )  # fmt: skip
    from dataclasses import replace

    off = replace(p, parameters={**p.parameters, "drag_on": 0.0})
    got = (p.dynamics(X, 0.0) - off.dynamics(X, 0.0))[3:]
    wind = X[3:] - np.cross(earth.rotation("ITRF", "GCRF", EPOCH) @ [0, 0, 7.292115e-5], X[:3])
    expected = -0.5 * 0.01 * density(weather, X[:3], EPOCH)[0] * np.linalg.norm(wind) * wind
    np.testing.assert_allclose(got, expected, rtol=0.02)
    F = p.dynamics_jacobian(X, 0.0)[3:, :3] - off.dynamics_jacobian(X, 0.0)[3:, :3]
    for i, e in enumerate(np.eye(3)):
        beside = [X + step * np.append(e, [0, 0, 0]) for step in (500.0, -500.0)]
        d = [(p.dynamics(x, 0.0) - off.dynamics(x, 0.0))[3:] for x in beside]
        np.testing.assert_allclose(F[:, i], (d[0] - d[1]) / 1000.0, atol=1e-3 * np.abs(F).max())


def test_how_far_an_orbit_may_leave_the_arc(weather):
    air = earth.Thermosphere(EPOCH, X, weather)
    assert abs(air.left(0.0, X[:3])) < 1e-3
    assert air.left(0.0, X[:3] * 1.002) > REMAKE  # 14 km


def test_what_is_missing_is_said(weather, monkeypatch):
    with pytest.raises(ValueError, match=r"drag 'msis' needs air=earth\.Thermosphere"):
        earth.Forces(drag="msis").functions(EPOCH)
    with pytest.raises(ValueError, match="must be x, y, z, vx, vy, vz at the epoch"):
        earth.Thermosphere(EPOCH, X[:3], weather)
    with pytest.raises(ValueError, match="the arc of the thermosphere comes down to"):
        earth.Thermosphere(EPOCH, [*X[:3], -1400.0, 2100.0, 6700.0], weather).value(0.0)
    with pytest.raises(ValueError, match=r"SW-All\.csv has space weather from 2015-03-13 to 2015-03-21, not for 2016"):
        earth.Thermosphere(pz.Epoch("2016-01-01 UTC"), X, weather).value(0.0)
    monkeypatch.setitem(sys.modules, "pymsis", None)
    with pytest.raises(ValueError, match=r"pip install 'piazzi\[msis\]'"):
        earth.Thermosphere(EPOCH, X + 1.0, weather).value(0.0)


SCENARIO = """
epoch = "2015-03-17T03:30:00 UTC"
[earth]
degree = 2
drag = "msis"
weather = "{weather}"
[parameters]
cd_a_m = 0.01
[sensors.position.components]
px = "x"
[[stations]]
name = "fixes"
noise = {{ sigma = 1.0 }}
[prior]
mean = {mean}
sigma = [10.0, 10.0, 10.0, 0.01, 0.01, 0.01]
time = 1800.0
[times]
start = 1800.0
step = 60.0
count = 3
[truth.earth]
drag = "harris-priester"
"""


@pytest.mark.slow
def test_a_scenario_names_its_space_weather(weather, tmp_path, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    path = tmp_path / "storm.toml"
    path.write_text(SCENARIO.format(weather=weather.name, mean=X.tolist()))
    problem, _ = pz.load(path)
    air = earth.Thermosphere(EPOCH, X, weather)  # the same arc, from an epoch half an hour later
    np.testing.assert_allclose(problem.functions["air"].value(2000.0), air.value(200.0), rtol=1e-3)
    assert "air" in problem.truth.functions
    path.write_text(SCENARIO.format(weather="nowhere.csv", mean=X.tolist()))
    with pytest.raises(ValueError, match=r"earth\.weather: .*nowhere.csv: No such file"):
        pz.load(path)


def test_space_weather_is_looked_for_where_data_are(weather, tmp_path, monkeypatch):
    choice = earth.read_forces("degree=2 drag=msis", 4e5)
    monkeypatch.setenv("PIAZZI_EARTH", str(tmp_path))
    np.testing.assert_array_equal(choice.air(EPOCH, X).value(0.0), earth.Thermosphere(EPOCH, X, weather).value(0.0))
    monkeypatch.setenv("PIAZZI_EARTH", str(tmp_path / "empty"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "empty"))
    with pytest.raises(ValueError, match="drag 'msis' needs space weather: give weather=FILE, or get it by: piazzi data get"):
        choice.air(EPOCH, X)
    assert earth.read_forces("degree=2", 4e5).air(EPOCH, X) is None
