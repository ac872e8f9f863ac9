"""Roots in dynamics, steps and rules; roots that are not found; light time and averaged Doppler against 50 digits."""

import copy
import dataclasses

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.estimate.registry import parse
from piazzi.scenarios.loader import load_scenario
from piazzi.scenarios.table import ScenarioError

KEPLER = {"E": {"root": "E - e*sin(E) - M", "start": "M", "iterations": 8}}


def solved(M, e):
    E = mp.findroot(lambda E: E - e * mp.sin(E) - M, M)
    return float(E)


def problem(**changes):
    model = pz.Model(
        ["M", "x"],
        ["n", "cos(E) - x"],
        [pz.Sensor("s", {"seen": "sin(E) + far"}, visible=["cos(E) + 0.2"])],
        ["n", "e"],
        definitions={"far": "cos(E)**2"},
        roots=KEPLER,
    )
    given = {"truth": pz.Truth(accept=["E - 1.6"])} | changes
    prior, numbers = pz.Gaussian([1.0, 0.2], [1e-2] * 2), {"n": 0.3, "e": 0.6}
    return pz.Problem(model, prior, [0, 1e-6], pz.Station("s", "s", 1e-4), numbers, **given)


def differences(f, x, h=1e-6):
    return np.stack([(f(x + h * e) - f(x - h * e)) / (2 * h) for e in np.eye(len(x))], axis=-1)


def test_a_root_drives_dynamics_and_is_a_name_for_sensors_and_rules():
    p, x = problem(), np.array([1.1, 0.2])
    E = solved(1.1, 0.6)
    assert_allclose(p.dynamics(x), [0.3, np.cos(E) - 0.2], rtol=1e-14)
    assert_allclose(p.dynamics_jacobian(x), differences(p.dynamics, x), atol=1e-9)
    assert_allclose(p.measure("s", x), [np.sin(E) + np.cos(E) ** 2], rtol=1e-14)
    assert_allclose(p.measurement_jacobian("s", x), differences(lambda x: p.measure("s", x), x), atol=1e-9)
    tracking = pz.simulate(p, np.arange(0.0, 2.0, 0.1), np.random.default_rng(0))
    E_of = np.array([solved(M, 0.6) for M in tracking.truth[:, 0]])
    assert E_of[0] > 1.6
    assert (np.cos(E_of) > -0.2).all() and 0 < len(tracking.times) < 20  # the others nobody sees
    assert pz.FactorGraph().estimate(p, tracking).success


def test_a_root_drives_a_step():
    model = pz.Model(["x"], ["y"], [pz.Sensor("s", ["x"])], roots={"y": {"root": "y + 0.1*dt*y**3 - x"}}, discrete=True)
    p = pz.Problem(model, pz.Gaussian([1.0], [0.1]), stations=pz.Station("s", "s", 0.1))
    y = float(mp.findroot(lambda y: y + mp.mpf("0.05") * y**3 - 1, 1))
    nxt, Phi = p.step(np.array([1.0]), 0.5)
    assert_allclose(nxt, [y], rtol=1e-14)
    assert_allclose(Phi, [[1 / (1 + 0.15 * y**2)]], rtol=1e-14)


def test_roots_are_in_lanes_what_they_are_alone():
    p = problem(truth=None)
    tracking = pz.simulate(p, np.arange(0.0, 1.0, 0.1), np.random.default_rng(0))
    ukf, graph = pz.UnscentedKalmanFilter().estimate(p, tracking), pz.FactorGraph().estimate(p, tracking)
    assert ukf.success and graph.success
    assert_allclose(ukf.mean[-1], graph.mean[-1], atol=0.1)


TEXT = """
states = ["M", "x"]
[roots.E]
root = "rest"
start = "M"
iterations = 8
[roots.E.definitions]
rest = "E - 0.6*sin(E) - M"
[dynamics]
M = "0.3"
x = "cos(E) - x"
[sensors.s]
visible = ["E"]
[sensors.s.components]
seen = "sin(E)"
[[stations]]
name = "s"
sensor = "s"
noise = { sigma = 0.01 }
[prior]
mean = [1.0, 0.2]
sigma = [0.1, 0.1]
[times]
step = 0.1
count = 10
"""


