"""Tables of measurements: the same rows as any other format gives, whatever the columns are called and however they stand."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import formats
from piazzi.earth.geodetic import geodetic_to_position
from tests.waiting import little

T0 = pz.Epoch("2024-05-05T12:00:00 UTC")


def table(tmp_path, text, name="a.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def xyz(rows):
    return rows.value.reshape(-1, 3)


def test_precise_orbits_as_weeks_and_kilometres_are_the_same_fixes(tmp_path, data_dir):
    file = data_dir / "earth/sp3/gps_g01_g05_20150505.sp3"
    given = pz.read_tracking(file)
    given = given[given.object == given.participants.index("G01")]
    past = np.array([given.instant(int(k)) - pz.Epoch("1980-01-06T00:00:00 GPS") for k in range(0, len(given), 3)])
    week = np.floor(past / 604800.0)
    parts = zip(week.tolist(), (past - 604800.0 * week).tolist(), (xyz(given) / 1e3).tolist(), strict=True)
    lines = [f"{w:.0f};{s};{x};{y};{z};ok" for w, s, (x, y, z) in parts]
    path = table(tmp_path, "gps_week;gps_tow;X;Y;Z;flag\n" + "\n".join(lines) + "\n")
    said = "week=gps_week sow=gps_tow x=X[km] y=Y[km] z=Z[km]"
    rows = pz.read_tracking(path, columns=said, scale="GPS", frame="ITRF", sigma="0.1m")
    assert rows.kinds == ("x", "y", "z") and rows.scales == ("GPS",) and rows.open == ()
    assert rows.segments[0].frame == "ITRF" and (rows.sigma == 0.1).all()
    np.testing.assert_allclose(rows.t + (rows.epoch - given.epoch), given.t, atol=1e-6)
    np.testing.assert_allclose(rows.value, given.value, rtol=1e-15)
    assert rows.line.tolist()[:4] == [2, 2, 2, 3]
    assert any("semicolons" in text for text in rows.assumed)


def test_dates_have_the_scale_of_their_column_or_the_one_that_is_said_once(tmp_path):
    body = "\n2024-05-05T12:00:00.5,1,2,3\n2024-05-05T12:00:10.25,4,5,6\n"
    named = pz.read_tracking(table(tmp_path, f"time[UTC],x[km],y[km],z[km]{body}"))
    said = pz.read_tracking(table(tmp_path, f"Time,X[km],Y[km],Z[km]{body}"), scale="GPS")
    open_ = pz.read_tracking(table(tmp_path, f"TIME,x[km],y[km],z[km]{body}"))
    assert np.abs([named.instant(0) - T0 - 0.5, named.instant(3) - T0 - 10.25]).max() < 1e-12
    assert said.instant(0) - named.instant(0) == pytest.approx(-18.0, abs=1e-12)
    assert open_.instant(0) == named.instant(0) and any("--scale UTC" in text for text in open_.open)
    assert not any("--scale" in text for text in (*named.open, *said.open))
    assert xyz(named).tolist() == [[1e3, 2e3, 3e3], [4e3, 5e3, 6e3]]


def test_a_scale_by_station(tmp_path):
    path = table(tmp_path, "time,station,range[km]\n2024-05-05T12:00:00,A,1\n2024-05-05T12:00:00,B,2\n")
    rows = pz.read_tracking(path, time=["A=GPS", "UTC"])
    assert rows.instant(0) - rows.instant(1) == -18.0
    assert [rows.segments[i].scale for i in rows.segment] == ["GPS", "UTC"]


def test_geodetic_places_are_fixes(tmp_path):
    path = table(tmp_path, "time[UTC],latitude [deg],longitude [deg],height [km]\n2024-05-05T12:00:00,48,11,500\n")
    rows = pz.read_tracking(path, sigma="10m")
    assert rows.kinds == ("x", "y", "z") and rows.segments[0].frame == "ITRF" and rows.open == ()
    np.testing.assert_allclose(rows.value, geodetic_to_position(np.radians(48), np.radians(11), 5e5), rtol=1e-15)


def test_stations_objects_sigmas_and_weather(tmp_path):
    head = "time[UTC];station;object;range[km];azimuth[deg];elevation[deg];sigma range[m];pressure[Pa];comment\n"
    rows = pz.read_tracking(
        table(tmp_path, f"{head}2024-05-05T12:00:00;BER;SAT;1000;90;45;7;95000;1\n2024-05-05T12:00:05;BER;SAT;;91;46;;;2\n")
    )
    assert rows.kinds == ("range", "azimuth", "elevation") and rows.stations == ("BER",) and rows.objects == ("SAT",)
    np.testing.assert_allclose(rows.value, [1e6, np.pi / 2, np.pi / 4, np.radians(91), np.radians(46)])
    assert rows.sigma[0] == 7.0 and np.isnan(rows.sigma[1:]).all() and rows.pressure[:3].tolist() == [95000.0] * 3
    assert any("left out: comment" in text for text in rows.assumed)
    assert any("--range one-way, two-way" in text for text in rows.open)
    assert any("standard deviations of azimuth, elevation" in text for text in rows.open)


def test_columns_by_number_without_a_header(tmp_path):
    path = table(tmp_path, "# of a receiver\n2024-05-05T12:00:00 17 7000 0 1\n2024-05-05T12:00:10 17 7000 70 2\n", "a.txt")
    rows = pz.read_tracking(path, columns="time=1 x=3[km] y=4[km] z=5[km]", scale="UTC", frame="GCRF")
    assert xyz(rows).tolist() == [[7e6, 0.0, 1e3], [7e6, 7e4, 2e3]] and rows.line.tolist() == [2] * 3 + [3] * 3


def test_columns_by_letters(tmp_path):
    path = table(tmp_path, "DATE               RANGE \n2024-05-05T12:00:00123456\n\n2024-05-05T12:00:01 23457\n", "a.txt")
    rows = pz.read_tracking(path, columns={"time": "1-19", "range": "20-25[m]"}, scale="UTC", range="two-way")
    assert rows.value.tolist() == [123456.0, 23457.0] and rows.line.tolist() == [2, 4]


def test_names_either_way_round_and_what_is_to_be_ignored(tmp_path):
    path = table(tmp_path, "t,rng [km],y,range_rate\n2024-05-05T12:00:00Z,1,5,6\n")
    for columns in (
        {"time": "t", "rng": "range", "ignore": ["y", "range_rate"]},
        "time=t range=rng ignore=y ignore=range_rate",
    ):
        rows = pz.read_tracking(path, columns=columns)
        assert rows.kinds == ("range",) and rows.value.tolist() == [1e3]


def test_rows_out_of_order_and_twice_are_counted(tmp_path):
    path = table(
        tmp_path, "time[UTC],x[m],y[m],z[m]\n2024-05-05T12:00:10,1,2,3\n2024-05-05T12:00:00,1,2,3\n2024-05-05T12:00:00,1,2,3\n"
    )
    found = formats.summary(pz.read_tracking(path))
    assert found["out_of_order"] == 1 and found["repeated"] == 3


def test_units_that_are_not_named_are_asked_for(tmp_path):
    rows = pz.read_tracking(table(tmp_path, "time[UTC],azimuth,elevation\n2024-05-05T12:00:00,90,45\n"))
    (asked,) = [text for text in rows.open if text.startswith("units")]
    assert asked == 'units of azimuth, elevation: --columns "azimuth=azimuth[rad] elevation=elevation[rad]" or others'
    again = pz.read_tracking(tmp_path / "a.csv", columns="azimuth=azimuth[deg] elevation=elevation[deg]")
    assert not any("units" in text for text in again.open)
    np.testing.assert_allclose(again.value, np.radians([90, 45]))


def test_a_fix_that_lacks_a_coordinate_is_left_out_and_counted(tmp_path):
    path = table(
        tmp_path, "time[UTC],x[m],y[m],z[m]\n2024-05-05T12:00:00,1,,3\n2024-05-05T12:00:10,1,2,3\n2024-05-05T12:00:20,,,\n"
    )
    rows = pz.read_tracking(path)
    assert len(rows) == 3 and rows.left_out == (("fixes with a coordinate missing", 1),)


def test_seconds_past_a_date_above_the_header(tmp_path):
    named = pz.read_tracking(table(tmp_path, "time[s past 2024-05-05T12:00:00 UTC],x[m],y[m],z[m]\n0.5,1,2,3\n"))
    rows = pz.read_tracking(table(tmp_path, "# epoch = 2024-05-05T12:00:00 UTC\ntime,x[m],y[m],z[m]\n0.5,1,2,3\n"))
    assert named.instant(0) == rows.instant(0)
    assert rows.instant(0) == T0 + 0.5


def test_what_is_written_is_read_back_with_its_conventions(tmp_path, data_dir):
    for file in (
        "earth/lageos2/lageos2_20160214.npt",
        "tdm/TDMExample8.txt",
        "earth/geos3/GEOS6a.INP",
        "earth/sp3/gps_g01_g05_20150505.sp3",
    ):
        given = pz.read_tracking(data_dir / file, range="two-way", tag="transmit", sigma=["1m", "1mrad", "1mm/s"])
        given = given[given.measured & given.used & (given.t < given.t[0] + 6 * 3600)]
        path = table(tmp_path, formats.csv_text(given))
        rows = pz.read_tracking(path)
        assert len(rows) == len(given), file
        for kind in given.kinds:
            one, other = given[given.of_kind(kind)], rows[rows.of_kind(kind)]
            if len(one):
                assert np.array_equal(one.value, other.value) and np.array_equal(one.sigma, other.sigma), file
                np.testing.assert_allclose(other.t + (rows.epoch - given.epoch), one.t, rtol=0, atol=2e-9)
        assert {segment.frame for segment in rows.segments} == {segment.frame for segment in given.segments}
        assert [text for text in rows.open if "--range" in text or "--sigma" in text] == [], file


def test_short_names_of_directions_are_those_written_out(tmp_path):
    rows = "2020-01-01T00:00:00,A,10,20,0.5\n2020-01-01T00:01:00,A,11,21,0.5\n"
    files = [
        "time[UTC],station,azimuth[deg],elevation[deg],sigma_azimuth[deg]\n",
        "time[UTC],station,Az[deg],EL [deg],sigma_az[deg]\n",
    ]
    written, short = (pz.read_tracking(table(tmp_path, head + rows)) for head in files)
    assert short.kinds == written.kinds == ("azimuth", "elevation")
    for name in ("value", "sigma", "t"):
        np.testing.assert_array_equal(getattr(short, name), getattr(written, name))
    said = pz.read_tracking(table(tmp_path, files[1] + rows), columns="azimuth=Az[deg] ignore=EL")
    assert said.kinds == ("azimuth",) and said.value[0] == written.value[0]
    both = pz.read_tracking(table(tmp_path, "time[UTC],station,azimuth[deg],az[deg]\n2020-01-01T00:00:00,A,10,20\n"))
    assert np.degrees(both.value).tolist() == pytest.approx([10.0]) and any("left out: az" in text for text in both.assumed)


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        ("a,b\n1,2\n", "no format that is known", {}),
        ("time[UTC],x[m],y[m]\n2024-05-05T12:00:00,1,2\n", "there is no column 'z'", {}),
        ("time[UTC],latitude[deg],longitude[deg]\n2024-05-05T12:00:00,1,2\n", "there is no column 'height'", {}),
        ("time[UTC],right_ascension[h]\n2024-05-05T12:00:00,1\n", "hours of right ascension are 15 deg each", {}),
        ("time[UTC],range[s]\n2024-05-05T12:00:00,1\n", "range is in m", {}),
        ("time[UTC],range[m]\n2024-05-05T12:00:00,1\n2024-05-05T12:00:0x,2\n", "line 3", {}),
        ("time[UTC],range[m]\n2024-05-05T12:00:00,abc\n", "line 2: range is 'abc'", {}),
        ("time[UTC],range[m]\n2024-05-05T12:00:00,inf\n", "line 2: range is inf", {}),
        ("time,range[m]\n12,1\n", "# epoch = ", {}),
        ("time[UTC],range[m]\n2024-05-05T12:00:00,\n", "no measurements", {}),
        ("T,range[m]\n2024-05-05T12:00:00,1\n", "there is no column 'RNG'; known: T, range[m]", {"columns": "range=RNG"}),
        ("T,range[m]\n2024-05-05T12:00:00,1\n", 'no column \'time\'', {"columns": "range=range"}),
        ("T,range[m]\n2024-05-05T12:00:00,1\n", "did you mean 'range'", {"columns": "rnge=range time=T"}),
        ("week,sow,range[m]\n1.5,0,1\n", "line 2: the week is 1.5", {}),
        ("time,station,range[m]\n2024-05-05T12:00:00 UTC,A,1\n2024-05-05T12:00:00 GPS,B,1\n", "one file has one scale", {}),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, text, words, said):
    path = table(tmp_path, text)
    with pytest.raises(ValueError, match="^" + str(path)) as refused:
        pz.read_tracking(path, **said)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_a_million_lines_in_three_seconds(tmp_path):
    lines = "\n".join(
        f"2024-05-{1 + k // 86400:02d}T{k // 3600 % 24:02d}:{k // 60 % 60:02d}:{k % 60:02d},7{k:06d}.25" for k in range(100_000)
    )
    path = table(tmp_path, "time[UTC],range[m]\n" + lines + "\n")
    pz.read_tracking(path)  # imports and tables
    assert len(little(lambda: pz.read_tracking(path), 0.3)) == 100_000  # a tenth of the lines


@pytest.mark.parametrize(
    "name, first, instant",
    [
        ("time[MJD UTC]", "58130.5", "2018-01-12T12:00:00 UTC"),
        ("time[JD TDB]", "2458131.0", "2018-01-12T12:00:00 TDB"),
        ("time[jd]", "2458131.0", "2018-01-12T12:00:00 GPS"),
        ("time", "2018/01/12 12:00:00", "2018-01-12T12:00:00 GPS"),
    ],
)
def test_julian_days_and_dates_with_strokes(tmp_path, name, first, instant):
    path = tmp_path / "a.csv"
    path.write_text(f"{name},station,azimuth[deg],elevation[deg]\n{first},A,10,20\n{first},B,11,20\n")
    table = pz.read_tracking(path, scale=None if " " in name else "GPS")
    assert abs(table.instant(3) - pz.Epoch(instant)) < 1e-9 and table.stations == ("A", "B")


def test_julian_days_of_many_rows(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(f"{58130 + i / 4096!r},A,{i},20\n" for i in range(40_000))
    path.write_text("time[MJD UTC],station,range[m],azimuth[deg]\n" + rows)
    table = pz.read_tracking(path, range="one-way")
    days = table.t[table.of_kind("range")] / 86400
    np.testing.assert_allclose(days - days[0], np.arange(40_000) / 4096, atol=1e-12)


@pytest.mark.parametrize(
    "name, first, instant",
    [
        ("time[unix]", "1502628669.25", "2017-08-13T12:51:09.25 UTC"),  # 17391 days of 86400 s and 46269.25 s
        ("time[s past 2017-08-13T12:51:00 UTC]", "9.25", "2017-08-13T12:51:09.25 UTC"),
    ],
)
def test_seconds_past_a_date(tmp_path, name, first, instant):
    path = tmp_path / "a.csv"
    path.write_text(f"when,x[km],y[km],z[km]\n{first},7000,0,0\n")
    table = pz.read_tracking(path, columns=f"time=when{name.removeprefix('time')}", frame="ITRF")
    assert abs(table.instant(0) - pz.Epoch(instant)) < 1e-6
    with pytest.raises(ValueError, match="seconds past 1970 are Unix time to most"):
        pz.read_tracking(path, columns="time=when[s past 1970-01-01T00:00:00 UTC]")
    with pytest.raises(ValueError, match=r"the times are numbers, .* time=T\[unix\]"):
        pz.read_tracking(path, columns="time=when")


def test_times_in_a_unit_that_is_no_scale(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time[day],station,range[m]\n58130.5,A,10\n")
    with pytest.raises(ValueError, match=r"column 'time\[day\]' is no time: .* time\[MJD UTC\]"):
        pz.read_tracking(path)
