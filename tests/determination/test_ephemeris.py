"""What a station sees of an orbit, and when: the sensors of tracking, passes, nights, shadow, and how sure it is."""

import json

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.cli.courses import course_of as propagated
from piazzi.determination import Guess
from piazzi.determination.course import course_of
from piazzi.determination.determining import prepared, solved
from piazzi.determination.ephemerides import ephemeris
from piazzi.determination.fit import estimators
from piazzi.determination.looking import LIT, SUN_RADIUS, elevation_of, shadow, where
from piazzi.determination.passing import passages, span_of, tonight
from piazzi.evaluate.information import predicted
from piazzi.formats import Observations, Segment
from piazzi.problem.inputs import prepare

EPOCH = pz.Epoch("2016-02-13T12:00:00 UTC")
STATE = np.array([9643000.0, 6000000.0, 4600000.0, -3600.0, 4000.0, 1800.0])  # m, m/s, GCRF: near 12,000 km
SITE = earth.Station.geodetic("SITE", 0.6, 0.3, 100.0, mask=0.2)
SECOND = 1e-6  # rad: of directions below


def test_an_orbit_as_text_is_called_what_the_command_calls_it():
    with pytest.raises(ValueError, match=r"^ORBIT: of which date is it"):
        course_of("a=7078km", EPOCH)
    with pytest.raises(ValueError, match=r"^ORBIT has no e, i, raan, argp"):
        course_of("a=7078km nu=1deg epoch=2026-11-03T04:12:00Z", EPOCH)


def test_two_line_elements_that_are_old_say_so(tmp_path):
    lines = (
        "1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",
        "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537",
    )
    (tmp_path / "x.tle").write_text("\n".join(lines) + "\n")
    new, old = (course_of(tmp_path / "x.tle", pz.Epoch(f"{year}-09-21T00:00:00 UTC")) for year in (2008, 2011))
    assert not any("days away" in text for text in new.assumed)
    assert any("elements that are 1,09" in text and "days away" in text for text in old.assumed)


# ---- without kernels -------------------------------------------------------------------------------------------------


def test_passes_of_a_wave_are_found_and_those_shorter_than_the_looks():
    """Culminations and crossings of an elevation in closed form; the second pass lasts 8 s, looks are 60 s apart."""
    tops, widths = np.array([1000.0, 3010.0, 5000.0]), np.array([300.0, 4.0, 500.0])

    def mount(t):
        elevation = np.max(0.5 * (1.0 - ((t[:, None] - tops) / widths) ** 2) * [1.0, 0.001, 1.0], axis=1)
        return np.stack([t * 1e-3, elevation], -1)

    found = passages(mount, np.arange(0.0, 5400.1, 60.0), 0.0)
    assert [one.culmination.time for one in found] == pytest.approx([1000.0, 3010.0, 5000.0], abs=1e-2)
    assert [one.rise.time for one in found] == pytest.approx([700.0, 3006.0, 4500.0], abs=1e-3)
    assert [one.set.time if one.set else None for one in found[:2]] == pytest.approx([1300.0, 3014.0], abs=1e-3)
    assert found[2].set is None and found[0].culmination.elevation == pytest.approx(0.5)


def test_a_pass_that_is_always_up_neither_rises_nor_sets():
    found = passages(lambda t: np.stack([0 * t, 0.5 + 1e-4 * np.sin(t)], -1), np.arange(0.0, 600.1, 60.0), 0.1)
    assert len(found) == 1 and found[0].rise is None and found[0].set is None


def test_tonight_is_while_the_sun_is_six_degrees_down():
    now = pz.Epoch("2026-03-20T11:00:00 UTC")
    first, last = tonight(SITE, now)
    ends = np.degrees(elevation_of("sun", SITE, [first, last]))
    assert ends == pytest.approx([-6.0, -6.0], abs=0.3) and 9 * 3600 < last - first < 12 * 3600
    within = first + 3600.0
    assert tonight(SITE, within)[0] == within
    north = earth.Station.geodetic("NORTH", np.radians(78.0), 0.3, 0.0)
    with pytest.raises(ValueError, match="no night comes"):
        tonight(north, pz.Epoch("2026-06-21T00:00:00 UTC"))


