"""Orbits about the Sun from directions: sensors by their laws, and Ceres as Piazzi saw it against JPL's orbit of today."""

import tomllib

import erfa
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.determination import measured
from piazzi.determination.case_file import CASES, split
from piazzi.determination.centres import EARTH, SUN
from piazzi.determination.guesses import Guess
from piazzi.determination.orbit import ECLIPTIC, Orbit
from piazzi.determination.published import published_of
from piazzi.determination.unguided import goes_about_the_sun
from piazzi.formats import Observations, Segment, read_tracking
from piazzi.orbit import propagate_kepler
from piazzi.scenarios.toml_text import toml_text

LIGHT, AU = 299792458.0, 149597870700.0
EPOCH = pz.Epoch("2015-03-01T00:00:00 TDB")
SITE = earth.Station.geodetic("PALERMO", *np.radians([38.1117, 13.3578]), 72.0)
STATE = np.array([1.1 * AU, 2.4 * AU, 0.9 * AU, -15.2e3, 6.1e3, 4.4e3])  # of a minor planet


def line(t, station=SITE):
    """Where light that is received at t comes from, by iteration, and the velocity of the station from the Sun."""
    place = earth.Place(station, EPOCH, about="sun")
    here, velocity = np.split(np.array(place.value(t)), 2)
    tau = 0.0
    for _ in range(6):
        r = propagate_kepler(STATE[:3], STATE[3:], SUN.mu, t - tau)[0] - here
        tau = np.linalg.norm(r) / LIGHT
    return r, velocity


def observations(angles="astrometric", frame="ICRF", days=(0, 1, 8, 20), noise=1e-7, seed=1, station="PALERMO", axes=None):
    """Two rows a night, with noise (rad) on the sky."""
    rng, t, value = np.random.default_rng(seed), [], []
    for day in days:
        at = 86400.0 * day + 600.0
        u = line(at, SITE if station == "PALERMO" else None)[0]
        u = u / np.linalg.norm(u) + noise * rng.normal(size=3)
        u = u if axes is None else axes(at) @ u
        u = u / np.linalg.norm(u)
        t += [at, at]
        value += [np.arctan2(u[1], u[0]) % (2 * np.pi), np.arcsin(u[2])]
    return Observations(
        epoch=EPOCH,
        t=np.array(t),
        value=np.array(value),
        kinds=("right_ascension", "declination"),
        kind=np.tile([0, 1], len(days)),
        participants=(station, "A"),
        station=0,
        object=1,
        segments=(Segment("UTC", frame=frame, angles=angles),),
        sigma=max(noise, 1e-9),
        tag=3,
    )


def test_a_station_is_where_the_earth_is_and_it_on_the_earth():
    place = earth.Place(SITE, EPOCH, about="sun")
    t = 4000.0
    here = earth.body("earth", EPOCH + t, "sun")[0] + earth.Place(SITE, EPOCH).at([EPOCH + t])[0]
    found = np.array(place.value(t))
    assert_allclose(found[:3], here, atol=1e-3)
    moved = np.array(place.value(t + 1.0))[:3] - np.array(place.value(t - 1.0))[:3]
    assert_allclose(found[3:], moved / 2, atol=1e-3)
    assert_allclose(earth.Place(None, EPOCH, about="sun").at([EPOCH])[0], earth.body("earth", EPOCH, "sun")[0], atol=1e-3)
    assert earth.Place(SITE, EPOCH).checksum != place.checksum


