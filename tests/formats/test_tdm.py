"""Tracking Data Messages: what stands in the files, written down by hand, and broken files refused with their line."""

import math
import random

import ccsds_ndm
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.formats import Correction

DEGREE = math.pi / 180
GOOD = {
    "TDMExample2": {
        "rows": 7, "first": "2005-06-08T17:41:00 UTC", "last": "2005-06-08T17:41:05 UTC",
        "values": (32023442781.733, 32021035200.0 - 218.7951), "kinds": ("transmit_frequency", "receive_frequency"),
        "participants": ("DSS-25", "yyyy-nnnA"), "path": ("yyyy-nnnA", "DSS-25"), "way": "one-way", "mode": "sequential",
        "roles": ("DSS-25", "yyyy-nnnA"), "interval": (1.0, "middle"), "quality": "raw",
        "delays": (("transmit DSS-25", 7.7e-5), ("receive DSS-25", 7.7e-5)), "frequencies": (("offset", 32021035200.0),),
    },
    "TDMExample4": {
        "rows": 20, "first": "2005-07-10T00:31:51 UTC", "last": "2005-07-10T00:58:24 UTC",
        "values": (7180064367.3536, 30.48199),
        "kinds": ("transmit_frequency", "transmit_frequency_rate", "range_ru", "ranging_to_noise"),
        "participants": ("DSS-24", "yyyy-nnnA"), "path": ("DSS-24", "yyyy-nnnA", "DSS-24"), "way": "two-way",
        "mode": "sequential", "roles": ("DSS-24", "yyyy-nnnA"), "interval": (None, "start"), "range_modulus": 2e26,
        "range_mode": "coherent", "corrections": (Correction("range", 46.7741, True),),
    },
    "TDMExample6": {
        "rows": 20, "first": "1998-06-10T00:57:37 UTC", "last": "1998-06-10T00:57:44 UTC",
        "values": (80452754.2, 2287487999.0),
        "kinds": ("range", "azimuth", "elevation", "transmit_frequency", "receive_frequency"),
        "participants": ("NORTH", "F07R07", "E7"), "path": ("NORTH", "F07R07", "E7", "F07R07", "NORTH"), "way": "relayed",
        "mode": "sequential", "roles": ("NORTH", "E7"), "range_modulus": 1000.0, "range_mode": "constant",
        "corrections": (Correction("range", 2000.0, True),),
    },
    "TDMExample8": {
        "rows": 21, "first": "2007-08-29T07:00:02 UTC", "last": "2007-08-29T13:00:02 UTC",
        "values": (-1498.776048, 8.78254167 * DEGREE), "participants": ("HBSTK", "SAT", "WHM1"),
        "kinds": ("range_rate_averaged", "x_south", "y_east", "range", "azimuth", "elevation"),
        "path": ("HBSTK", "SAT", "HBSTK"), "way": "two-way", "mode": "sequential", "roles": ("HBSTK", "SAT"),
        "interval": (1.0, "end"), "quality": "raw",
    },
    "TDMExample15": {
        "rows": 21, "first": "2005-05-22T12:00:00 UTC", "last": "2005-05-25T12:00:00 UTC", "values": (9.56e-7, -1.759e-6),
        "kinds": ("clock_bias", "clock_drift"), "participants": ("DSS-10", "UTC-NIST", "DSS-40", "DSS-60"), "path": None,
        "way": None, "mode": None, "roles": ("DSS-10", None),
    },
}  # fmt: skip
BROKEN = {
    "kvn/TDM-data-inconsistent-line.txt": (25, "'RECEIVE_FREQ_1 = 2005-159T17:41:02 -333.0551 this-should-not"),
    "kvn/TDM-data-number-format-error.txt": (26, "RECEIVE_FREQ_1: 'this-is-not-a-number' is no number"),
    "kvn/TDM-data-wrong-keyword.txt": (26, "'WRONG_KEYWORD' is no keyword of the data"),
    "kvn/TDM-inconsistent-time-systems.txt": (29, "TIME_SYSTEM is TCG, and UTC in line 12"),
    "kvn/TDM-issue963.txt": (25, "this-should-not"),
    "kvn/TDM-metadata-number-format-error.txt": (17, "TRANSMIT_DELAY_1 is 'this-is-not-a-number'; it must be a number"),
    "kvn/TDM-metadata-timesystem-not-implemented.txt": (7, "TIME_SYSTEM is 'WRONG-TIME-SYSTEM'"),
    "kvn/TDM-metadata-wrong-keyword.txt": (16, "'WRONG_KEYWORD' is no keyword of the metadata"),
    "xml/TDM-data-inconsistent-block.xml": (32, "'TRANSMIT_FREQ_2' is in an observation without EPOCH"),
    "xml/TDM-data-number-format-error.xml": (47, "'this-is-not-a-number' is no number"),
    "xml/TDM-data-wrong-keyword.xml": (47, "'WRONG_KEYWORD' is no keyword of the data"),
    "xml/TDM-external-doctype.xml": (2, "DOCTYPE"),
    "xml/TDM-inconsistent-time-systems.xml": (57, "TIME_SYSTEM is TCG, and UTC in line 18"),
    "xml/TDM-metadata-number-format-error.xml": (24, "TRANSMIT_DELAY_1 is 'this-is-not-a-number'"),
    "xml/TDM-metadata-timesystem-not-implemented.xml": (14, "TIME_SYSTEM is 'WRONG-TIME-SYSTEM'"),
    "xml/TDM-metadata-wrong-keyword.xml": (23, "'WRONG_KEYWORD' is no keyword of the metadata"),
    "xml/TDM-missing-participants.xml": (11, "has no PARTICIPANT_1"),
    "xml/TDM-missing-timesystem.xml": (16, "has no TIME_SYSTEM"),
}