def test_spans_are_read():
    first, last = span_of("2026-03-20T11:00:00Z .. +6h", SITE)
    assert last - first == 21600.0
    assert span_of("2026-03-20T11:00:00Z", SITE) == (first, first)
    for wrong, says in (
        ("2026-03-20T11:00:00 .. +6h", "scale"),
        ("tomorrow", "when"),
        ("2026-03-20T11:00:00Z .. 2026-03-19T11:00:00Z", "ends"),
    ):
        with pytest.raises(ValueError, match=says):
            span_of(wrong, SITE)


def test_shadow_is_a_cone_behind_the_earth():
    """Along the axis of the shadow and off it, by similar triangles."""
    sun = earth.body("sun", [EPOCH])[0][0]
    away = -sun / np.linalg.norm(sun)
    across = np.cross(away, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    R, d, far = 6378137.0, 42e6, np.linalg.norm(sun)
    umbra, penumbra = R - (SUN_RADIUS - R) * d / far, R + (SUN_RADIUS + R) * d / far
    offs = np.array([0.0, umbra - 3e4, umbra + 3e4, penumbra - 3e4, penumbra + 3e4])
    places = d * away + offs[:, None] * across
    found = [LIT[k] for k in shadow(np.vstack([places, -d * away]), [EPOCH] * 6)]
    assert found == ["umbra", "umbra", "penumbra", "penumbra", "sunlit", "sunlit"]


def test_stations_are_found_and_refused():
    assert where("7090", None).name.startswith("7090")
    place = where("lat=50.1deg lon=8.6deg height=100m mask=10deg", None)
    assert place.mask == pytest.approx(np.radians(10.0)) and place.place()[0] == pytest.approx(np.radians(50.1))
    for wrong, says in (
        ("nowhere", "no station nowhere"),
        ("lat=50.1deg", "lon"),
        ("lat=100deg lon=0deg", "between"),
        ("lat=1 lon=2", "unit"),
    ):
        with pytest.raises(ValueError, match=says):
            where(wrong, None)


# ---- with kernels ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found():
    """Right ascensions, elevations, ranges and rates at the reception, of a station, and what was determined of them."""
    t = np.arange(0.0, 5400.0, 90.0)
    kinds = ("right_ascension", "declination", "azimuth", "elevation", "range", "range_rate")
    n, J = len(kinds), len(t)
    rows = Observations(
        epoch=EPOCH,
        t=np.repeat(t, n),
        value=np.tile([0.5, 0.5, 0.5, 0.5, 1e7, 10.0], J),
        kinds=kinds,
        kind=np.tile(np.arange(n), J),
        participants=("SITE", "SAT"),
        station=0,
        object=1,
        segments=(Segment("UTC", way="one-way", tag="receive", angles="astrometric", frame="GCRF"),),
        sigma=np.tile([1e-6, 1e-6, 1e-6, 1e-6, 1.0, 1e-3], J),
    )
    made = prepared(
        rows, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations=[SITE], forces="none", corrections="applied"
    )
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    rng = np.random.default_rng(3)
    noise = np.sqrt(np.diagonal(made.problem.station_noise, axis1=1, axis2=2)[made.tracking.stations_of(made.problem)])
    tracking = pz.Tracking(
        made.tracking.row_times, z + noise * rng.standard_normal(z.shape), made.tracking.row_stations, epoch=made.tracking.epoch
    )
    from dataclasses import replace

    return solved(replace(made, tracking=tracking), estimators(("graph",)))


@pytest.mark.slow
def test_predicted_is_computed_of_the_same_row(found):
    """Every row of the fit, seen by the ephemeris at its time: the difference is rounding."""
    times = found.setup.tracking.row_times
    sky = ephemeris(found, SITE, (EPOCH, EPOCH + float(times[-1])), step=90.0)
    assert np.allclose(sky.t + (sky.course.epoch - EPOCH), np.unique(times) - times[0], atol=1e-9)
    rows = found.residuals
    for kind, within in {
        "range": 1e-6,
        "range_rate": 1e-9,
        "declination": 1e-13,
        "right_ascension": 1e-13,
        "azimuth": 1e-13,
        "elevation": 1e-13,
    }.items():
        own = rows["kind"].values == kind
        off = rows["computed"].values[own] - sky[kind]
        assert own.sum() == len(sky.t)
        turns = 0.0 if "range" in kind else 2.0 * np.pi * np.round(off / (2.0 * np.pi))
        assert np.abs(off - turns).max() < within, kind


@pytest.mark.slow
def test_a_file_of_a_determination_says_the_same(found, tmp_path):
    found.write(tmp_path / "fit.json")
    found.write(tmp_path / "fit.nc")
    when = (EPOCH - 3600.0, EPOCH + 7200.0)
    here = ephemeris(found, SITE, when, step=600.0)
    for name in ("fit.json", "fit.nc"):
        there = ephemeris(tmp_path / name, SITE, when, step=600.0)
        assert there["range"] == pytest.approx(here["range"], abs=1e-4)
        assert there["declination"] == pytest.approx(here["declination"], abs=1e-11)
        assert there["along_track_sigma"] == pytest.approx(here["along_track_sigma"], rel=1e-6)
        assert there["ellipse_major"] == pytest.approx(here["ellipse_major"], rel=1e-6)
        carried = propagated(str(tmp_path / name), None, None, None).at(np.array([-3600.0, 7200.0]))
        for k, epoch in enumerate((found.epoch - 3600.0, found.epoch + 7200.0)):
            assert carried.mean[k, :3] == pytest.approx(found.orbit.at(epoch)[:3], abs=1e-4)
            assert carried.covariance[k] == pytest.approx(found.orbit.covariance(epoch), rel=1e-5, abs=1e-9)
    json.dumps(here.to_dict(), allow_nan=False)


@pytest.mark.slow
def test_motion_ellipse_frequency_and_sigma_along_the_track(found):
    """Against differences of rows a second apart, a sample of orbits, the definition of Doppler, and distance over speed."""
    sky = ephemeris(found, SITE, (EPOCH + 600.0, EPOCH + 604.0), step=2.0, frequency=435e6)
    ra, dec = np.unwrap(sky["right_ascension"]), sky["declination"]
    east, north = (ra[2] - ra[0]) / 4.0 * np.cos(dec[1]), (dec[2] - dec[0]) / 4.0
    assert sky["rate"][1] == pytest.approx(np.hypot(east, north), rel=1e-5)
    assert sky["position_angle"][1] == pytest.approx(np.arctan2(east, north) % (2 * np.pi), abs=1e-5)
    slope = (sky["range"][2] - sky["range"][0]) / 4.0
    assert sky["range_rate"][1] == pytest.approx(slope, abs=1e-3)
    assert sky["frequency"][1] == pytest.approx(435e6 * (1 - slope / 299792458.0), abs=1.0)  # but for the clocks, 0.2 Hz
    mean, P = (a[0] for a in sky.course.beliefs(sky.t[1:2]))
    along = mean[3:] / np.linalg.norm(mean[3:])
    assert sky["along_track_sigma"][1] == pytest.approx(np.sqrt(along @ P[:3, :3] @ along) / np.linalg.norm(mean[3:]), rel=1e-9)
    # directions of a sample of positions, from the place of the station, without light time, which all of them share
    sample = np.random.default_rng(0).multivariate_normal(np.zeros(3), 1e6 * P[:3, :3], 20000)  # a thousandfold, for digits
    here = earth.transform(SITE.position(sky.epochs[1]), None, "ITRF", "GCRF", sky.epochs[1])[0]
    line = mean[:3] - here + sample
    lon, lat = np.arctan2(line[:, 1], line[:, 0]), np.arcsin(line[:, 2] / np.linalg.norm(line, axis=1))
    spread = np.cov(np.stack([(lon - lon.mean()) * np.cos(lat.mean()), lat])) / 1e6
    values = np.sqrt(np.linalg.eigvalsh(spread))
    assert [sky["ellipse_minor"][1], sky["ellipse_major"][1]] == pytest.approx(3.0 * values, rel=0.05)


@pytest.mark.slow
def test_passes_rise_where_the_geometry_says(found):
    """Against the elevation of the orbit seen every second by the station's own look, without light time."""
    when = (EPOCH, EPOCH + 43200.0)
    sky = ephemeris(found, SITE, when, passes=True)
    t = np.arange(0.0, 43200.0, 1.0)
    epochs = [EPOCH + float(x) for x in t]
    states = sky.course.beliefs(t + (EPOCH - sky.course.epoch))[0]
    elevation = SITE.look(earth.transform(states[:, :3], None, "GCRF", "ITRF", epochs)[0], epochs)[1]
    up = elevation > SITE.mask
    rises = t[1:][up[1:] & ~up[:-1]]
    assert len(sky.passes) == len(rises) + up[0] and len(rises)
    found_rises = [p.rise.time - (EPOCH - sky.course.epoch) for p in sky.passes if p.rise]
    assert found_rises == pytest.approx(rises, abs=1.1)  # to the second of the looks
    for p in sky.passes:
        for edge in (p.rise, p.set):
            assert edge is None or edge.elevation == pytest.approx(SITE.mask, abs=1e-6)
        assert p.culmination.elevation >= SITE.mask


@pytest.mark.slow
def test_a_prediction_for_lasers_is_read_back(found, tmp_path):
    sky = ephemeris(found, SITE, (EPOCH, EPOCH + 3600.0), step=300.0)
    sky.write(tmp_path / "next.cpf")
    arc = pz.read_ephemeris(tmp_path / "next.cpf").arcs[0]
    assert len(arc) == 13 and arc.frame == "ITRF"
    states = np.array([found.orbit.to("ITRF").at(arc.instant(k)) for k in range(13)])
    assert np.abs(arc.position - states[:, :3]).max() < 1e-3
    sky.write(tmp_path / "sky.csv")
    lines = (tmp_path / "sky.csv").read_text().splitlines()
    assert len(lines) == 14 and lines[0].startswith("time[UTC],station,right_ascension[deg],declination[deg],azimuth[deg]")


@pytest.mark.slow
def test_rows_of_a_file_are_not_left(found, tmp_path):
    found.write(tmp_path / "orbit.oem", span="first .. last", step=60.0)
    inside = ephemeris(tmp_path / "orbit.oem", SITE, (EPOCH + 100.0, EPOCH + 1000.0), step=100.0)
    same = ephemeris(found, SITE, (EPOCH + 100.0, EPOCH + 1000.0), step=100.0)
    assert inside["range"] == pytest.approx(same["range"], abs=1e-2)
    assert inside["ellipse_major"] == pytest.approx(same["ellipse_major"], rel=0.2)
    with pytest.raises(ValueError, match="has no state of SAT"):
        ephemeris(tmp_path / "orbit.oem", SITE, (EPOCH, EPOCH + 86400.0))


def test_what_is_no_orbit_is_refused(tmp_path):
    (tmp_path / "other.json").write_text('{"schema": "something"}')
    with pytest.raises(ValueError, match="not a determination"):
        course_of(tmp_path / "other.json", EPOCH)
    with pytest.raises(ValueError, match="epoch"):
        course_of("a=7078km e=0 i=0deg raan=0deg argp=0deg nu=0deg", EPOCH)
    with pytest.raises(OSError, match="nowhere"):
        course_of(str(tmp_path / "nowhere.oem"), EPOCH)
