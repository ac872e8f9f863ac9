"""Observations of space surveillance: values by hand from the files of GEOS-3, signs over digits, exponents; plain columns."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piazzi as pz
from piazzi.formats.b3 import overpunched


def b3(kind, *, second=30000, up="060499", around="0161932", mantissa="2047502", exponent="2", rest=""):
    """A line of object 7734 by sensor 932 at 1995-01-29T02:38:30 UTC."""
    line = f"U07734932950290238{second:05d}{up:>6} {around:>7} {mantissa:>7}{exponent}"
    return line.ljust(46) + rest.ljust(28) + kind


def put(tmp_path, *lines):
    path = tmp_path / "a.obs"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_geos_3_by_one_radar(data_dir):
    """370 lines of type 2, 27 of them with an exponent of 1 where 2 is meant: the first is line 68, by hand."""
    path = data_dir / "earth" / "geos3" / "7734.OBS"
    table = pz.read_tracking(path)
    assert len(table) == 3 * 370 and table.kinds == ("range", "azimuth", "elevation")
    assert table.stations == ("932",) and table.objects == ("7734",) and table.scales == ("UTC",)
    assert abs(table.instant(0) - pz.Epoch("1995-01-29T02:38:37 UTC")) < 1e-9
    assert abs(table.instant(1109) - pz.Epoch("1995-02-02T04:57:26 UTC")) < 1e-9
    np.testing.assert_allclose(table.value[:3], [2047502.0, math.radians(60.4991), math.radians(16.1932)], rtol=1e-14)
    np.testing.assert_allclose(table.value[-3:], [2689654.0, math.radians(248.7107), math.radians(7.0076)], rtol=1e-14)
    assert table.assumed[0] == "ranges are half of the way there and back"
    wrong = ~table.used
    assert wrong.sum() == 27 and set(table.kind[wrong]) == {0} and table.line[wrong][0] == 68
    assert any("27 ranges" in text and "--repair exponent" in text for text in table.open)
    texts = path.read_text().split("\n")
    assert table.line[wrong].tolist() == [k for k, text in enumerate(texts, 1) if text[45:46] == "1"]


def test_exponents_are_mended_when_asked_for(data_dir):
    path = data_dir / "earth" / "geos3" / "7734.OBS"
    raw, mended = pz.read_tracking(path), pz.read_tracking(path, repair="exponent")
    wrong = ~raw.used
    assert mended.used.all() and not any("repair" in text for text in mended.open)
    assert any("27 ranges" in text and "mended" in text for text in mended.assumed)
    np.testing.assert_allclose(mended.value[wrong], 10 * raw.value[wrong], rtol=1e-15)
    np.testing.assert_array_equal(mended.value[~wrong], raw.value[~wrong])
    assert mended.value[mended.of_kind("range")].min() > 8e5
    with pytest.raises(ValueError, match="repair 'all' is not known"):
        pz.read_tracking(path, repair="all")


@pytest.mark.parametrize(
    "name, rows, last", [("GEOS5.INP", 46, "02:47:33"), ("GEOS6a.INP", 46, "02:47:33"), ("geos5t.inp", 44, "02:47:33")]
)
def test_plain_columns(data_dir, name, rows, last):
    table = pz.read_tracking(data_dir / "earth" / "geos3" / name)
    assert len(table) == 3 * rows and table.stations == ("932",) and table.objects == ("7734",)
    assert abs(table.instant(0) - pz.Epoch("1995-01-29T02:38:37 UTC")) < 1e-9
    assert abs(table.instant(3 * rows - 1) - pz.Epoch(f"1995-01-29T{last} UTC")) < 1e-9
    np.testing.assert_allclose(table.value[:3], [2047502.0, math.radians(60.4991), math.radians(16.1932)], rtol=1e-14)


@pytest.mark.parametrize(
    "line, kinds, values",
    [
        (b3("0", rest=" 0123456"), ["range_rate"], [1234.56]),
        (b3("0", rest=" .123456"), ["range_rate"], [-1234.56]),
        (b3("0", rest=" 012345O"), ["range_rate"], [-1234.56]),
        (b3("1"), ["azimuth", "elevation"], np.radians([16.1932, 6.0499])),
        (b3("1", up="06049R"), ["azimuth", "elevation"], np.radians([16.1932, -6.0499])),
        (b3("1", up="06049}"), ["azimuth", "elevation"], np.radians([16.1932, -6.0490])),
        (b3("2", exponent="3"), ["range", "azimuth", "elevation"], [20475020.0, *np.radians([16.1932, 6.0499])]),
        (b3("3", rest=" 0123456"), ["range", "range_rate", "azimuth", "elevation"],
         [2047502.0, 1234.56, *np.radians([16.1932, 6.0499])]),
        (b3("4", rest=" 0123456"), ["range", "range_rate", "azimuth", "elevation"],
         [2047502.0, 1234.56, *np.radians([16.1932, 6.0499])]),
        (b3("5", up="30500J", around="1230305"), ["right_ascension", "declination"],
         np.radians([15 * (12 + 30 / 60 + 30.5 / 3600), -30.5001])),
        (b3("6"), ["range"], [2047502.0]),
    ],
)  # fmt: skip
def test_each_type(tmp_path, line, kinds, values):
    table = pz.read_tracking(put(tmp_path, line))
    assert [table.kinds[k] for k in table.kind] == kinds
    np.testing.assert_allclose(table.value, values, rtol=1e-14)
    assert ("--frame" in " ".join(table.open)) == ("declination" in kinds)


@pytest.mark.parametrize("kind, first", [("8", "azimuth"), ("9", "right_ascension")])
def test_sensors_in_space(tmp_path, kind, first):
    line = b3(kind, around="1230305", mantissa="       ", exponent=" ", rest="00123456700234567R03456789}"[:27])
    table = pz.read_tracking(put(tmp_path, line))
    assert len(table) == 2 and table.kinds[0] == first
    np.testing.assert_allclose(table.places, [[1234567.0, -2345679.0, -34567890.0]])
    assert table.place.tolist() == [0, 0] and set(table.extra["place_axes"]) == {"ITRF"}


@given(st.integers(-(10**8), 10**8))
def test_signs_over_the_last_digit(value):
    digits = f"{abs(value):09d}"
    text = digits if value >= 0 else digits[:-1] + "}JKLMNOPQR"[int(digits[-1])]
    assert overpunched(text, "x") == value
    assert overpunched(digits[:-1] + "{ABCDEFGHI"[int(digits[-1])], "x") == abs(value)


@pytest.mark.parametrize(
    "line, what",
    [
        (b3("2")[:46], "line 2: an observation has 75 columns and more; this line has 46"),
        (b3("7"), "line 2: type '7' in column 75"),
        (b3("2").replace("95029", "95366"), "line 2: the year 1995 has no day 366"),
        (b3("2").replace("0238", "2538"), "line 2: 25:38:30 is no time"),
        (b3("1", up="910000"), "line 2: elevation or declination 91 deg"),
        (b3("1", up="06X499"), "line 2: elevation or declination is '06X499'"),
        (b3("1", around="3700000"), "line 2: azimuth 370 deg"),
        (b3("5", around="2561000"), "line 2: right ascension is '2561000'"),
        (b3("2", mantissa="20x7502"), "line 2: range is '20x7502'"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, line, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(put(tmp_path, b3("2"), line))
    assert "a.obs: line 2: " in str(error.value) and "\n" not in str(error.value)