def test_scenarios_and_recordings_keep_roots_of_the_dynamics(tmp_path):
    from piazzi.io.files import save

    file = tmp_path / "s.toml"
    file.write_text(TEXT)
    p = load_scenario(file).problem
    assert_allclose(p.dynamics([1.1, 0.2])[1], np.cos(solved(1.1, 0.6)) - 0.2, rtol=1e-13)
    tracking = pz.simulate(p, np.arange(0.0, 1.0, 0.1), np.random.default_rng(0))
    save(tmp_path / "r.nc", p, tracking)
    assert pz.load(tmp_path / "r.nc")[0].model == p.model


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("E - 0.6*sin(E) - M", "E - 0.6*sin(E) - N", r"roots\.E\.definitions\.rest.*unknown name 'N'"),
        ('root = "rest"', "", r"roots\.E.*is missing"),
        ("[roots.E.definitions]", '[roots.E.definitions]\nM = "E"', r"roots\.E\.definitions\.M.*also a state"),
        ("E - 0.6*sin(E) - M", "at(-E)", "'at'"),
        ('root = "rest"', 'root = "M - 1"', "definition 'rest' is used|does not depend|.*"),
    ],
)
def test_faults_have_their_place(tmp_path, old, new, message):
    file = tmp_path / "s.toml"
    file.write_text(TEXT.replace(old, new))
    with pytest.raises((ScenarioError, ValueError), match=message):
        load_scenario(file).problem.dynamics([1.0, 0.2])


# ---- roots that are not found -----------------------------------------------------------------------------------------


def lossy(iterations=4, sensor_root="tau**2 + 1 - x**2", start="1"):
    """tau = sqrt(x^2 - 1), which is there only while x is above 1; the state falls through it."""
    root = {"tau": {"root": sensor_root, "start": start, "iterations": iterations}}
    sensors = [pz.Sensor("good", ["x"]), pz.Sensor("delay", ["tau"], roots=root)]
    model = pz.Model(["x"], ["-0.5"], sensors)
    stations = [pz.Station("ruler", "good", 1e-2), pz.Station("mast", "delay", 1e-2)]
    return pz.Problem(model, pz.Gaussian([2.0], [1e-2]), [1e-6], stations)


LOST = "root 'tau' of station 'mast' has no solution at t = "
SESSIONS = ["ekf", "ekf:joint", "ekf:gate", "srekf", "srekf:gate", "iekf", "iekf:3:gate", "ukf", "ukf:gate"]
SESSIONS += ["window:5", "window:5x3", "window:5:huber", "window:5:tukey"]


def falling():
    """Time, station and value of what is measured of a state that falls through the root."""
    for t in np.arange(0.0, 3.0, 0.25):
        x = 2.0 - 0.5 * float(t)
        yield float(t), "ruler", x
        yield float(t), "mast", np.sqrt(max(x**2 - 1.0, 0.25))


def check_message(found):
    assert not found.success
    assert found.message.count(LOST) >= 1 and "\n" not in found.message


