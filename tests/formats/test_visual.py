"""Positions by visual observers: the examples of the descriptions of IOD, UK and RDE reports, and each code of angles."""

import math

import numpy as np
import pytest

import piazzi as pz

ARCSECOND = math.pi / 648000


def put(tmp_path, *lines):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def iod(code="1", epoch="5", first="1122334", second="-112233", time="112233444", accuracy="46"):
    return f"12345 98 123XYZ 2007 S 19981122{time:<9} 56 {code}{epoch} {first:<7}{second:<7} {accuracy}"


def test_example_of_the_iod_description(tmp_path):
    table = pz.read_tracking(put(tmp_path, iod(epoch="4") + " B+MMm Mm SSSsss"))
    assert table.objects == ("12345",) and table.stations == ("2007",) and table.kinds == ("right_ascension", "declination")
    assert abs(table.instant(0) - pz.Epoch("1998-11-22T11:22:33.444 UTC")) < 1e-6
    hours, degrees = 11 + 22 / 60 + 33.4 / 3600, -(11 + 22 / 60 + 33 / 3600)
    np.testing.assert_allclose(table.value, np.radians([15 * hours, degrees]), rtol=1e-14)
    np.testing.assert_allclose(table.sigma, 4e-2 * ARCSECOND)
    np.testing.assert_allclose(table.time_sigma, 5e-2)
    assert table.segments[0].frame == "B1950" and "--angles" in table.open[0]


@pytest.mark.parametrize(
    "code, first, second, values, unit",
    [
        ("1", "1122334", "+112233", [15 * (11 + 22 / 60 + 33.4 / 3600), 11 + 22 / 60 + 33 / 3600], 1),
        ("1", "1122", "+1122", [15 * (11 + 22 / 60), 11 + 22 / 60], 1),
        ("2", "1122334", "+112233", [15 * (11 + 22.334 / 60), 11 + 22.33 / 60], 60),
        ("3", "1122334", "-112233", [15 * (11 + 22.334 / 60), -11.2233], 3600),
        ("4", "1112233", "+112233", [111 + 22 / 60 + 33 / 3600, 11 + 22 / 60 + 33 / 3600], 1),
        ("5", "1112233", "-112233", [111 + 22.33 / 60, -(11 + 22.33 / 60)], 60),
        ("6", "1112233", "+112233", [111.2233, 11.2233], 3600),
        ("7", "1122334", "+112233", [15 * (11 + 22 / 60 + 33.4 / 3600), 11.2233], 3600),
    ],
)
def test_each_code_of_angles(tmp_path, code, first, second, values, unit):
    table = pz.read_tracking(put(tmp_path, iod(code, first=first, second=second)))
    np.testing.assert_allclose(np.degrees(table.value), values, rtol=1e-14)
    np.testing.assert_allclose(table.sigma, 4e-2 * ARCSECOND * unit)
    assert table.kinds[0] == ("azimuth" if code in "456" else "right_ascension")


def test_epochs_of_charts(tmp_path):
    assert pz.read_tracking(put(tmp_path, iod(epoch="5"))).segments[0].frame == "EME2000"
    table = pz.read_tracking(put(tmp_path, iod(epoch="0")))
    assert table.segments[0].frame is None and any("--frame" in text for text in table.open)


def test_reports_without_a_position_are_counted(tmp_path):
    flash = "12345 98 123UNK 2007 F 20081122112233444 28                      V+095 05"
    table = pz.read_tracking(put(tmp_path, iod(), flash))
    assert len(table) == 2 and table.left_out == (("reports without a position", 1),)


def test_reports_in_a_letter(tmp_path):
    lines = (
        "# clock by radio",
        "Site 2007: good sky, some haze until 22h",
        "",
        iod(),
        "> and a flash of another:",
        "12345 98 123XYZ 2007 E 19981122010534264 F flared, P = 3.2 sec.",
        iod().replace(" S ", "   "),
        "12345 98 123XYZ 2007 S 19981122",
    )
    table = pz.read_tracking(put(tmp_path, *lines))
    assert table.line.tolist() == [4, 4, 7, 7]
    assert dict(table.left_out) == {"lines of text between reports": 3, "reports without a position": 2}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_list_of_uk_reports_with_its_end(tmp_path, end):
    line = "8406503987697070622352907  01   12200054  +28239  01  4"
    path = tmp_path / "a.txt"
    path.write_bytes(end.join(["SATOBS", line, line, "999", "regards"]).encode())
    table = pz.read_tracking(path)
    assert table.line.tolist() == [2, 2, 3, 3] and dict(table.left_out) == {"lines of text between reports": 2}


