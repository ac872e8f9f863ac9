"""Options of the sensors, one by one: each changes what is computed by an amount that is worked out apart."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from piazzi.earth.tides import station_displacement
from tests.references.signals import EPOCH, HERSTMONCEUX, YARRAGADEE, C, Site, T, Trajectory, orbit, problem, slopes

SLOW = pytest.mark.slow  # uncompiled


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


RETURNED = {"transmit_frequency": 2.1e9, "transmit_rate": 30.0, "turnaround": 240 / 221, "since": 700.0}
PHASE = {"cycles": 7.0, "beat": 3.0, "since": 700.0}
# name: a function that makes the sensor with further options, and numbers of its station
MAKERS = {
    "range": (sensors.range, {}),
    "range_rate": (sensors.range_rate, {}),
    "range_rate, count": (lambda **o: sensors.range_rate(count="end", **o), {"count": 10.0}),
    "azimuth_elevation": (sensors.azimuth_elevation, {}),
    "xeyn": (lambda **o: sensors.azimuth_elevation(mount="xeyn", **o), {}),
    "right_ascension_declination": (lambda **o: sensors.right_ascension_declination("apparent", **o), {}),
    "position": (lambda **o: sensors.position(velocity=True, frame="ITRF", **o), {}),
    "returned_frequency": (sensors.returned_frequency, RETURNED),
    "returned_frequency, count": (lambda **o: sensors.returned_frequency(count="start", **o), {**RETURNED, "count": 10.0}),
    "carrier_phase": (sensors.carrier_phase, PHASE),
    "radar_delay": (sensors.radar_delay, {}),
    "radar_doppler": (sensors.radar_doppler, {}),
    "frequency": (lambda **o: sensors.frequency(437e6, parameters=(), **o), {"carrier": 100.0}),
    "delay_difference": (lambda **o: sensors.delay_difference(HERSTMONCEUX, **o), {}),
    "pseudorange": (lambda **o: sensors.pseudorange(parameters=(), **o), {}),
}
BIASED = [name for name in MAKERS if name not in ("frequency", "carrier_phase")]


def made(name, more=None, **options):
    """A problem with a sensor and its options, and the name of the station."""
    make, numbers = MAKERS[name]
    sensor = make(**options)
    known = dict(sensor.defaults)
    given = {key: value for key, value in {**numbers, **(more or {})}.items() if key in known}
    priors = {n: pz.Gaussian(0.0, 1.0) for n in sensor.parameters}
    change = {"place": twin()} if name == "pseudorange" else {}
    return problem(sensor, numbers=given, parameters=priors, **change), sensor.name


def twin():
    t = np.arange(T - 900.0, T + 900.0, 60.0)
    r, v = pz.propagate_kepler([2.2e7, 1.2e7, 8e6], [-2e3, 2.2e3, 2.2e3], 3.986e14, t)
    return pz.Table(t, np.hstack([r, v]))


def full(p, x):
    return np.r_[x, np.zeros(p.model.n - 6)] if p.model.n > 6 else x


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[] if n == "returned_frequency" else SLOW)
        for n in MAKERS
        if n not in ("delay_difference", "pseudorange")
    ],
)
def test_late_clocks_see_what_was(name):
    """With times that are late by tb, a row at t is what is seen at t - tb, of where everything was then."""
    late, plain = made(name, {"time_bias": 0.02}, time_bias=True), made(name)
    x = orbit("LEO")
    before = Trajectory(plain[0], x)(T - 0.02)
    expected = plain[0].measure(plain[1], before, T - 0.02)
    got, now = late[0].measure(late[1], x, T), plain[0].measure(plain[1], x, T)
    scale = np.abs(got - now).max()
    np.testing.assert_allclose(got, expected, atol=max(2e-4 * scale, 4e-16 * np.abs(got).max()))
    assert scale > 0.0


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in ("position", "delay_difference", "xeyn") else SLOW) for n in BIASED]
)
def test_biases_are_added_as_numbers_and_as_parameters_of_a_station(name):
    plain, key = made(name)
    x = orbit("LEO")
    components = plain.model.sensor(key).components
    z = plain.measure(key, x, T)
    sizes = {"returned_frequency": 100.0, "radar_doppler": 100.0, "radar_delay": 1e-6, "delay_difference": 1e-6}
    size = sizes.get(name.split(",")[0], 0.01)
    first = components[0]
    p, _ = made(name, {f"{c}_bias": size for c in components})
    np.testing.assert_allclose(p.measure(key, x, T) - z, size, rtol=1e-4)
    q, _ = made(name, biases=[key])
    assert f"{first}_bias_{key}" in q.model.constants
    place = q.model.names.index(f"{first}_bias_{key}")
    y = full(q, x)
    assert q.measurement_jacobian(key, y, T)[0, place] == 1.0
    y[place] = size
    np.testing.assert_allclose(q.measure(key, y, T)[0] - z[0], size, rtol=1e-4)


@pytest.mark.parametrize("role", ["fixed", "estimated", "considered"])
def test_a_number_may_be_a_parameter_of_any_role(role):
    sensor = sensors.range(parameters={"range_scale": role})
    model = earth.Forces(degree=2).model(sensor)
    assert {p.name: p.role for p in model.parameters}["range_scale"] == role
    assert "range_scale" not in dict(sensor.defaults)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["radar_delay", "carrier_phase", "pseudorange"])
def test_gravity_delays_each_leg(name):
    """2 GM/c^2 ln((r1 + r2 + rho)/(r1 + r2 - rho)) of each leg, in the unit of the sensor."""
    plain, key = made(name)
    late, _ = made(name, relativity=True)
    x = orbit("LEO")
    far = Site()(T)[:3] if name != "pseudorange" else np.array(twin().value(T)[:3])
    rho, r, q = (float(np.linalg.norm(v)) for v in (x[:3] - far, x[:3], far))
    leg = 2 * 3.986004418e14 / C**2 * np.log((r + q + rho) / (r + q - rho))
    size = {"radar_delay": 2 * leg / C, "carrier_phase": -7.0 * 2 * leg, "pseudorange": leg}[name]
    got = late.measure(key, x, T)[0] - plain.measure(key, x, T)[0]
    assert got == pytest.approx(size, rel=2e-3, abs=1e-8 * abs(plain.measure(key, x, T)[0]) * 1e-4)


@pytest.mark.parametrize("name", ["range", "azimuth_elevation"])
def test_tides_move_the_station(name):
    """The displacement along the line shortens a range, and across it turns a direction."""
    sensor = MAKERS[name][0]()
    there, fixed = (problem(sensor, numbers={"tides": on}) for on in (True, False))
    x = orbit("LEO")
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    stands = YARRAGADEE.position(EPOCH)
    d = (
        earth.station_displacement(stands, [EPOCH + T])[0]
        if np.ndim(earth.station_displacement(stands, [EPOCH + T])) > 1
        else None
    )
    d = station_displacement(stands, EPOCH + T)
    line = W @ (x[:3] - Site()(T)[:3])
    got = there.measure(sensor.name, x, T) - fixed.measure(sensor.name, x, T)
    assert np.linalg.norm(d) > 0.01
    if name == "range":
        assert got[0] == pytest.approx(-d @ line / np.linalg.norm(line), abs=1e-4)
        return
    before, after = (np.array(YARRAGADEE.look(stands + line - move, EPOCH)[:2]) for move in (0.0, d))
    np.testing.assert_allclose(got, after - before, atol=2e-9)


def test_orientation_of_the_earth_moves_the_station():
    """UT1 that is ahead by 0.1 s turns the station to the east by 0.1 s of the Earth's rotation."""
    eop = [earth.EOP(ut1_utc=0.0 + more, xp=0.0, yp=0.0, dx=0.0, dy=0.0) for more in (0.0, 0.1)]
    sensor, x = sensors.range("one-way"), orbit("LEO")
    z = [problem(sensor, numbers={"eop": one, "tides": False}).measure("range", x, T)[0] for one in eop]
    q = [earth.Place(YARRAGADEE, EPOCH, one, False).value(T)[:3] for one in eop]
    rho = [np.linalg.norm(x[:3] - np.array(one)) for one in q]
    assert z[1] - z[0] == pytest.approx(rho[1] - rho[0], abs=1e-3) and abs(z[1] - z[0]) > 1.0
    turned = 7.292115e-5 * 0.1 * np.hypot(*YARRAGADEE.position(EPOCH)[:2])
    assert np.linalg.norm(np.subtract(*q)) == pytest.approx(turned, rel=1e-4)


