"""Directions against light times by repetition along a propagated orbit, and by way of the barycentre of the solar system."""

import erfa
import numpy as np
import pytest

from piazzi import earth
from piazzi.earth import sensors
from tests.references.signals import EPOCH, YARRAGADEE, C, Site, T, Trajectory, legs, orbit, problem, slopes

MAS = np.radians(1.0 / 3.6e6)
KINDS = ("LEO", "GEO", "Moon")


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")  # the same source uncompiled


def line(p, x, tag="reception"):
    """Receiver and satellite at their events, and the time of reception."""
    down, up, rec, sat, _ = legs("two-way" if tag == "transmission" else "one-way", tag, Trajectory(p, x), Site(), Site())
    return rec, sat, T + {"reception": 0.0, "bounce": down, "transmission": up + down}[tag]


def aberrated(direction, velocity):
    """What one sees who moves: Lorentz, exact."""
    n, beta = direction / np.linalg.norm(direction), velocity / C
    rest = np.sqrt(1 - beta @ beta)
    return (rest * n + (1 + n @ beta / (1 + rest)) * beta) / (1 + n @ beta)


def earth_moves(t):
    pv = erfa.epv00(*(EPOCH + t).jd("TDB"))[1]
    return np.asarray(pv["v"]) * 149597870700.0 / 86400.0


def spherical(n):
    return np.array([np.arctan2(n[1], n[0]), np.arctan2(n[2], np.hypot(n[0], n[1]))])


@pytest.mark.parametrize("tag", ["reception", "bounce", pytest.param("transmission", marks=pytest.mark.slow)])
def test_azimuth_and_elevation_are_those_of_the_line_along_the_light(tag):
    p = problem(sensors.azimuth_elevation("geocentric", tag=tag), sensors.azimuth_elevation(name="seen", tag=tag))
    for kind in KINDS if tag == "reception" else ("GEO",):
        x = orbit(kind)
        rec, sat, t = line(p, x, tag)
        W = earth.rotation("GCRF", "ITRF", EPOCH + t)
        at = YARRAGADEE.position(EPOCH)
        for name, n in (("azimuth_elevation", (sat - rec)[:3]), ("seen", aberrated((sat - rec)[:3], rec[3:]))):
            expected = YARRAGADEE.look(at + 1e7 * W @ (n / np.linalg.norm(n)), EPOCH)[:2]
            z = p.measure(name, x, T)
            turns = (z - expected + np.pi) % (2 * np.pi) - np.pi
            np.testing.assert_allclose(turns * [np.cos(z[1]), 1.0], 0.0, atol=3e-11)
        D = slopes(lambda y: p.measure("seen", y, T), x)
        np.testing.assert_allclose(p.measurement_jacobian("seen", x, T), D, atol=1e-6 * np.abs(D).max())


def test_refraction_lifts_by_its_formulas():
    kinds = ("optical", "radio")
    given = [sensors.azimuth_elevation(), *(sensors.azimuth_elevation(name=k, refraction=k) for k in kinds)]
    weather = earth.Weather(98000.0, 290.0, 0.4)
    p, x = problem(*given, numbers={"weather": weather}), orbit("LEO")
    elevation = p.measure("azimuth_elevation", x, T)[1]
    air = {"pressure": 98000.0, "temperature": 290.0}
    optical = earth.media.optical_refraction(elevation, **air)
    wet = earth.media.refractivity(vapour=weather.vapour, **air)
    radio = earth.media.radio_refraction(elevation, YARRAGADEE.place(EPOCH)[2], wet)
    assert p.measure("optical", x, T)[1] - elevation == pytest.approx(optical, abs=1e-13)
    assert p.measure("radio", x, T)[1] - elevation == pytest.approx(radio, abs=1e-13)
    assert optical > 1e-5 and radio > 1e-5


@pytest.mark.parametrize("angles", ["astrometric", "geocentric", "apparent"])
def test_right_ascension_and_declination_of_each_kind(angles):
    p = problem(sensors.right_ascension_declination(angles))
    for kind in KINDS:
        x = orbit(kind)
        rec, sat, t = line(p, x)
        n = (sat - rec)[:3] / np.linalg.norm((sat - rec)[:3])
        n = {"geocentric": n, "apparent": aberrated(n, rec[3:]), "astrometric": aberrated(n, -earth_moves(t))}[angles]
        z = p.measure("right_ascension_declination", x, T)
        np.testing.assert_allclose(z, spherical(n), atol=3e-11)
        D = slopes(lambda y: p.measure("right_ascension_declination", y, T), x)
        np.testing.assert_allclose(p.measurement_jacobian("right_ascension_declination", x, T), D, atol=1e-6 * np.abs(D).max())


def barycentric(p, x):
    """The direction to the satellite when it sent the light, in coordinates of the BCRS, by light time there.

    An event at x and t in the GCRS is at E(t) + x - v (v.x)/2c^2 and t + v.x/c^2 in the BCRS, to order c^-2.
    """
    v, path, q = earth_moves(T), Trajectory(p, x), Site()(T)[:3]

    def event(t, r):
        late = v @ r / C**2
        return t - T + late, v * (t - T + late) + r - v * (v @ r) / (2 * C**2)

    seen_at, here = event(T, q)
    tau = 0.0
    for _ in range(10):
        at, there = event(T - tau, path(T - tau)[:3])
        tau += np.linalg.norm(there - here) / C - (seen_at - at)
    return spherical((there - here) / np.linalg.norm(there - here))


def test_a_geostationary_satellite_both_ways():
    """Reduced against stars, or geocentric with the annual aberration by ERFA: to 1 mas; they differ by 20 arcseconds."""
    p = problem(
        sensors.right_ascension_declination("astrometric"), sensors.right_ascension_declination("geocentric", name="near")
    )
    x = orbit("GEO")
    z, near = (p.measure(name, x, T) for name in ("right_ascension_declination", "near"))
    np.testing.assert_allclose(z, barycentric(p, x), atol=MAS)
    n = np.array([np.cos(z[1]) * np.cos(z[0]), np.cos(z[1]) * np.sin(z[0]), np.sin(z[1])])
    beta = earth_moves(T) / C
    moved = erfa.ab(n, beta, 0.987, np.sqrt(1 - beta @ beta))
    np.testing.assert_allclose(spherical(moved), near, atol=MAS)
    assert 5e3 * MAS < np.abs(z - near).max() < 25e3 * MAS


@pytest.mark.parametrize("axes", ["EME2000", "TOD", "TEME", "ITRF"])
def test_directions_along_other_axes_are_turned(axes):
    p, x = problem(sensors.right_ascension_declination("geocentric", axes=axes)), orbit("GEO")
    rec, sat, t = line(p, x)
    n = earth.rotation("GCRF", axes, EPOCH + t) @ (sat - rec)[:3]
    np.testing.assert_allclose(p.measure("right_ascension_declination", x, T), spherical(n), atol=3e-11)


def test_angles_are_asked_for_and_named():
    with pytest.raises(TypeError, match="angles"):
        sensors.right_ascension_declination()
    with pytest.raises(ValueError, match="angles is 'topocentric'; there are astrometric, geocentric, apparent"):
        sensors.right_ascension_declination("topocentric")
    with pytest.raises(ValueError, match="refraction is 'laser'"):
        sensors.azimuth_elevation(refraction="laser")
    sensor = sensors.right_ascension_declination("astrometric")
    assert sensor.angles == sensor.components and dict(sensor.on_sky) == {"right_ascension": "declination"}
