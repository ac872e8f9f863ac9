"""Priors of orbits: elements, other frames, files, and sigmas along axes of the orbit."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.formats import Arc
from piazzi.formats.write_odm import opm_text
from piazzi.scenarios import ScenarioError, load_scenario

EPOCH = pz.Epoch("2016-02-13T16:00:00 UTC")
GM = earth.gravity_field("EGM2008").gm
X = np.array([7000e3, 100e3, -50e3, 10.0, 5.0e3, 5.5e3])
FILE = """
epoch = "2016-02-13T16:00:00 UTC"
{units}
[earth]
degree = 2
{states}
[sensors.position.components]
px = {{ equation = "x", unit = "length" }}
[[stations]]
name = "fixes"
noise = {{ sigma = 1.0 }}
[prior]
{prior}
[times]
step = 60.0
count = 3
"""
SIGMA = "sigma = [10.0, 20.0, 30.0, 0.01, 0.02, 0.03]"


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def load(tmp_path, prior, units="", states=""):
    path = tmp_path / "mine.toml"
    path.write_text(FILE.format(prior=prior, units=units, states=states))
    return load_scenario(path).problem


@pytest.mark.parametrize(("word", "anomaly"), [("nu", "true"), ("E", "eccentric"), ("M", "mean")])
def test_elements(tmp_path, word, anomaly):
    problem = load(
        tmp_path,
        f'a = "7178 km"\ne = 0.01\ni = "98.6 deg"\n'
        f'raan = "110 deg"\nargp = "90 deg"\n{word} = "-80 deg"\n{SIGMA}\naxes = "RTN"',
    )
    r, v = pz.orbit.Keplerian(anomaly).to_state(np.array([7178e3, 0.01, *np.radians([98.6, 110.0, 90.0, -80.0])]), GM)
    np.testing.assert_allclose(problem.prior.mean, [*r, *v], rtol=1e-14)
    J = pz.orbit.state_axes(r, v, "RTN")
    P = np.diag([10.0, 20.0, 30.0, 0.01, 0.02, 0.03]) ** 2
    np.testing.assert_allclose(J @ problem.prior.covariance @ J.T, P, atol=1e-9)


def test_elements_in_the_units_of_the_file_and_further_states(tmp_path):
    prior = "a = 7178.0\ne = 0.01\ni = 98.6\nraan = 110.0\nargp = 90.0\nnu = 10.0\nmean = { mass = 50.0 }\n"
    prior += "sigma = { x = 0.01, y = 0.02, z = 0.03, vx = 1e-5, vy = 1e-5, vz = 1e-5, mass = 1.0 }\naxes = 'TNW'"
    problem = load(tmp_path, prior, 'units = "km, deg"', '[states]\nmass = "kg"\n[dynamics]\nmass = "0"')
    r, v = pz.orbit.Keplerian().to_state(np.array([7178e3, 0.01, *np.radians([98.6, 110.0, 90.0, 10.0])]), GM)
    np.testing.assert_allclose(problem.prior.mean, [*r, *v, 50.0], rtol=1e-14)
    J = pz.orbit.state_axes(r, v, "TNW")
    turned = J @ problem.prior.covariance[:6, :6] @ J.T
    np.testing.assert_allclose(np.sqrt(np.diag(turned)), [10.0, 20.0, 30.0, 0.01, 0.01, 0.01], rtol=1e-9)
    assert problem.prior.covariance[6, 6] == 1.0


def test_states_in_another_frame(tmp_path):
    problem = load(tmp_path, f"mean = {X.tolist()}\nframe = 'EME2000'\ntime = -60.0\n{SIGMA}")
    expected = np.concatenate(earth.transform(X[:3], X[3:], "EME2000", "GCRF", EPOCH - 60.0))
    np.testing.assert_array_equal(problem.prior.mean, expected)
    assert np.linalg.norm(expected - X) > 0.1


def test_a_file_has_state_time_and_covariance(tmp_path):
    P = np.diag([100.0, 400.0, 50.0, 1e-4, 2e-4, 3e-4])
    arc = Arc(
        epoch=EPOCH, t=[-120.0], position=[X[:3]], velocity=[X[3:]], centre="EARTH", frame="GCRF", scale="UTC", name="A",
        covariance_t=[-120.0], covariance=[P], covariance_frames=("RTN",),
    )  # fmt: skip
    (tmp_path / "a.opm").write_text(opm_text(arc))
    problem = load(tmp_path, 'file = "a.opm"')
    np.testing.assert_allclose(problem.prior.mean, X, rtol=1e-15)
    assert problem.prior_time == -120.0
    J = pz.orbit.state_axes(X[:3], X[3:], "RTN")
    np.testing.assert_allclose(J @ problem.prior.covariance @ J.T, P, atol=1e-9)
    wider = load(tmp_path, f'file = "a.opm"\n{SIGMA}')
    np.testing.assert_allclose(np.sqrt(np.diag(wider.prior.covariance)), [10.0, 20.0, 30.0, 0.01, 0.02, 0.03])


FIVE = 'a = "7178 km"\ne = 0.01\ni = 1.7\nraan = 0.1\nargp = 0.2\n'


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        (FIVE + SIGMA, "prior: has no anomaly: give one of nu, E, M"),
        (FIVE + "nu = 0.1\nM = 0.1\n" + SIGMA, "prior: has nu and M: give one of"),
        ('a = "7178 km"\nnu = 0.1\n' + SIGMA, "prior.e: is missing: an orbit has a, e, i, raan, argp"),
        (FIVE.replace("7178 km", "7178 kg") + "nu = 0.1\n" + SIGMA, "prior.a: is '7178 kg', which is no length"),
        (FIVE.replace("0.01", "1.0") + "nu = 0.1\n" + SIGMA, "prior: a parabola has no semi-major axis"),
        (FIVE + "nu = 0.1\nmean = [1.0]\n" + SIGMA, "prior.mean: stands beside elements"),
        (FIVE + "nu = 0.1\naxes = 'NTW'\n" + SIGMA, "prior.axes: is 'NTW'.*did you mean 'TNW'|prior.axes: is 'NTW'"),
        (FIVE + "nu = 0.1\nframe = 'GRCF'\n" + SIGMA, "prior.frame: .*GRCF"),
        (FIVE + "nu = 0.1\n", "prior: needs one of sigma, variance, covariance|prior: has neither"),
        ("file = 'none.oem'\n" + SIGMA, "prior.file: none.oem: No such file"),
        (f"mean = {X.tolist()}\nframe = 'TEME'\ntime = 'first'\n{SIGMA}", "prior.time: must be a number"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, prior, message):
    with pytest.raises(ScenarioError, match=message):
        load(tmp_path, prior)


def test_orbits_need_the_earth(tmp_path):
    path = tmp_path / "mine.toml"
    text = FILE.format(prior=FIVE + "nu = 0.1\n" + SIGMA, units="", states="").replace(
        "[earth]\ndegree = 2\n", 'dynamics = { x = "0" }\nstates = { x = "m" }\n'
    )
    path.write_text(text)
    with pytest.raises(ScenarioError, match=r"prior: names an orbit, which needs \[earth\] and an epoch"):
        load_scenario(path)