def test_eccentricities_and_stations_own_biases_are_taken():
    """A station's own list of biases, and where its reference point stands off the marker."""
    site = YARRAGADEE.moved(up=5.0)
    own = earth.Station(site.name, site.coordinates, site.eccentricities, bias={"range": 3.0})
    sensor, x = sensors.range(), orbit("LEO")
    z = [problem(sensor, station=one).measure("range", x, T)[0] for one in (YARRAGADEE, site, own)]
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    line = W @ (x[:3] - Site()(T)[:3])
    elevation = YARRAGADEE.look(YARRAGADEE.position(EPOCH) + line, EPOCH)[1]
    assert z[1] - z[0] == pytest.approx(-5.0 * np.sin(elevation), abs=1e-3)
    assert z[2] - z[1] == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in ("carrier_phase", "xeyn") else SLOW) for n in MAKERS])
def test_partials_are_differences(name):
    p, key = made(name)
    x = orbit("LEO")
    D = slopes(lambda y: p.measure(key, full(p, y), T), x)
    H = p.measurement_jacobian(key, full(p, x), T)[:, :6]
    z = np.abs(p.measure(key, full(p, x), T)).max()
    for rows in (slice(0, 3), slice(3, 6)):  # places and velocities, whose sizes differ
        noise = 4e-16 * z / (200.0 if rows.start == 0 else 0.2)
        np.testing.assert_allclose(H[:, rows], D[:, rows], atol=2e-6 * np.abs(D[:, rows]).max() + 20 * noise)