@pytest.mark.parametrize("text", [*SESSIONS, "smoother", "graph", "graph:huber", "graph:tukey", "graph:bank=8", "batch"])
def test_the_message_of_every_estimator_names_the_root_and_the_station(text, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    times, stations, values = zip(*falling(), strict=True)
    found = parse(text).estimate(lossy(8), pz.Tracking(times, np.array(values)[:, None], stations))
    check_message(found)
    if found.delayed is not None:
        check_message(found.delayed)


@pytest.mark.slow
@pytest.mark.parametrize("text", ["ekf", "ekf:gate", "iekf:3:gate", "srekf:gate", "smoother", "graph"])
def test_so_does_that_of_compiled_ones(text):
    times, stations, values = zip(*falling(), strict=True)
    check_message(parse(text).estimate(lossy(8), pz.Tracking(times, np.array(values)[:, None], stations)))


@pytest.mark.parametrize("text", SESSIONS)
def test_a_session_names_them_too(text, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    live = parse(text).start(lossy(8))
    for t, station, value in falling():
        live.update(station, value, t)
    check_message(live)
    assert copy.copy(live).message == live.message


def test_nothing_is_simulated_where_a_root_is_lost(monkeypatch, tmp_path):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    p, times = lossy(8), np.arange(0.0, 3.0, 0.25)
    with pytest.raises(ValueError, match="nothing can be simulated: root 'tau' of station 'mast' has no solution at t = "):
        pz.simulate(p, times, np.random.default_rng(0))
    found = pz.Study(p, times, ["ekf", "smoother"], runs=2).run(tmp_path / "s.nc", workers=1)
    assert not any(found.row(0, row).success.any() for row in range(len(found.rows)))
    assert all(LOST in text for *_, text in found.about["messages"])
    assert pz.simulate(p, times, np.random.default_rng(0), stations=["ruler"]).values.shape == (12, 1)


def test_a_root_behind_the_horizon_is_not_asked_for(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    p = lossy(8)
    good, delay = p.model.sensors
    model = dataclasses.replace(p.model, sensors=(good, dataclasses.replace(delay, visible=("x - 1.1",))))
    tracking = pz.simulate(dataclasses.replace(p, model=model), np.arange(0.0, 3.0, 0.25), np.random.default_rng(0))
    assert 0 < (tracking.row_stations == "mast").sum() < 12 and not np.isnan(tracking.values).any()


@pytest.mark.parametrize("text", ["ekf:gate", "iekf:3:gate", "srekf:gate", "ukf:gate"])
def test_a_gate_still_rejects_what_is_merely_far_away(text, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    p = lossy(8)
    tracking = pz.Tracking([0.0, 0.0, 0.1], [[2.0], [1e10], [1.95]], ["ruler", "mast", "ruler"])
    found = parse(text).estimate(p, tracking)
    assert found.success and found.details["rejected"].tolist() == [False, True, False]


def test_a_root_is_no_number_where_its_residual_is_too_large():
    """Of three iterations the residual is a thousandth, of six it is rounding."""
    x = np.array([2.0])
    assert np.isnan(lossy(3).measure("mast", x)).all() and not np.isnan(lossy(3).measurement_jacobian("mast", x)).all()
    assert_allclose(lossy(6).measure("mast", x), [np.sqrt(3.0)], rtol=1e-15)
    slow = lossy(20, "(tau - x)**2", "x + 1")  # a double root: each iteration only halves the distance
    assert np.isnan(slow.measure("mast", x)).all()


def test_names_of_a_root_that_is_not_found_are_no_numbers_either():
    root = {"tau": {"root": "half**2 + 1", "start": "1", "iterations": 8, "definitions": {"half": "tau/2"}}}
    model = pz.Model(["x"], ["0"], [pz.Sensor("s", {"a": "half", "b": "x"}, roots=root)])
    with pytest.raises(ValueError, match="root 'tau' of station 's' has no solution at the prior mean"):
        pz.Problem(model, pz.Gaussian([1.0], [1.0]), stations=pz.Station("s", "s", [1.0, 1.0]))
    root["tau"]["root"] = "half**2 + x"  # real for x below zero
    model = pz.Model(["x"], ["0"], [pz.Sensor("s", {"a": "half", "b": "x"}, roots=root)])
    p = pz.Problem(model, pz.Gaussian([-1.0], [1.0]), stations=pz.Station("s", "s", [1.0, 1.0]))
    seen = p.measure("s", [[-0.8], [0.8]])
    assert np.isfinite(seen[0]).all() and np.isnan(seen[1, 0]) and seen[1, 1] == 0.8


# ---- 50 digits ----------------------------------------------------------------------------------------------------------

C, MU, SPIN, RADIUS = 299792458.0, 3.986004415e14, 7.292115e-5, 6378137.0
LATITUDE, LONGITUDE, COUNT = 0.7, 0.3, 60.0
STATES = ["x", "y", "z", "vx", "vy", "vz"]


def place(name, t):
    """Definitions of where the station is at an instant."""
    angle = f"{LONGITUDE} + {SPIN}*({t})"
    cos, sin = float(RADIUS * np.cos(LATITUDE)), float(RADIUS * np.sin(LATITUDE))
    return {f"{name}x": f"{cos!r}*cos({angle})", f"{name}y": f"{cos!r}*sin({angle})", f"{name}z": f"{sin!r}"}


def distance(a, b):
    return "sqrt(" + " + ".join(f"({a}{c} - {b}{c})**2" for c in "xyz") + ")"


def leg(root, offset, received, name):
    """The leg down, of a signal that is received at t + offset."""
    own = {f"r{name}x, r{name}y, r{name}z": f"at({offset} - {root})", **place(f"q{name}", received)}
    return {root: {"root": f"rho{name}/{C} - {root}", "definitions": {**own, f"rho{name}": distance(f"r{name}", f"q{name}")}}}


def low_orbit():
    up = {"up": {"root": f"there/{C} - up", "definitions": {**place("u", "t - down - up"), "there": distance("rd", "u")}}}
    two_way = pz.Sensor("two_way", {"range": f"{C}*(up + down)/2"}, roots={**leg("down", "0", "t", "d"), **up})
    averaged = pz.Sensor(
        "doppler",
        {"rate": f"{C}*(late - early)/{COUNT}"},
        roots={**leg("late", "0", "t", "a"), **leg("early", f"(-{COUNT})", f"t - {COUNT}", "b")},
    )
    r = "(x**2 + y**2 + z**2)"
    model = pz.Model(
        STATES, ["vx", "vy", "vz", *(f"-{MU}*{c}/({r}*sqrt({r}))" for c in "xyz")], [two_way, averaged]
    )  # fmt: skip
    stations = [pz.Station("two_way", "two_way", 1.0), pz.Station("doppler", "doppler", 1e-6)]
    return pz.Problem(model, pz.Gaussian(X, [1e4] * 3 + [1.0] * 3), stations=stations)


X, T = np.array([5.2e6, 2.1e6, 4.1e6, -4.9e3, 2.4e3, 5.0e3]), 1234.5


def exact(x, t):
    """Two-way range and averaged rate in 50 digits, on the Kepler orbit through `x` at `t`, by universal variables."""
    r0, v0 = mp.matrix(list(map(mp.mpf, x[:3]))), mp.matrix(list(map(mp.mpf, x[3:])))
    mu, size = mp.mpf(MU), mp.norm(r0)
    alpha = 2 / size - mp.norm(v0) ** 2 / mu
    dot = (r0.T * v0)[0] / mp.sqrt(mu)

    def at(dt):
        def kepler(chi):
            z = alpha * chi**2
            c, s = (1 - mp.cos(mp.sqrt(z))) / z, (mp.sqrt(z) - mp.sin(mp.sqrt(z))) / mp.sqrt(z) ** 3
            return dot * chi**2 * c + (1 - alpha * size) * chi**3 * s + size * chi, c, s

        guess = mp.sqrt(mu) * dt / size
        chi = mp.findroot(lambda chi: kepler(chi)[0] - mp.sqrt(mu) * dt, (guess, guess * mp.mpf("0.99")), solver="secant")
        _, c, s = kepler(chi)
        return (1 - chi**2 / size * c) * r0 + (dt - chi**3 / mp.sqrt(mu) * s) * v0

    def station(t):
        angle = mp.mpf(LONGITUDE) + mp.mpf(SPIN) * t
        cos, sin = mp.mpf(RADIUS * np.cos(LATITUDE)), mp.mpf(RADIUS * np.sin(LATITUDE))
        return mp.matrix([cos * mp.cos(angle), cos * mp.sin(angle), sin])

    def fixed_point(f):
        tau = mp.mpf("0.003")
        for _ in range(14):
            tau = f(tau) / C
        return tau

    t = mp.mpf(t)
    down = fixed_point(lambda tau: mp.norm(at(-tau) - station(t)))
    early = fixed_point(lambda tau: mp.norm(at(-COUNT - tau) - station(t - COUNT)))
    bounce = at(-down)
    up = fixed_point(lambda tau: mp.norm(bounce - station(t - down - tau)))
    return C * (up + down) / 2, C * (down - early) / COUNT


def test_two_way_range_and_averaged_doppler_are_those_of_fifty_digits():
    p = low_orbit()
    with mp.workdps(50):
        distance, rate = map(float, exact(X, T))
    assert 1e5 < distance < 1e7 and abs(rate) > 100.0
    assert_allclose(p.measure("two_way", X, T)[0], distance, atol=2e-8)  # 1e-8 m are a few units of 7e6 m
    assert_allclose(p.measure("doppler", X, T)[0], rate, atol=2e-9)  # the same over a minute


@pytest.mark.parametrize(("station", "which"), [("two_way", 0), ("doppler", 1)])
def test_their_partials_are_differences_of_fifty_digits(station, which):
    p = low_orbit()
    H = p.measurement_jacobian(station, X, T)[0]
    with mp.workdps(50):
        for j in range(6):
            h = mp.mpf(10) ** -12
            ends = [exact([mp.mpf(v) + s * h * (i == j) for i, v in enumerate(X.tolist())], T)[which] for s in (1, -1)]
            assert_allclose(H[j], float((ends[0] - ends[1]) / (2 * h)), rtol=1e-10, atol=1e-12)