@pytest.mark.parametrize("angles", ["astrometric", "geocentric", "apparent"])
def test_directions_are_those_of_light_that_was_sent_before(angles):
    """Astrometric ones are the line; the others are turned by aberration, as ERFA has it."""
    S = earth.sensors
    sensor = S.right_ascension_declination(angles, about="sun")
    forces = earth.Forces(about="sun", bodies=(), relativity=False)
    place = earth.Place(SITE, EPOCH, about="sun")
    problem = pz.Problem(
        forces.model([sensor]),
        pz.Gaussian(STATE, np.eye(6)),
        stations=[pz.Station(**sensor.at(None, EPOCH, 1e-6, name="P", place=place))],
        functions={**forces.functions(EPOCH), **sensor.functions(EPOCH)},
        epoch=EPOCH,
        prior_time=0.0,
    )
    t = 7200.0
    x = np.concatenate(propagate_kepler(STATE[:3], STATE[3:], SUN.mu, t))
    lon, lat = problem.measure("P", x, t)
    found = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    r, velocity = line(t)
    u = r / np.linalg.norm(r)
    if angles != "astrometric":
        if angles == "geocentric":
            one, two = (EPOCH + t).jd("TDB")
            velocity = np.asarray(erfa.epv00(one, two)[1]["v"]) * AU / 86400.0
        beta = velocity / LIGHT
        u = erfa.ab(u, beta, 1e9, np.sqrt(1 - beta @ beta))  # far from the Sun: without its potential
    assert np.linalg.norm(found - u) < 1e-10


def test_slow_directions_with_no_orbit_about_the_earth_are_about_the_sun():
    assert goes_about_the_sun(measured(observations(), [SITE]))


@pytest.mark.slow
def test_so_they_are_of_the_geocentre_and_of_axes_of_date():
    assert goes_about_the_sun(measured(observations(station="500"), None))
    of_date = observations("astrometric", "TOD", axes=lambda t: earth.rotation("ICRF", "TOD", EPOCH + t))
    assert goes_about_the_sun(measured(of_date, [SITE]))


def test_what_moves_fast_or_is_measured_otherwise_is_about_the_earth():
    rows = observations(days=(0, 1, 8, 20))
    same = {name: getattr(rows, name) for name in ("epoch", "kinds", "kind", "participants", "segments", "value", "sigma")}
    fast = Observations(**same, t=rows.t / 2e3, station=0, object=1, tag=3)
    assert not goes_about_the_sun(measured(fast, [SITE]))


def test_only_directions_are_taken_about_the_sun():
    rows = observations()
    ranges = Observations(
        epoch=EPOCH, t=rows.t, value=np.abs(rows.value) * 1e9, kinds=("range",), kind=np.zeros(len(rows), int),
        participants=("PALERMO", "A"), station=0, object=1, segments=(Segment("UTC", way="one-way"),), sigma=1.0, tag=3,
    )  # fmt: skip
    with pytest.raises(ValueError, match="range is not determined from about the Sun"):
        measured(ranges, [SITE], about="sun")


def test_guesses_are_about_their_centre():
    with pytest.raises(ValueError, match="from the centre of the Earth, which is no orbit about it"):
        Guess(EPOCH, STATE[:3], STATE[3:], "--guess")
    given = Guess(EPOCH, STATE[:3], STATE[3:], "--guess", about="sun")
    assert given.about == "sun"
    text = "a=2.77au e=0.08 i=10deg raan=80deg argp=70deg M=10deg epoch=2015-03-01T00:00:00[TDB]"
    with pytest.raises(ValueError, match="no orbit about it"):
        pz.determine(observations(), guess=text.replace("[TDB]", "Z").replace("2.77au", "414e6km"), stations=[SITE])


def test_elements_about_the_sun_are_those_of_the_ecliptic():
    """The pole of the ecliptic is 23.44 degrees from that of the equator; along it nothing is inclined."""
    tilt = np.radians(84381.448 / 3600.0)
    v = np.sqrt(SUN.mu / AU) * np.array([0.0, np.cos(tilt), np.sin(tilt)])
    bias = earth.rotation("EME2000", "GCRF", EPOCH)
    mean = np.concatenate([bias @ [AU, 0.0, 0.0], bias @ v])

    def beliefs(epochs):
        return np.tile(mean, (len(epochs), 1)), np.tile(np.diag([1e6] * 3 + [1e-2] * 3), (len(epochs), 1, 1))

    found = Orbit(EPOCH, "ICRF", beliefs, SUN).elements()
    assert found["frame"] == ECLIPTIC
    assert_allclose(found["mean"][0], AU, rtol=1e-9)
    assert found["mean"][2] < 1e-9
    assert Orbit(EPOCH, "GCRF", beliefs, EARTH).elements()["frame"] == "GCRF"


