"""Laser ranges of CRD files: what the files of the ILRS hold, and each of their flags."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from piazzi.formats.crd_headers import cospar

ROOT = Path(__file__).resolve().parents[2]
C = 299792458.0
PASS = """\
H1 CRD  2 2021 01 27 09
H2 GRZL 7839 34 02  4 EUROLAS
H3 lageos1    7603901  1155 8820     0 1 1
H4  {kind} 2021 01 26 23 55 51 2021 01 27 00 34 18  {release} {flags} {ranges} {quality}
C0 0 532.000 0902 2kHz C_SPAD1 GPS
C0 0 1064.000 ir 2kHz C_SPAD1 GPS
{rows}
H8
H9
"""


def crd(tmp_path, *, kind=1, release=0, flags="0 0 0 1 0", ranges=2, quality=0, rows="11 86390.5 0.058 0902 2 120.0 9 35.1"):
    text = PASS.format(kind=kind, release=release, flags=flags, ranges=ranges, quality=quality, rows=rows)
    path = tmp_path / "a.npt"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "name, rows, first, last, flights, pads",
    [
        # by hand from the files: second of the day and flight time of the first and last range
        ("lageos1-test.npt", 14, "2021-01-19T23:04:58.3290105 UTC", "2021-03-02T19:08:29.9924172 UTC",
         (0.048305496438, 0.051292849408), ["1893", "7839"]),
        ("lageos2_201802.npt.v2C", 300, "2018-02-01T15:15:27.6201614 UTC", "2018-02-27T14:36:58.0950016 UTC",
         (0.044106029140, 0.042733272755), ["9998"]),
        ("Rollover.frd", 29, "2022-06-06T12:03:30.8898329 UTC", "2021-01-27T00:16:47.94676363 UTC",
         (0.044490825842, 0.045566238343), ["7105", "7838", "7839"]),
        ("champ_201709-small.frd", 4, "2017-09-26T04:01:27.34320625 UTC", "2017-09-26T04:01:28.35987285 UTC",
         (0.003603959600, 0.003585437115), ["7825"]),
        ("crd_all_fields.frd", 4, "2017-09-26T04:01:27.34320625 UTC", "2017-09-26T04:01:28.35987285 UTC",
         (0.003603959600, 0.003585437115), ["7825"]),
        ("glonass125_trunc.frd", 150, "2019-04-19T21:29:47.01906365 UTC", "2019-04-20T00:11:34.11956365 UTC",
         (0.143461677858, 0.137056288730), ["7839"]),
        ("crd201_all_samples", 86, "2006-11-13T15:23:52.0414338 UTC", "2012-01-16T03:12:12.3175001 UTC",
         (0.047960587856, 0.021670462296), ["7080", "7090", "7810", "7839", "7840"]),
    ],
)  # fmt: skip
def test_files_of_the_ilrs(data_dir, name, rows, first, last, flights, pads):
    table = pz.read_tracking(data_dir / "ilrs" / name)
    assert len(table) == rows
    assert table.kinds == ("range",) and table.scales == ("UTC",)
    np.testing.assert_allclose(table.value[[0, -1]], np.array(flights) * C / 2, rtol=1e-15)
    assert abs(table.instant(0) - pz.Epoch(first)) < 1e-7 and abs(table.instant(rows - 1) - pz.Epoch(last)) < 1e-7
    assert sorted(table.stations) == pads
    assert all(segment.way == "two-way" and segment.range_is == "half" for segment in table.segments)
    assert {segment.tag for segment in table.segments} == {"transmit"}


def test_lageos_2_in_february_2016(data_dir):
    """Eleven passes by four stations; those of Stromlo are of 11 and 12 February, Matera's is corrected for amplitude."""
    table = pz.read_tracking(data_dir / "earth" / "lageos2" / "lageos2_20160214.npt")
    assert len(table) == 95 and len(table.segments) == 11 and table.objects == ("lageos2",)
    counts = {name: int(np.sum(table.station == table.participants.index(name))) for name in table.stations}
    assert counts == {"7090": 37, "7119": 27, "7825": 17, "7941": 14}
    ordered = table.in_order()
    assert abs(ordered.instant(0) - pz.Epoch("2016-02-11T13:29:36.695142011 UTC")) < 1e-8
    assert abs(ordered.instant(94) - pz.Epoch("2016-02-14T07:36:43.8005614 UTC")) < 1e-8
    stromlo = table[table.station == table.participants.index("7825")]
    assert {stromlo.instant(k).to("UTC")[:10] for k in range(17)} == {"2016-02-11", "2016-02-12"}
    assert np.all(table.sigma == 0.03) and table.assumed == ("sigma of laser ranges, normal points: 0.03 m",)
    weather = table.pressure[0], table.temperature[0], table.humidity[0]
    np.testing.assert_allclose(weather, [98370.0, 301.4, 0.24], rtol=1e-12)
    assert table.segments[0].wavelength == pytest.approx(532e-9)
    applied = {c.name: c.applied for c in table.segments[0].corrections}
    assert applied == {"troposphere": False, "centre of mass": False, "receive amplitude": False, "station delay": True}
    matera = table.segments[int(table.segment[table.station == table.participants.index("7941")][0])]
    assert [c.name for c in matera.corrections if c.applied] == ["receive amplitude", "station delay"]
    assert dict(matera.said)["cospar"] == "1992-070B" and dict(matera.said)["norad"] == "22195"