@pytest.mark.parametrize("form", ["kvn/{}.txt", "xml/{}.xml"])
@pytest.mark.parametrize("name", GOOD)
def test_good_files_hold_what_stands_in_them(name, form, data_dir):
    rows, want = pz.read_tracking(data_dir / "ccsds/tdm" / form.format(name)), GOOD[name]
    assert len(rows) == want["rows"]
    assert rows.scales == ("UTC",)
    for row, key, i in ((0, "first", 0), (len(rows) - 1, "last", 1)):
        assert rows.instant(row).to("UTC") == want[key]
        assert_allclose(rows.value[row], want["values"][i], rtol=4e-16, atol=4e-6 if rows.value[row] > 1e10 else 0)
    assert rows.kinds == want["kinds"]
    assert rows.participants == want["participants"]
    first = rows.segments[0]
    assert (first.path, first.way, first.mode) == (want["path"], want["way"], want["mode"])
    station, seen = (rows.participants[i] if i >= 0 else None for i in (rows.station[0], rows.object[0]))
    assert (station, seen) == want["roles"]
    assert first.corrections == want.get("corrections", ())
    for key in ("range_mode", "quality"):
        assert getattr(first, key) == want.get(key)
    assert first.range_modulus == want.get("range_modulus", 0.0)
    if "interval" in want:
        assert (first.interval, first.interval_reference) == want["interval"]
    for key in ("delays", "frequencies"):
        assert getattr(first, key) == want.get(key, getattr(first, key))


@pytest.mark.parametrize("name", GOOD)
def test_another_reader_finds_the_same_numbers(name, data_dir):
    path = data_dir / "ccsds/tdm/xml" / f"{name}.xml"
    found = [one for segment in ccsds_ndm.from_file(str(path)).segments for one in segment.data.observations]
    rows = pz.read_tracking(path)
    assert_allclose([pz.Epoch(one.epoch, "UTC") - rows.epoch for one in found], rows.t, rtol=0, atol=1e-9)
    factor = np.array([FACTORS.get(rows.kinds[i], 1.0) for i in rows.kind])
    if name == "TDMExample8":
        factor = np.where(rows.of_kind("range"), 299792458.0, factor)  # whose ranges are in seconds
    offset = np.where(rows.of_kind("receive_frequency"), dict(rows.segments[0].frequencies).get("offset", 0.0), 0.0)
    assert_array_equal([one.value for one in found] * factor + offset, rows.value)