def ceres_table():
    return read_tracking(CASES / "ceres-1801.txt", sigma="5arcsec")


def test_times_of_palermo_are_its_mean_time_from_noon():
    rows = ceres_table()
    hours = 8 + 43 / 60 + 17.8 / 3600  # after noon of 1 January, 13.3578 degrees east
    jd = sum(rows.instant(0).jd("UT1"))
    assert_allclose(jd, 2378862.0 + hours / 24 - 13.3578 / 360, atol=1e-8)
    delta = sum(rows.instant(0).jd("TT")) - jd
    assert_allclose(delta * 86400, 13.7, atol=1.0)


def test_the_table_is_counted(data_dir):
    """22 nights: one without a time, two declinations in minutes; and the numbers are those of the transcription."""
    rows = ceres_table()
    assert dict(rows.left_out) == {"declinations in minutes only": 2, "nights without a time": 1}
    assert [int(rows.of_kind(kind).sum()) for kind in ("right_ascension", "declination")] == [21, 19]
    print_ = [
        line.split("\t") for line in (data_dir / "earth/ceres-1801/monatliche_correspondenz_1801.tsv").read_text().splitlines()
    ]
    hours = [float(cells[2]) for cells in print_ if cells[2].strip()]
    assert_allclose(np.degrees(rows.value[rows.of_kind("right_ascension")]) / 15, hours, atol=1e-6)
    whole = [float(cells[4]) for cells in print_ if cells[1].strip() and cells[4].strip()]
    assert_allclose(np.degrees(rows.value[rows.of_kind("declination")]), whole, atol=2e-5)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("station = Palermo\n", ""), "no line station"),
        (("axes = TOD", "colour = red"), "'colour' is not known"),
        (("from noon\n", "from midnight\n"), "'local mean time from noon' is known"),
        (("03:27:11.25", "27:27:11.25"), "no sphere"),
        (("08:43:17.8  ", ""), "cells"),
        (("08:43:17.8", "08:73:17.8"), "time is"),
    ],
)
def test_broken_tables_are_refused(tmp_path, change, says):
    path = tmp_path / "table.txt"
    path.write_text((CASES / "ceres-1801.txt").read_text().replace(*change))
    with pytest.raises(ValueError, match=rf"table.txt: line \d+: .*{says}"):
        read_tracking(path)


def jpl(data_dir, name="ANSWER_ceres_heliocentric_jpl_sb441"):
    """Cubic Hermite interpolation of JPL's daily states."""
    table = np.loadtxt(data_dir / f"earth/ceres-1801/{name}.csv", delimiter=",", skiprows=1)

    def at(epoch):
        jd = sum(epoch.jd("TDB"))
        k = int(np.searchsorted(table[:, 0], jd)) - 1
        s, h = jd - table[k, 0], 86400.0
        r0, r1, v0, v1 = (1e3 * table[i, c] for c in (slice(1, 4), slice(4, 7)) for i in (k, k + 1))
        r = (1 + 2 * s) * (1 - s) ** 2 * r0 + s * (1 - s) ** 2 * h * v0 + s**2 * (3 - 2 * s) * r1 + s**2 * (s - 1) * h * v1
        return np.concatenate([r, v0 + s * (v1 - v0)])

    return at