@pytest.mark.parametrize(
    "name, line, what",
    [
        ("crd_corrupted_data.v2C", 19, "flight time is 'corrupted'"),
        ("crd_invalid_format.v2C", 1, "H1 has 7 fields"),
        ("crd_invalid_range_type.v2C", 4, "range type 9"),
        ("crd_unexpected_end_of_file.v2C", 23, "cut short"),
    ],
)
def test_broken_files_are_refused_with_their_line(data_dir, name, line, what):
    read = pz.read_ephemeris if "format" in name else pz.read_tracking  # its first line says CPF
    with pytest.raises(ValueError, match=what) as error:
        read(data_dir / "ilrs" / name)
    assert f"{name}: line {line}: " in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "place, name", [(0, "troposphere"), (1, "centre of mass"), (2, "receive amplitude"), (3, "station delay")]
)
def test_each_flag_of_what_was_applied(tmp_path, place, name):
    flags = ["1" if k == place else "0" for k in range(5)]
    (segment,) = pz.read_tracking(crd(tmp_path, flags=" ".join(flags))).segments
    assert {c.name: c.applied for c in segment.corrections}[name] is True
    assert sum(bool(c.applied) for c in segment.corrections) == 1


def test_delay_of_the_station_is_told_by_its_calibration(tmp_path):
    """105320 ps of the way there and back lengthen the range by half of that; the correction takes it away."""
    rows = "40 86000.0 0 0902 10 10 1.742 105320.0 3.8 16\n40 86001.0 0 ir 10 10 1.7 999.0 3 1\n"
    rows += "11 86390.5 0.058 0902 2 120.0 9 35.1"
    (segment,) = pz.read_tracking(crd(tmp_path, flags="0 0 0 0 0", rows=rows)).segments
    delay = next(c for c in segment.corrections if c.name == "station delay")
    assert delay.applied is False and delay.value == pytest.approx(-105320e-12 * C / 2)


@pytest.mark.parametrize(
    "event, ranges, tag, way, path",
    [
        (0, 2, "receive", "two-way", ("7839", "lageos1", "7839")),
        (1, 2, "bounce", "two-way", ("7839", "lageos1", "7839")),
        (2, 2, "transmit", "two-way", ("7839", "lageos1", "7839")),
        (3, 1, "receive", "one-way", ("7839", "lageos1")),
        (4, 1, "transmit", "one-way", ("lageos1", "7839")),
        (5, 1, "transmit", "one-way", ("7839", "lageos1")),
        (6, 4, "transmit", "one-way", ("lageos1", "7839")),
    ],
)
def test_each_epoch_event(tmp_path, event, ranges, tag, way, path):
    table = pz.read_tracking(crd(tmp_path, ranges=ranges, rows=f"11 86390.5 0.058 0902 {event} 120.0 9 35.1"))
    (segment,) = table.segments
    assert (segment.tag, segment.way, segment.path) == (tag, way, path)
    assert pz.formats.TAGS[table.tag[0]] == tag
    assert table.value[0] == pytest.approx(0.058 * C * (1.0 if way == "one-way" else 0.5), rel=1e-15)