@pytest.mark.parametrize(
    "code, angles, values, unit",
    [
        ("4", "1112233 +112233 ", [111 + 22 / 60 + 33 / 3600, 11 + 22 / 60 + 33 / 3600], 20.0),
        ("5", "11122334 1122334", [111 + 22.334 / 60, 11 + 22.334 / 60], 2.0 * 60),
        ("6", "11122334+1122334", [111.22334, 11.22334], 0.2 * 3600),
    ],
)
def test_azimuths_of_uk_reports(tmp_path, code, angles, values, unit):
    table = pz.read_tracking(put(tmp_path, f"8406503987697070622352907  01   1{code}{angles} 20 4"))
    assert table.kinds == ("azimuth", "elevation")
    np.testing.assert_allclose(np.degrees(table.value), values, rtol=1e-13)
    np.testing.assert_allclose(table.sigma, unit * ARCSECOND, rtol=1e-12)


def test_rde_report_in_a_letter(tmp_path):
    report = ("2420 0405 0.211 1204", "05", "0401203 205744.76 185544+324606 4.0 5.8 3 R", "999")
    table = pz.read_tracking(put(tmp_path, "SATOBS", "", *report, "", "Total (2004) 1241"))
    assert len(table) == 2 and table.stations == ("2420",) and dict(table.left_out) == {"lines of text between reports": 2}


@pytest.mark.parametrize("line", [" " + iod(), ">" + iod(), iod().replace("XYZ 2007", "XYZ 207")])
def test_reports_out_of_their_columns_are_refused(tmp_path, line):
    with pytest.raises(ValueError, match=r"line 2: .* looks like a report, and does not stand in its columns"):
        pz.read_tracking(put(tmp_path, iod(), line))


def test_uk_report(tmp_path):
    line = "8406503987697070622352907  01   12200054  +28239  01  4             +60+70     R"
    table = pz.read_tracking(put(tmp_path, line))
    assert table.objects == ("1984-065C",) and table.stations == ("9876",)
    assert abs(table.instant(0) - pz.Epoch("1997-07-06T22:35:29.07 UTC")) < 1e-6
    np.testing.assert_allclose(np.degrees(table.value), [15 * (20 + 0.54 / 60), 28 + 23.9 / 60], rtol=1e-13)
    np.testing.assert_allclose(table.sigma, 60 * ARCSECOND)
    np.testing.assert_allclose(table.time_sigma, 0.1)
    assert table.segments[0].frame == "B1950"


def test_rde_report(tmp_path):
    lines = (
        "2420 0405 0.211 1204",
        "05",
        "0401203 205744.76 185544+324606 4.0 5.8 3 R",
        "06",
        "0401203 000000.5 000000-000010",
        "999",
    )
    table = pz.read_tracking(put(tmp_path, *lines))
    assert table.objects == ("2004-012C",) and table.stations == ("2420",) and len(table) == 4
    assert abs(table.instant(0) - pz.Epoch("2004-05-05T20:57:44.76 UTC")) < 1e-6
    assert abs(table.instant(2) - pz.Epoch("2004-05-06T00:00:00.5 UTC")) < 1e-6
    hours, degrees = 18 + 55 / 60 + 44 / 3600, 32 + 46 / 60 + 6 / 3600
    np.testing.assert_allclose(np.degrees(table.value), [15 * hours, degrees, 0.0, -10 / 3600], rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(table.sigma, 120 * ARCSECOND)
    np.testing.assert_allclose(table.time_sigma, 0.2)


@pytest.mark.parametrize(
    "line, what",
    [
        (iod("8"), "angle format '8'"),
        (iod(first="11x2334"), "right_ascension is '11x2334'"),
        (iod(first="1172334"), "60 minutes or seconds"),
        (iod(first="2522334"), "is on no sphere"),
        (iod(time="2522"), "25:22:0 is no time"),
        (iod(accuracy="4x"), "accuracy of the position is '4x'"),
        (iod(time="1122334441"), "column 41 has '1' where there is a blank"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, line, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(put(tmp_path, iod(), line))
    assert "a.txt: line 2: " in str(error.value) and "\n" not in str(error.value)