@pytest.mark.slow
def test_an_orbit_about_the_sun_is_found_without_a_word(data_dir):
    """Simulated without planets: the truth is within the covariance, in the axes and the scale that belong to the Sun."""
    found = pz.determine(observations(days=(0, 1, 8, 20, 40), noise=5e-7), stations=[SITE], forces="none")
    assert found.determined and found.setup.measured.about == "sun"
    assert found.frame == "ICRF" and found.scale == "TDB"
    truth = np.concatenate(propagate_kepler(STATE[:3], STATE[3:], SUN.mu, found.epoch - EPOCH))
    off = found.orbit.at() - truth
    assert off @ np.linalg.solve(found.orbit.covariance(), off) < 25.0
    facts = found.to_dict()
    assert facts["about"] == "sun" and facts["frame"] == "ICRF" and facts["epoch"].endswith("TDB")
    arc = found.ephemeris(step=864000.0).arcs[0]
    assert arc.centre == "SUN" and arc.frame == "ICRF"
    with pytest.raises(ValueError, match="mean elements of SGP4 are of orbits about the Earth"):
        found.write("x.tle")
    again = pz.determine(observations(days=(0, 1, 8, 20, 40), noise=5e-7), stations=[SITE], forces="none", guess=facts)
    assert_allclose(again.orbit.at(found.epoch), found.orbit.at(), rtol=1e-6)


DECEMBER = pz.Epoch("1801-12-31T04:48:00 UT1")


@pytest.mark.parametrize(("who", "arcseconds"), [(0, 40.0), (1, 1.0)])
def test_published_orbits_are_read_as_they_were_meant(data_dir, who, arcseconds):
    """Gauss's elements of 1802 lie within 40 arcseconds of JPL's path seen from the Sun; today's osculating ones on it."""
    truth = jpl(data_dir)
    one = split(["ceres-1801"])[1].published[who]
    for date in ("1801-01-02T00:00:00 TT", "1801-02-11T00:00:00 TT"):
        epoch = pz.Epoch(date)
        there = truth(epoch)
        off = np.linalg.norm(one.state(epoch, "sun")[:3] - there[:3]) / np.linalg.norm(there[:3])
        assert np.degrees(off) * 3600 < arcseconds


@pytest.mark.parametrize("who", [0, 1])
def test_a_published_orbit_is_written_as_it_was_read(who):
    one = split(["ceres-1801"])[1].published[who]
    assert published_of(tomllib.loads(toml_text({"published": [one.table()]}))["published"][0], "again") == one