FACTORS = dict.fromkeys(["azimuth", "elevation", "x_south", "y_east"], DEGREE) | dict.fromkeys(
    ["range", "range_rate_averaged"], 1e3
)


def test_segments_of_one_file_keep_their_own_conventions(data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExample8.txt")
    second = rows.segments[1]
    assert second.path == ("WHM1", "SAT", "WHM1")
    assert second.range_modulus == 1e7 * 299792458.0  # in seconds of light
    assert second.corrections == (Correction("range", 2.0 * 299792458.0, True),)
    assert_array_equal(np.bincount(rows.segment), [9, 12])
    assert rows.stations == ("HBSTK", "WHM1")
    own = rows[rows.of_kind("range")]
    assert_allclose(own.value[0], 40016.5248953670 * 299792458.0, rtol=4e-16)
    assert own.instant(0).to("UTC") == "2007-08-29T06:00:02 UTC"


@pytest.mark.parametrize("name", ["kvn/TDMExampleAllKeywordsSequential.txt", "xml/TDMExampleAllKeywordsSequential.xml"])
def test_every_keyword_is_taken_in_si(name, data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/tdm" / name)
    assert len(rows) == 47
    assert_allclose(rows.t - rows.t[0], np.arange(47.0), rtol=0, atol=0)
    value = {name: rows.value[rows.of_kind(name)] for name in rows.kinds}
    one = {
        "carrier_power": 1.0, "doppler_count": 2 / 1000, "range_rate": 3.0, "range_rate_averaged": 4.0, "carrier_to_noise": 5.0,
        "ranging_to_noise": 16.0, "range_ru": 17.0, "delta_range_delay": 34.0, "vlbi_delay": 35.0,
        "right_ascension": 2062.6480624709635516 * DEGREE, "declination": 2119.9438419840458724 * DEGREE, "magnitude": 38.0,
        "radar_cross_section": 39.0, "clock_bias": 40.0, "clock_drift": 41.0, "total_electron_content": 42.0,
        "troposphere_dry": 43.0, "troposphere_wet": 44.0, "pressure": 45.0, "humidity": 46.0, "temperature": 47.0,
    }  # fmt: skip
    for kind, expected in one.items():
        assert_allclose(value[kind], [expected], rtol=1e-15)
    several = {"receive_phase": range(6, 11), "transmit_phase": range(11, 16), "transmit_frequency_rate": range(29, 34)}
    several |= {"transmit_frequency": range(24, 29)}
    for kind, expected in several.items():
        assert_allclose(value[kind], list(expected), rtol=1e-15)
    assert_allclose(value["receive_frequency"], 32021035200.0 + np.arange(18.0, 24.0), rtol=1e-15)
    of = [rows.participants[i] if i >= 0 else None for i in rows[rows.of_kind("receive_frequency")].participant]
    assert of == ["DSS-25", "yyyy-nnnA", "P3", "P4", "P5", None]
    segment = rows.segments[0]
    assert segment.tag == "transmit" and set(rows.tag) == {1}
    assert segment.turnaround == 240 / 221 and segment.frame == "EME2000"
    assert segment.corrections[0] == Correction("angle_1", 1.0 * DEGREE, True)
    assert [c.value for c in segment.corrections[2:8]] == [3000.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    assert dict(segment.said)["EPHEMERIS_NAME_3"] == "eph-3"
    assert_allclose(rows.pressure, 45.0)
    assert_allclose(rows.temperature, 47.0)


def test_differences_have_two_paths_and_a_frame_of_date_is_known(data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExampleAllKeywordsSingleDiff.txt")
    assert (rows.segments[0].path, rows.segments[0].second_path) == (("P4", "P5"), ("P3", "yyyy-nnnA"))
    assert (rows.segments[0].mode, rows.segments[0].way) == ("single_diff", None)
    assert pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDM-Custom-Frame.txt").segments[0].frame == "TOD"
    rolled = pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExampleAllKeywordsSequentialWithRollover.txt")
    assert any("rolled over" in text for text in rolled.open)


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused_with_file_line_and_reason(name, data_dir):
    line, reason = BROKEN[name]
    path = data_dir / "ccsds/tdm" / name
    with pytest.raises(ValueError) as refusal:
        pz.read_tracking(path)
    text = str(refusal.value)
    assert text.startswith(f"{path}: line {line}: ") and reason in text
    assert "\n" not in text and len(text) < 300 + len(str(path))


META = {"TIME_SYSTEM": "UTC", "PARTICIPANT_1": "BER", "PARTICIPANT_2": "SAT", "MODE": "SEQUENTIAL", "PATH": "1,2,1"}


def message(data, **meta):
    """A message of one segment: metadata from line 5 on."""
    words = META | meta
    lines = ["CCSDS_TDM_VERS = 2.0", "CREATION_DATE = 2020-01-01T00:00:00", "ORIGINATOR = X", "META_START"]
    lines += [f"{key} = {value}" for key, value in words.items() if value is not None]
    return "\n".join([*lines, "META_STOP", "DATA_START", *data, "DATA_STOP", ""])


def read(tmp_path, text, **told):
    path = tmp_path / "a"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return pz.read_tracking(path, **told)


ROW = "RANGE = 2020-01-01T00:00:00 1000"


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        (message([ROW], PATH="1,3,1"), 9, "PATH is '1,3,1'; it must be numbers of participants"),
        (message([ROW], PARTICIPANT_2=None, PARTICIPANT_3="SAT"), 9, "has no PARTICIPANT_2"),
        (message([ROW], RANGE_UNITS="miles"), 10, "RANGE_UNITS is 'miles'; it must be one of KM, S, RU"),
        (message(["ANGLE_1 = 2020-01-01T00:00:00 1"]), 12, "ANGLE_1 needs an ANGLE_TYPE"),
        (message(["RECEIVE_FREQ_3 = 2020-01-01T00:00:00 1"]), 12, "there is no PARTICIPANT_3"),
        (message(["RANGE = 2020-02-30T00:00:00 1"]), 12, "'2020-02-30T00:00:00' is no date"),
        (message(["RANGE = 2020-01-01T00:00:00 nan"]), 12, "'nan' is no number"),
        (message(["RANGE = 2020-01-01T00:00:00 1e999"]), 12, "'1e999' is no number"),
        (message(["RANGE = 2020-01-01T00:00:00 1e308"]), 12, "'1e308' is no number"),  # of km, it is beyond all numbers in m
        ('<?xml version="1.0" encoding="utf-7"?><tdm/>', 1, "no XML that can be read"),
        (message(["RANGE 2020-01-01T00:00:00 = 1"]), 12, "a line of data is KEYWORD = date value"),
        (message(["RANGE = 2020-01-01T00:00:00 " + "1" * 5000]), 12, "is no number"),
        (message([ROW, "RANGE = 1959-01-01T00:00:00 1"]), 13, "no UTC before 1960"),
        (message([ROW, ROW + "2 3", "RANGE = 2020 x"]), 13, "a line of data is"),
        (message([]), 1, "the message has no data"),
        (message([ROW]).replace("META_STOP\n", ""), 10, "the metadata of a segment do not end with META_STOP"),
        (message([ROW]).replace("DATA_STOP\n", ""), 13, "the data of a segment do not end with DATA_STOP"),
        (message([ROW]).replace("MODE = ", "PATH = 1,2\nMODE = "), 10, "PATH is given twice"),
        (message([ROW]).replace("2.0", "3.0"), 1, "the version of the TDM is '3.0'"),
        (message([ROW], DOPPLER_COUNT_SCALE="0"), 10, "DOPPLER_COUNT_SCALE is 0"),
        (message([ROW], START_TIME="yesterday"), 10, "START_TIME: date 'yesterday' cannot be read"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, text, line, says):
    with pytest.raises(ValueError, match=f": line {line}: ") as refusal:
        read(tmp_path, text)
    assert says in str(refusal.value)


def test_time_systems_leap_seconds_and_windows_line_ends(tmp_path):
    dates = ["2016-12-31T23:59:59.5", "2016-366T23:59:60.5", "2017-01-01T00:00:00.5Z"]
    rows = read(tmp_path, message([f"RANGE={date} 1" for date in dates]).replace("\n", "\r\n"))
    assert_allclose(np.diff(rows.t), [1.0, 1.0], rtol=0, atol=1e-12)
    assert_array_equal(rows.line, [12, 13, 14])
    gps = read(tmp_path, message([ROW], TIME_SYSTEM="GPS"))
    assert gps.instant(0) == pz.Epoch("2020-01-01T00:00:00 GPS")
    with pytest.raises(ValueError, match="TIME_SYSTEM is UTC, and GPS was said for BER"):
        read(tmp_path, message([ROW]), time="BER=GPS")


def test_weather_is_between_its_rows_and_held_outside(tmp_path):
    given = [("RANGE", 0, 1), ("PRESSURE", 10, 1000), ("RANGE", 15, 1), ("PRESSURE", 20, 1010), ("RANGE", 30, 1)]
    data = [f"{word} = 2020-01-01T00:00:{s:02d} {v}" for word, s, v in [*given, ("TEMPERATURE", 30, 290)]]
    rows = read(tmp_path, message(data))
    ranges = rows[rows.of_kind("range")]
    assert_allclose(ranges.pressure, [100000.0, 100500.0, 101000.0], rtol=1e-15)
    assert_allclose(ranges.temperature, 290.0)
    assert np.isnan(ranges.humidity).all()
    assert_array_equal(rows.measured, rows.of_kind("range"))


def test_answers_close_what_is_open(tmp_path):
    text = message([ROW, "DOPPLER_INTEGRATED = 2020-01-01T00:00:00 1"], CORRECTION_RANGE="0.01")
    rows = read(tmp_path, text)
    options = [text.partition("--")[2].split()[0] for text in rows.open]
    assert options == ["range", "interval", "corrections", "sigma"]
    assert len(rows.assumed) == 1 and "--tag" in rows.assumed[0]
    told = read(tmp_path, text, range="round-trip", interval=60, corrections="open", tag="transmit",
                sigma=["range=10m", "range_rate_averaged=1mm/s"])  # fmt: skip
    assert told.open == ()
    assert told.segments[0].range_is == "sum" and told.segments[0].corrections == (Correction("range", 10.0, False),)


def test_xml_with_entities_or_nested_without_end_is_refused(tmp_path):
    bomb = '<?xml version="1.0"?>\n<!DOCTYPE tdm [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>\n<tdm>&b;</tdm>'
    with pytest.raises(ValueError, match="line 2: the file has a DOCTYPE"):
        read(tmp_path, bomb)
    late = "<tdm>" + "\n" * 5000 + "</tdm>\n<!DOCTYPE tdm>"
    with pytest.raises(ValueError, match="line 5002: the file is no whole XML"):
        read(tmp_path, late)
    with pytest.raises(ValueError, match="more than 40 deep"):
        read(tmp_path, "<tdm>" + "<a>" * 50)
    with pytest.raises(ValueError, match="no whole XML"):
        read(tmp_path, "<tdm><body>")


def test_lines_of_any_order_and_size_are_those_of_a_plain_reader(tmp_path):
    """Against one line at a time, over the edges of the chunks that are read at once."""
    rng = random.Random(1)
    lines, want = [], []
    for i in range(60000):
        kind = rng.choice(["RANGE", "DOPPLER_INSTANTANEOUS", "COMMENT", "", "RECEIVE_FREQ_2"])
        if kind in ("", "COMMENT"):
            lines.append(kind + (" a = b 2020" if kind else " " * rng.randrange(5)))
            continue
        value = rng.choice([repr(rng.gauss(0, 1e5)), f"{rng.random():.3e}", str(rng.randrange(9)), "1D3", ".5", "5."])
        second = rng.randrange(86400) + rng.randrange(1000) / 1000
        clock = f"{int(second) // 3600:02d}:{int(second) // 60 % 60:02d}:{int(second) % 60:02d}.{round(second % 1 * 1000):03d}"
        date = rng.choice(["2020-03-01", "2020-061"])
        blank = " " * rng.randrange(3)
        lines.append(f"{blank}{kind}{blank}={blank}{date}T{clock} {blank}{value}{blank}")
        want.append((second, float(value.replace("D", "e")) * (1.0 if kind == "RECEIVE_FREQ_2" else 1000.0), i + 12))
    rows = read(tmp_path, message(lines))
    seconds, values, places = (np.array(column) for column in zip(*want, strict=True))
    assert_array_equal(rows.line, places)
    assert_array_equal(rows.value, values)
    start = pz.Epoch("2020-03-01T00:00:00 UTC") - rows.epoch
    assert_allclose(rows.t - start, seconds, rtol=0, atol=2e-11)


def test_ranges_in_range_units_are_metres_once_their_length_is_said(data_dir):
    path = data_dir / "tdm" / "TDMExample4.txt"
    raw = pz.read_tracking(path)
    assert any("--range-unit 0.28m" in text for text in raw.open) and any(
        "of range_ru: --sigma ...m" in text for text in raw.open
    )
    for said in ("0.25m", "DSS-24=25cm", ["1m", "DSS-24=0.25 m"]):
        rows = pz.read_tracking(path, range_unit=said, range="two-way")
        there = raw.of_kind("range_ru")
        assert_array_equal(rows.of_kind("range"), there)
        assert_array_equal(rows.value[there], 0.25 * raw.value[there])
        assert_array_equal(rows.value[~there], raw.value[~there])
        assert rows.segments[0].range_modulus == 0.25 * 2e26
        assert rows.segments[0].corrections == (Correction("range", 0.25 * 46.7741, True),)
        assert not any("RU" in text or "unit" in text for text in rows.open)
        assert any("of range: --sigma ...m" in text for text in rows.open)
    assert_allclose(pz.read_tracking(path, range_unit="0.25m", sigma="range=3m").sigma[there], 3.0)
    for said, what in (("3 kg", "is a length"), ("short", "is a length"), ("-1m", "is a length"), ("X=1m", "no such station")):
        with pytest.raises(ValueError, match=what):
            pz.read_tracking(path, range_unit=said)


def test_messages_after_one_another_are_one_file(tmp_path):
    one = """CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2011-05-12T00:00:00
ORIGINATOR = X
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = A
PARTICIPANT_2 = SAT
MODE = SEQUENTIAL
PATH = 2,1
ANGLE_TYPE = AZEL
META_STOP
DATA_START
ANGLE_1 = 2011-05-11T10:26:33 191.4
ANGLE_2 = 2011-05-11T10:26:33 25.4
DATA_STOP
"""
    path = tmp_path / "two.tdm"
    path.write_text(one + "\n" + one.replace("10:26:33", "10:26:43").replace("1 = A", "1 = B"))
    table = pz.read_tracking(path)
    assert table.line.tolist() == [13, 14, 29, 30] and {*table.stations} == {"A", "B"}
    path.write_text(one + one.replace("VERS = 2.0", "VERS = 7.0"))
    with pytest.raises(ValueError, match=r"line 16: the version of the TDM is '7\.0'"):
        pz.read_tracking(path)
    path.write_text(one + "ORIGINATOR = Y\n" + one)
    with pytest.raises(ValueError, match="line 16: 'ORIGINATOR' stands between segments"):
        pz.read_tracking(path)


@pytest.mark.parametrize("quotes", ["''", '""', "\u2018\u2019"])
def test_names_in_quotes(tmp_path, quotes):
    text = f"""CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2011-05-12T00:00:00
ORIGINATOR = X
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = {quotes[0]}DSS-25{quotes[1]}
PARTICIPANT_2 = O'HIGGINS'S
MODE = SEQUENTIAL
PATH = 2,1
META_STOP
DATA_START
RANGE = 2011-05-11T10:26:33 191.4
DATA_STOP
"""
    path = tmp_path / "a.tdm"
    path.write_text(text, encoding="utf-8")
    assert pz.read_tracking(path).segments[0].path == ("O'HIGGINS'S", "DSS-25")
    path.write_text(text.replace("DSS-25", ""), encoding="utf-8")
    with pytest.raises(ValueError, match=r"has no PARTICIPANT_1"):
        pz.read_tracking(path)
