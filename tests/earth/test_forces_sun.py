"""Forces about the Sun: each against its formula, and Ceres of 1801 against JPL's orbit of it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth.tabulated import Body
from tests.earth.test_bodies import write_spk

EPOCH = pz.Epoch("2016-02-13T00:00:00 TDB")
X = np.array([2.1e11, 2.9e11, 1.0e11, -1.5e4, 8.0e3, 4.0e3])
T = 4.0e5
C, GM_SUN, AU = 299792458.0, 1.32712440041279419e20, 149597870700.0


pytestmark = pytest.mark.filterwarnings("ignore::piazzi.earth.EphemerisWarning")


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def problem(forces, x=X, epoch=EPOCH, functions=None, **values):
    return pz.Problem(
        forces.model(),
        pz.Gaussian(x, [1.0] * 6),
        parameters={**forces.values, **values},
        functions=functions or forces.functions(epoch),
        epoch=epoch,
        prior_time=0.0,
    )


def alone(forces, switch, functions=None, **values):
    p = problem(forces, functions=functions, **values)
    off = replace(p, parameters={**p.parameters, switch: 0.0})
    assert p.spec("transition", "rates") is off.spec("transition", "rates")
    return (p.dynamics(X, T) - off.dynamics(X, T))[3:]


def test_planets_draw_the_body_and_the_sun():
    forces = earth.Forces(about="sun", relativity=False)
    assert forces.bodies == ("mercury", "venus", "earth", "moon", "mars", "jupiter", "saturn", "uranus", "neptune")
    for name, gm in (("jupiter", 1.267127641e17), ("earth", 3.98600435507e14), ("moon", 4.902800118e12)):
        s = earth.body(name, EPOCH + T, "sun")[0]
        d = s - X[:3]
        expected = gm * (d / np.linalg.norm(d) ** 3 - s / np.linalg.norm(s) ** 3)
        np.testing.assert_allclose(alone(forces, f"{name}_on"), expected, atol=3e-19, rtol=1e-6)


def test_the_sun_and_its_field_in_general_relativity():
    forces = earth.Forces(about="sun", bodies=())
    R, r, v = np.linalg.norm(X[:3]), X[:3], X[3:]
    expected = GM_SUN / (C**2 * R**3) * ((4 * GM_SUN / R - v @ v) * r + 4 * (r @ v) * v)
    np.testing.assert_allclose(alone(forces, "relativity_on"), expected, atol=1e-18)
    p = problem(forces, relativity_on=0.0)
    np.testing.assert_allclose(p.dynamics(X, T)[3:], -GM_SUN * r / R**3, rtol=1e-15)


def test_nongravitational_forces():
    forces = earth.Forces(about="sun", bodies=(), relativity=False, nongravitational=("A1", "A2", "A3"))
    R, N = X[:3] / np.linalg.norm(X[:3]), np.cross(X[:3], X[3:])
    N /= np.linalg.norm(N)
    expected = (AU / np.linalg.norm(X[:3])) ** 2 * (1e-7 * R + 2e-7 * np.cross(N, R) - 3e-7 * N)
    np.testing.assert_allclose(alone(forces, "outgassing_on", A1=1e-7, A2=2e-7, A3=-3e-7), expected, atol=1e-17)


def test_times_are_seconds_of_tdb():
    """Half a year later TDB is ahead by what the Earth's motion makes: the table is asked at that instant."""
    t = 200 * 86400.0
    table = Body("earth", EPOCH, None, "sun", "TDB")
    reading = pz.Epoch("2016-02-13T00:00:00 TDB").jd("TDB")
    import erfa

    later = reading[0] + 200.0, reading[1]
    pv = erfa.epv00(*later)[0]
    np.testing.assert_allclose(table.at([EPOCH + t])[0], np.asarray(pv["p"]) * AU, atol=0.5)
    assert np.linalg.norm(earth.body("earth", EPOCH + t, "sun")[0] - table.at([EPOCH + t])[0]) > 10.0


def test_asteroids_come_from_a_kernel_of_their_own(tmp_path):
    place = np.array([3e8, 1e8, 5e7])  # km from the Sun, at rest
    write_spk(tmp_path / "asteroids.bsp", [(2000001, 10, np.column_stack([place, np.zeros(3)]))], 0.0, 1e9)
    forces = earth.Forces(about="sun", bodies=(), relativity=False, asteroids=("ceres",))
    functions = forces.functions(EPOCH, asteroids=tmp_path / "asteroids.bsp")
    s = place * 1e3
    d = s - X[:3]
    expected = 6.26288864e10 * (d / np.linalg.norm(d) ** 3 - s / np.linalg.norm(s) ** 3)
    np.testing.assert_allclose(alone(forces, "ceres_on", functions), expected, rtol=1e-4, atol=3e-19)
    with pytest.raises(ValueError, match="ceres: places of asteroids come from a kernel; give asteroids="):
        forces.functions(EPOCH)


def test_without_a_kernel_the_error_of_the_series_is_said():
    with pytest.warns(earth.EphemerisWarning, match="jupiter 172458 km.*give kernel="):
        earth.Forces(about="sun").functions(EPOCH)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        earth.Forces(about="sun", bodies=()).functions(EPOCH)  # nothing comes from it
        earth.Forces().functions(EPOCH)


def test_ceres_of_1801_goes_where_jpl_has_it(data_dir):
    """Over 400 days, from JPL's own state: 66 km of places of planets by series, 213 000 km without planets."""
    path = data_dir / "earth" / "ceres-1801" / "ANSWER_ceres_heliocentric_jpl_sb441.csv"
    rows = np.genfromtxt(path, delimiter=",", skip_header=1)
    first, last = rows[0], rows[400]
    epoch = pz.Epoch.from_jd(first[0], 0.0, "TDB")
    missed = []
    for forces in (earth.Forces(about="sun", bodies=()), earth.Forces(about="sun")):
        p = replace(problem(forces, first[1:] * 1e3, epoch), integrator=pz.RungeKutta8(40))
        end = p.step(first[1:] * 1e3, 86400.0 * 400, 0.0)[0]
        missed.append(np.linalg.norm(end[:3] - last[1:4] * 1e3))
    assert missed[0] > 2e8
    assert missed[1] < 1e5