def test_a_published_orbit_that_lacks_something_is_refused(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text((CASES / "ceres-1801.toml").read_text().replace("e = 0.0804785\n", ""))
    with pytest.raises(ValueError, match=r"published\[0\]: a published orbit has name, date"):
        split([str(path)])


def test_a_file_goes_before_a_case_of_that_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(split(["ceres-1801"])[0]) == 1 and split(["ceres-1801"])[1].about == "sun"
    (tmp_path / "ceres-1801").write_text("")
    assert split(["ceres-1801"])[0] == ["ceres-1801"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::piazzi.earth.EOPWarning")  # UT1 of 1801 is by Delta T, which the answer says
def test_ceres_is_found_again(data_dir):
    """From Piazzi's nights alone: JPL's orbit within 2.5 sigma, the place of 31 December within a degree."""
    found = pz.determine("ceres-1801")
    assert found.determined
    truth = jpl(data_dir)
    assert [one["name"] for one in found.to_dict()["published"]] == ["Gauss", "JPL"]
    off = found.orbit.at() - truth(found.epoch)
    assert np.abs(off / np.sqrt(np.diag(found.orbit.covariance()))).max() < 2.5
    assert off @ np.linalg.solve(found.orbit.covariance(), off) < 14.4  # chi-square of six at 97.5 %, two-sided 2.2 sigma
    place = found.ephemeris(station=SITE, when=DECEMBER)
    here = earth.Place(SITE, DECEMBER, about="sun").at([DECEMBER])[0]
    tau = 0.0
    for _ in range(4):
        u = truth(DECEMBER + -tau)[:3] - here
        tau = np.linalg.norm(u) / LIGHT
    true = np.arctan2(u[1], u[0]) % (2 * np.pi), np.arcsin(u[2] / np.linalg.norm(u))
    assert np.degrees(np.linalg.norm(place.off(*true))) < 1.0
    assert place.chi_square(*true) < 9.21  # the ellipse of 99 %; it is outside that of 95 %: errors go with the nights
    assert "Gauss" in str(found) and "1802-09-14" in str(found)


@pytest.mark.slow
def test_what_is_seen_of_an_orbit_about_the_sun():
    """Direction, distance, its rate, motion and height by geometry alone; the ellipse by sigma points of two-body motion."""
    mean = STATE.copy()
    P = np.diag(np.array([4e8, 3e8, 5e8, 60.0, 40.0, 50.0]) ** 2)
    facts = {
        "schema": "piazzi.determine/1", "object": "A", "about": "sun", "epoch": str(EPOCH), "frame": "ICRF",
        "names": ["x", "y", "z", "vx", "vy", "vz"], "mean": mean.tolist(), "covariance": P.tolist(), "estimated": [],
        "forces": {"bodies": [], "relativity": False, "empirical": []},
    }  # fmt: skip
    t = 86400.0 * 30
    sky = pz.ephemeris(facts, SITE, (EPOCH + t, EPOCH + t + 1200.0), step=600.0)
    assert sky.scale == "UTC" and "shadow" not in sky.columns
    r, _ = line(t + 600.0)
    u = r / np.linalg.norm(r)
    assert_allclose(sky["right_ascension"][1], np.arctan2(u[1], u[0]) % (2 * np.pi), atol=1e-9)
    assert_allclose(sky["declination"][1], np.arcsin(u[2]), atol=1e-9)
    assert_allclose(sky["range"][1], np.linalg.norm(r), rtol=1e-9)
    before, after = (line(t + 600.0 + s)[0] for s in (-5.0, 5.0))
    assert_allclose(sky["range_rate"][1], (np.linalg.norm(after) - np.linalg.norm(before)) / 10.0, atol=1e-2)
    a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
    assert_allclose(sky["rate"][1], np.linalg.norm(np.cross(a, b)) / 10.0, rtol=1e-3)
    when = EPOCH + t + 600.0
    local = earth.rotation("GCRF", "ITRF", when) @ u
    lat, lon, _ = SITE.place(when)
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    assert_allclose(sky["elevation"][1], np.arcsin(local @ up), atol=2e-4)  # aberration is 1e-4
    here = earth.body("earth", when, "sun")[0]
    assert_allclose(np.cos(sky["elongation"][1]), -u @ here / np.linalg.norm(here), atol=1e-4)
    there = propagate_kepler(mean[:3], mean[3:], SUN.mu, t + 600.0 - np.linalg.norm(r) / LIGHT)[0]
    points = mean + np.vstack([root := np.sqrt(6.0) * np.sqrt(P), -root])
    off = []
    for x in points:
        w = r + propagate_kepler(x[:3], x[3:], SUN.mu, t + 600.0 - np.linalg.norm(r) / LIGHT)[0] - there
        off.append(sky.off(np.arctan2(w[1], w[0]), np.arcsin(w[2] / np.linalg.norm(w)), 1))
    assert_allclose(sky.covariance(1), np.transpose(off) @ off / 12, rtol=2e-2, atol=2e-2 * sky["ellipse_minor"][1] ** 2 / 9)
    assert_allclose(sky.chi_square(*(np.array([sky["right_ascension"][1], sky["declination"][1]])), 1), 0.0, atol=1e-6)


def test_what_makes_no_sense_about_the_sun_is_refused(tmp_path):
    orbit = Guess(EPOCH, STATE[:3], STATE[3:], "ORBIT", about="sun")
    with pytest.raises(ValueError, match="frequency is that of a satellite"):
        pz.ephemeris(orbit, SITE, EPOCH, frequency=145.9e6)


def test_windows_of_weeks_are_read():
    """A length of more than six digits of seconds, as orbits about the Sun need it."""
    from piazzi.determination.fit import estimators

    (window,) = estimators("window:20d").values()
    assert window.lag_seconds == 20 * 86400.0
