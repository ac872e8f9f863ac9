"""Ranges against light times by repetition along a propagated orbit; their derivatives against differences; laws."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.earth import sensors
from piazzi.earth.sensors import light
from piazzi.model.functions import STATION
from piazzi.model.values import with_values
from piazzi.outside.table import Table
from piazzi.problem import evaluation
from tests.references.signals import EPOCH, HERSTMONCEUX, YARRAGADEE, C, Site, T, Trajectory, legs, orbit, problem, slopes

ORBITS = {"LEO": 1e-6, "GEO": 1e-6, "Moon": 1e-5}


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def expected(p, path, tag, x, transmitter=YARRAGADEE, t=T):
    down, up, *_ = legs(path, tag, Trajectory(p, x, t), Site(), Site(transmitter), t)
    return C * (down if path == "one-way" else (down + up) / 2)


@pytest.mark.parametrize("steps", [False, True])
@pytest.mark.parametrize("tag", [pytest.param(t, marks=[pytest.mark.slow] * (t != "reception")) for t in light.TAGS])
def test_range_is_that_of_light_times_by_repetition(tag, steps):
    """To 1e-6 m to geostationary orbits, 1e-5 m at the Moon; partials to 1e-7 of theirs."""
    sensor = [sensors.range(path, name=path, tag=tag, steps=steps) for path in ("one-way", "two-way")]
    sensor.append(sensors.range("three-way", name="three-way", tag=tag, steps=steps, transmitter=HERSTMONCEUX))
    p = problem(*sensor)
    for kind, bar in ORBITS.items():
        x = orbit(kind)
        for path in light.PATHS:
            far = HERSTMONCEUX if path == "three-way" else YARRAGADEE
            assert abs(p.measure(path, x, T)[0] - expected(p, path, tag, x, far)) < bar
            H = p.measurement_jacobian(path, x, T)[0]
            D = slopes(lambda y, path=path: p.measure(path, y, T), x)[0]
            np.testing.assert_allclose(H[:3], D[:3], atol=3e-8)
            np.testing.assert_allclose(H[3:], D[3:], atol=3e-8 * max(1.0, np.abs(H[3:]).max()) + 1e-7 * np.abs(H[3:]).max())


def test_two_ways_are_the_mean_of_the_legs_of_a_station_that_stands_still():
    times = np.arange(-90000.0, 100000.0, 3600.0)
    still = Table(times, np.tile([4.1e6, 1.0e6, 4.76e6, 0.0, 0.0, 0.0], (len(times), 1)))
    p = problem(*(sensors.range(path, name=path, tag="bounce") for path in light.PATHS[:2]), place=still)
    x = orbit("GEO")
    assert abs(p.measure("two-way", x, T) - p.measure("one-way", x, T))[0] < 1e-8


def test_passes_of_a_station_are_checked_at_the_door_as_one(monkeypatch):
    looked = []
    value = Table.value
    monkeypatch.setattr(Table, "value", lambda self, *t: looked.append(t) or value(self, *t))
    one = problem(
        sensors.range(), place=Table([-90000.0, 0.0, 90000.0], np.tile([4.1e6, 1.0e6, 4.76e6, 0.0, 0.0, 0.0], (3, 1)))
    )
    once = len(looked)
    replace(one, stations=[replace(one.stations[0], name=f"pass {i}") for i in range(5)])
    assert len(looked) == 2 * once > 0


def test_forces_are_worked_out_once_for_the_check_of_a_light_time_with_the_same_values(monkeypatch):
    p = problem(*(sensors.range(path, name=path) for path in light.PATHS[:2]))
    numbers, functions = {**dict(zip(p.model.names, orbit("LEO"), strict=True)), **p.parameters, "t": T}, p.functions
    values = with_values(numbers, p.model.definitions, functions=functions, model=p.model)
    still, known = evaluation._with_rates(p.model, values)
    assert still is not p.model
    for station in p.stations:
        about = {"functions": {**functions, STATION: station.place}}
        layer, own = p.model.sensor(station.sensor).definitions, dict(station.numbers)
        anew = with_values(values | own, layer, model=p.model, **about)
        assert anew.items() <= with_values(known | own, layer, model=still, **about).items()
        assert len(anew) > len(values | own)


def test_light_time_goes_to_zero_as_light_gets_faster(monkeypatch):
    monkeypatch.setattr(light, "C", "1e25")
    p, x = problem(sensors.range()), orbit("GEO")
    assert p.measure("range", x, T)[0] == pytest.approx(np.linalg.norm(x[:3] - Site()(T)[:3]), rel=1e-15)


def test_gravity_delays_each_leg():
    """2 GM/c^2 ln((r1 + r2 + rho)/(r1 + r2 - rho)): Moyer 2003, eq. 8-54."""
    p = problem(sensors.range(), sensors.range(name="late", relativity=True))
    for kind in ORBITS:
        x = orbit(kind)
        r, q = np.linalg.norm(x[:3]), np.linalg.norm(Site()(T)[:3])
        rho = np.linalg.norm(x[:3] - Site()(T)[:3])
        delay = 2 * 3.986004418e14 / C**2 * np.log((r + q + rho) / (r + q - rho))
        assert p.measure("late", x, T)[0] - p.measure("range", x, T)[0] == pytest.approx(delay, abs=2e-6)
        assert delay > 1e-4


def look(x):
    """Elevation and azimuth of a state at its own light time, by matrices."""
    sat, rec = legs("one-way", "reception", lambda t: x + (t - T) * np.r_[x[3:], 0, 0, 0], Site(), Site())[3:1:-1]
    W = earth.rotation("GCRF", "ITRF", EPOCH + T)
    azimuth, elevation, _ = YARRAGADEE.look(W @ (sat - rec)[:3] + YARRAGADEE.position(EPOCH), EPOCH)
    return azimuth, elevation


@pytest.mark.slow  # uncompiled
def test_the_air_is_what_its_formulas_say():
    latitude, longitude, height = YARRAGADEE.place(EPOCH)
    weather = earth.Weather(98000.0, 290.0, 0.4)
    made = {"range": sensors.range(), "radio": sensors.range(name="radio", troposphere="saastamoinen")}
    for laser in ("mendes-pavlis", "marini-murray"):
        made[laser] = sensors.range(name=laser, troposphere=laser)
    made["gmf"] = sensors.range(name="gmf", troposphere="saastamoinen", mapping="gmf")
    p, x = problem(*made.values(), numbers={"weather": weather}), orbit("LEO")
    _, elevation = look(x)
    air = {"pressure": 98000.0, "temperature": 290.0, "vapour": weather.vapour}
    place = {"latitude": latitude, "height": height}
    dry, wet = earth.media.saastamoinen(**place, **air)
    for name, coefficients in (
        ("radio", earth.media.niell_coefficients(latitude, EPOCH)),
        ("gmf", earth.media.gmf_coefficients(latitude, longitude, EPOCH)),
    ):
        m = earth.media.mapping(elevation=elevation, height=height, **coefficients)
        assert p.measure(name, x, T)[0] - p.measure("range", x, T)[0] == pytest.approx(dry * m[0] + wet * m[1], abs=1e-5)
    for name, formula in (("mendes-pavlis", earth.media.mendes_pavlis), ("marini-murray", earth.media.marini_murray)):
        delay = formula(elevation=elevation, wavelength=532e-9, **place, **air)
        assert p.measure(name, x, T)[0] - p.measure("range", x, T)[0] == pytest.approx(delay, abs=1e-5)
        assert 2.0 < delay < 4.0


def test_the_ionosphere_is_the_mean_of_both_frequencies():
    layer = {"electrons": 3e17, "frequency": 2.2e9, "uplink_frequency": 2.0e9}
    p = problem(sensors.range(ionosphere="single-layer"), numbers=layer)
    q = problem(sensors.range())
    x = orbit("LEO")
    _, elevation = look(x)
    delays = [earth.media.single_layer(elevation, 3e17, f, 450e3) for f in (2.2e9, 2.0e9)]
    assert p.measure("range", x, T)[0] - q.measure("range", x, T)[0] == pytest.approx(np.mean(delays), abs=1e-5)


def test_klobuchar_is_taken_at_the_time_of_the_row():
    message = {"alpha0": 2e-8, "alpha1": 1e-8, "beta0": 1e5, "beta1": 2e4}
    p = problem(
        sensors.range("one-way", ionosphere="klobuchar"), numbers={**message, "gps_seconds": 4000.0, "frequency": 1.6e9}
    )
    q, x = problem(sensors.range("one-way")), orbit("LEO")
    azimuth, elevation = look(x)
    latitude, longitude, _ = YARRAGADEE.place(EPOCH)
    rest = dict.fromkeys(("alpha2", "alpha3", "beta2", "beta3"), 0.0)
    delay = earth.media.klobuchar(
        elevation=elevation,
        azimuth=azimuth,
        latitude=latitude,
        longitude=longitude,
        gps_seconds=4000.0 + T,
        frequency=1.6e9,
        **message,
        **rest,
    )
    assert p.measure("range", x, T)[0] - q.measure("range", x, T)[0] == pytest.approx(delay, abs=1e-5)


def test_numbers_of_the_station_bias_scale_and_move():
    numbers = {"range_bias": 7.0, "range_scale": 1e-5, "centre_of_mass": 0.251, "time_bias": 0.002}
    p = problem(sensors.range(time_bias=True), numbers=numbers)
    q, x = problem(sensors.range()), orbit("LEO")
    before = expected(p, "two-way", "reception", Trajectory(p, x)(T - 0.002), t=T - 0.002)
    assert p.measure("range", x, T)[0] == pytest.approx((1 + 1e-5) * (before - 0.251) + 7.0, abs=1e-6)
    assert abs(before - q.measure("range", x, T)[0]) > 0.5


def test_one_sensor_serves_stations_and_passes_whose_biases_are_estimated():
    sensor = sensors.range(biases={"Yarragadee": "estimated", "Herst-2": "considered"})
    model = earth.Forces(degree=2).model(sensor)
    roles = {p.name: p.role for p in model.parameters}
    assert roles["range_bias_Yarragadee"] == "estimated" and roles["range_bias_Herst_2"] == "considered"
    first = sensor.at(YARRAGADEE, EPOCH, 0.1)
    second = sensor.at(HERSTMONCEUX, EPOCH, 0.1, name="Herst-2")
    other = sensor.at(HERSTMONCEUX, EPOCH, 0.1)
    picked = [[s["numbers"][f"is_{name}"] for name in ("Yarragadee", "Herst_2")] for s in (first, second, other)]
    assert picked == [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
    p = problem(
        sensor, parameters={"range_bias_Yarragadee": pz.Gaussian(3.0, 1.0), "range_bias_Herst_2": pz.Gaussian(5.0, 1.0)}
    )
    q, x = problem(sensors.range()), orbit("LEO")
    p = pz.Problem(p.model, p.prior, None, [pz.Station(**s) for s in (first, second, other)], p.parameters, p.integrator,
                   0.0, functions=p.functions, epoch=EPOCH)  # fmt: skip
    y = np.append(x, 3.0)
    assert p.measure("Yarragadee", y, T)[0] - q.measure("range", x, T)[0] == pytest.approx(3.0, abs=1e-7)
    assert p.measurement_jacobian("Yarragadee", y, T)[0, 6] == 1.0
    assert p.measure("Herst-2", y, T)[0] - p.measure("Herstmonceux", y, T)[0] == pytest.approx(5.0, abs=1e-7)
    assert len(p.model.sensors) == 1


def test_what_there_is_not_is_refused_in_one_line():
    for wrong, said in (
        ({"path": "one way"}, "path is 'one way'; there are one-way, two-way, three-way"),
        ({"tag": "receive"}, "tag is 'receive'"),
        ({"troposphere": "hopfield"}, "troposphere is 'hopfield'"),
        ({"path": "three-way"}, "give transmitter=earth.Station"),
        ({"parameters": ["bias"]}, "parameters has 'bias'"),
    ):
        with pytest.raises(ValueError, match=said):
            sensors.range(**wrong)
    with pytest.raises(ValueError, match="no number 'rangebias'; did you mean 'range_bias'"):
        sensors.range().at(YARRAGADEE, EPOCH, 1.0, rangebias=1.0)
    with pytest.raises(ValueError, match="give sigma="):
        sensors.range().at(YARRAGADEE, EPOCH)


@pytest.mark.parametrize("troposphere", ["saastamoinen", "mendes-pavlis"])
def test_media_go_with_forces_that_call_a_thermosphere(troposphere):
    """No definition of a sensor has the name of a function of the forces, such as ``air``."""
    forces = earth.Forces(degree=2, drag="msis")
    assert forces.model([sensors.range("two-way", troposphere=troposphere)])