@pytest.mark.parametrize("event, ranges", [(5, 2), (2, 1), (7, 2), (12, 2)])
def test_events_that_cannot_be(tmp_path, event, ranges):
    with pytest.raises(ValueError, match=r"a.npt: line 7: .*event"):
        pz.read_tracking(crd(tmp_path, ranges=ranges, rows=f"11 86390.5 0.058 0902 {event} 120.0 9 35.1"))


def test_midnight_weather_and_wavelengths(tmp_path):
    """Seconds begin anew; weather lies on the line between its records; each configuration has its wavelength."""
    rows = """11 86390.0 0.058 0902 2 120.0 9 35.1
20 86380 980.00 280.00 40. 0
20 20 984.00 284.00 50. 0
11 10.0 0.057 ir 2 120.0 9 35.1
11 600.0 0.057 ir 2 120.0 9 35.1"""
    table = pz.read_tracking(crd(tmp_path, rows=rows))
    np.testing.assert_allclose(table.t - table.t[0], [0.0, 20.0, 610.0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(table.pressure, [98100.0, 98300.0, 98400.0])
    np.testing.assert_allclose(table.humidity, [0.425, 0.475, 0.5])
    assert [table.segments[k].wavelength for k in table.segment] == pytest.approx([532e-9, 1064e-9, 1064e-9])


def test_leap_second_within_a_pass(tmp_path):
    path = crd(tmp_path, rows="11 86399.0 0.058 0902 2 120.0 9 35.1\n11 1.0 0.057 0902 2 120.0 9 35.1")
    text = path.read_text().replace("2021 01 26 23 55 51 2021 01 27 00", "2016 12 31 23 55 51 2017 01 01 00")
    path.write_text(text)
    table = pz.read_tracking(path)
    assert table.t[1] - table.t[0] == pytest.approx(3.0, abs=1e-9)


def test_noise_of_full_rate_is_not_to_be_used_and_its_sigma_is_larger(tmp_path):
    rows = "\n".join(f"10 86390.{k} 0.058 0902 2 {k} 0 0 0" for k in (0, 1, 2))
    table = pz.read_tracking(crd(tmp_path, kind=0, rows=rows))
    assert table.used.tolist() == [True, False, True] and np.all(table.sigma == 0.05)


def test_sigma_is_never_the_scatter_within_the_bin(tmp_path):
    few, many = (crd(tmp_path, rows=f"11 86390.5 0.058 0902 2 120.0 9 {rms}") for rms in ("35.1", "900.0"))
    assert pz.read_tracking(few).sigma[0] == pz.read_tracking(many).sigma[0] == 0.03


def test_a_later_release_replaces_a_pass(tmp_path):
    one, two = (crd(tmp_path, release=k, rows=f"11 86390.5 0.05{k} 0902 2 120.0 9 35.1").read_text() for k in (0, 1))
    both = tmp_path / "both.npt"
    both.write_text(two.replace("H9\n", "") + one)
    table = pz.read_tracking(both)
    assert len(table) == 1 and table.value[0] == pytest.approx(0.051 * C / 2)
    assert table.left_out == (("rows of a pass that a later release replaces", 1),)
    other = one.replace("7839", "7841")
    both.write_text(two.replace("H9\n", "") + other)
    assert len(pz.read_tracking(both)) == 2


def test_quality_and_transmit_times(tmp_path):
    assert pz.read_tracking(crd(tmp_path, quality=2)).segments[0].quality == "degraded"
    table = pz.read_tracking(crd(tmp_path, ranges=0))
    assert len(table) == 0 and table.left_out == (("rows of transmit times only, which measure no range", 1),)


@pytest.mark.parametrize(
    "old, new, what",
    [
        ("H8\n", "", "H9 ends the file within a pass"),
        ("H8\nH9\n", "", "line 7: the file ends before H8"),
        ("0.058", "nan", "line 7: the flight time is nan s"),
        ("0.058", "-0.058", "line 7: the flight time is -0.058 s"),
        ("86390.5", "1_0", "line 7: second of the day is '1_0'"),
        ("86390.5", "186390.5", "line 7: the second of the day is 186390 s"),
        ("CRD  2", "CRD  3", "line 1: CRD version 3"),
        ("532.000", "5.32", "line 5: wavelength"),
        ("2021 01 26", "2021 02 30", "line 4: 2021-2-30"),
        ("11 86390.5", "77 86390.5", "line 7: record '77' is not known"),
        ("H3 lageos1", "H7 lageos1", "line 3: record 'H7' is not known"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, old, new, what):
    path = crd(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(path)
    assert "\n" not in str(error.value)


def test_a_sigma_of_the_users_goes_before_the_usual_one(tmp_path):
    path = crd(tmp_path)
    table = pz.read_tracking(path, sigma="range=1m")
    assert table.sigma.tolist() == [1.0] and table.assumed == ()
    table = pz.read_tracking(path, sigma=["range.7839=2m"])
    assert table.sigma.tolist() == [2.0]


def test_the_station_delay_that_is_left_is_applied_once(tmp_path):
    rows = "40 86000.0 0 0902 10 10 1.742 105320.0 3.8 16\n11 86390.5 0.058 0902 2 120.0 9 35.1"
    raw = pz.read_tracking(crd(tmp_path, flags="0 0 0 0 0", rows=rows))
    once = pz.formats.corrected(raw)
    assert once.value[0] == pytest.approx((0.058 - 105320e-12) * C / 2, rel=1e-15)
    assert pz.formats.corrected(once).value[0] == once.value[0]


def test_reflectors_on_the_moon_have_fewer_numbers(tmp_path):
    path = crd(tmp_path, flags="0 0 0 1 0", rows="11 86390.5 2.660923125349 0902 2 120.0 9 35.1")
    text = path.read_text().replace("H3 lageos1    7603901  1155 8820     0 1 1", "h3 apollo15        103  103          0 2")
    path.write_text(text)
    table = pz.read_tracking(path)
    assert table.objects == ("apollo15",)
    np.testing.assert_allclose(table.value, 299792458.0 * 2.660923125349 / 2, rtol=1e-14)


def test_designators():
    codes = {
        "9207002": "1992-070B",
        "7603901": "1976-039A",
        "0003902": "2000-039B",
        "0505101": "2005-051A",
        "1606902": "2016-069B",
    }
    assert {code: cospar(code) for code in codes} == codes
    assert cospar("9806724") == "1998-067Z" and cospar("9806725") == "1998-067AA"  # I and O are not used
    assert cospar("505101") == "2005-051A" and cospar("unknown") == "unknown"


MEASURE = """
import resource, sys
import piazzi as pz
from tests.waiting import little
pz.read_tracking(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
table = little(lambda: pz.read_tracking(sys.argv[2]), 3.0)
grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(len(table), 1024 * grown / len(table))
"""


@pytest.mark.slow
def test_a_million_full_rate_ranges(tmp_path):
    """3 s of the processor, and 200 bytes of memory a row with the file itself, which is in memory too."""
    small = crd(tmp_path, kind=0, rows="10 86151.0 0.058 0902 2 2 0 0 -1 -1").rename(tmp_path / "small")
    rows = "\n".join(
        f"10 {(86151.0 + 0.002 * k) % 86400:.9f} 0.{58145452724 + k:012d} 0902 2 2 0 0 -1 -1" for k in range(10**6)
    )
    large = crd(tmp_path, kind=0, rows=rows)
    done = subprocess.run([sys.executable, "-c", MEASURE, small, large], capture_output=True, text=True, check=True, cwd=ROOT)
    count, memory = map(float, done.stdout.split())
    assert count == 1e6 and memory < 200.0, done.stdout
