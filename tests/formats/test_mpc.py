"""Astrometry of the Minor Planet Center: 80 columns, two-line records, packed designations, and ADES."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import piazzi as pz
from piazzi.formats.designations import pack, unpack

ARCSECOND = math.pi / 648000
LINE = "00433".ljust(14) + "C2012 01 26.170220" + "12 43 22.43 " + "-10 51 17.1".ljust(21) + " 14.2Vu" + "MPE01" + "703"


def mpc(tmp_path, *lines):
    path = tmp_path / "a.obs"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_ceres_as_piazzi_saw_her(data_dir):
    """The first and last line, by hand; 21 of Palermo, 50 that are coded geocentric; before 1960 dates are of UT1."""
    table = pz.read_tracking(data_dir / "earth" / "ceres-1801" / "mpc_ceres_1801_1803.txt")
    assert len(table) == 2 * 71 and table.kinds == ("right_ascension", "declination") and table.objects == ("(1)",)
    assert table.scales == ("UT1",) and set(table.stations) == {"535", "500"}
    assert np.sum(table.station == table.participants.index("535")) == 2 * 21
    first, last = (pz.Epoch(text) for text in ("1801-01-01T19:49:52.32 UT1", "1803-07-07T23:28:25.248 UT1"))
    assert abs(table.instant(0) - first) < 1e-3 and abs(table.instant(141) - last) < 1e-3
    hours, degrees = 3 + 38 / 60 + 23.07 / 3600, 16 + 17 / 60 + 25.5 / 3600
    np.testing.assert_allclose(table.value[:2], np.radians([15 * hours, degrees]), rtol=1e-14)
    hours, degrees = 18 + 50 / 60 + 0.41 / 3600, -(28 + 30 / 60 + 3.9 / 3600)
    np.testing.assert_allclose(table.value[-2:], np.radians([15 * hours, degrees]), rtol=1e-14)
    (segment,) = table.segments
    assert (segment.angles, segment.frame, segment.tag) == ("astrometric", "ICRF", "receive")
    assert {pz.formats.TAGS[k] for k in table.tag} == {"receive"}
    # two declinations are given to the minute, one right ascension to the second
    arcseconds = table.sigma / ARCSECOND
    photographs = (arcseconds == 10.0) | (
        np.abs(arcseconds - 10.0 * math.sqrt(5 / 4)) < 1e-9
    )  # of before 1890; a night of five
    coarse = arcseconds[~np.isclose(arcseconds, 10.0) & ~photographs]
    np.testing.assert_allclose(sorted(coarse), sorted([60 / math.sqrt(12)] * 2 + [15 / math.sqrt(12)]))
    assert set(table.extra["technique"]) == {"A"} and set(table.extra["reference"]) == {"MC004", "APO01"}


def test_notes_magnitude_band_and_catalogue(tmp_path):
    table = pz.read_tracking(mpc(tmp_path, "COD 703", "OBS Somebody", LINE))
    assert table.objects == ("(433)",) and table.stations == ("703",) and table.scales == ("UTC",)
    extra = {name: values[0] for name, values in table.extra.items()}
    assert extra["magnitude"] == 14.2 and (extra["band"], extra["catalogue"], extra["technique"]) == ("V", "u", "C")
    assert abs(table.instant(0) - (pz.Epoch("2012-01-26T00:00:00 UTC") + 0.17022 * 86400)) < 1e-6
    assert table.value[1] == pytest.approx(-math.radians(10 + 51 / 60 + 17.1 / 3600), rel=1e-14)


def test_replaced_observations_are_counted(tmp_path):
    table = pz.read_tracking(mpc(tmp_path, LINE, LINE[:14] + "X" + LINE[15:], LINE[:14] + "x" + LINE[15:]))
    assert len(table) == 2 and table.left_out == (("observations that others replace", 2),)


def test_observer_in_space(tmp_path):
    """The first observation of 1222 T-1 by the Hubble telescope, as the Center prints it."""
    first = "     T1S1222  S1995 10 19.53839 23 45 35.737+09 09 38.13".ljust(77) + "250"
    second = "     T1S1222  s1995 10 19.53839 1 + 5530.3041 - 4255.1515 -  550.2319".ljust(77) + "250"
    table = pz.read_tracking(mpc(tmp_path, first, second))
    assert table.objects == ("1222 T-1",) and table.stations == ("250",)
    np.testing.assert_allclose(table.places, [[5530304.1, -4255151.5, -550231.9]])
    assert table.place.tolist() == [0, 0] and set(table.extra["place_axes"]) == {"GCRF"}
    far = second[:32] + "2 +0.00100000 -0.00200000 +0.01000000".ljust(45) + second[77:]
    table = pz.read_tracking(mpc(tmp_path, first, far))
    np.testing.assert_allclose(table.places, np.array([[0.001, -0.002, 0.01]]) * 149597870700.0)


def test_roving_observer(tmp_path):
    first = LINE[:14] + "V" + LINE[15:77] + "247"
    second = (LINE[:14] + "v" + LINE[15:32] + "1 249.265700 +31.688000  2510").ljust(77) + "247"
    table = pz.read_tracking(mpc(tmp_path, first, second))
    a, e2 = 6378137.0, 0.00669437999014
    phi, lam = math.radians(31.688), math.radians(249.2657)
    n = a / math.sqrt(1 - e2 * math.sin(phi) ** 2)
    place = [(n + 2510) * math.cos(phi) * math.cos(lam), (n + 2510) * math.cos(phi) * math.sin(lam)]
    np.testing.assert_allclose(table.places, [[*place, (n * (1 - e2) + 2510) * math.sin(phi)]], atol=1e-3)
    assert set(table.extra["place_axes"]) == {"ITRF"}


def test_radar(tmp_path):
    """Delay (us) and Doppler (Hz) have four decimals behind a point that is not written; the frequency goes on below."""
    head = "00433".ljust(14) + "R" + "1975 01 22.291667"
    first = (head + "   150884200000" + "+     123456789" + " 23885" + "251").ljust(77) + "253"
    second = (head.replace("R", "r") + "C" + "25000".rjust(14) + "50000".rjust(15) + "5     " + "251").ljust(77) + "253"
    table = pz.read_tracking(mpc(tmp_path, first, second))
    assert table.kinds == ("time_of_flight", "doppler") and len(table) == 2
    np.testing.assert_allclose(table.value, [15.08842, 12345.6789], rtol=1e-12)
    (segment,) = table.segments
    assert (
        segment.path == ("251", "(433)", "253")
        and segment.way == "three-way"
        and dict(segment.said)["echo"] == "centre of mass"
    )
    assert dict(segment.frequencies)["transmit"] == pytest.approx(2388.55e6)
    np.testing.assert_allclose(table.sigma, [2.5e-6, 5.0])


def test_lines_between_observations(tmp_path):
    """Headings, rulers and remarks, as files of programs that determine orbits have them."""
    lines = ("COM these are mine", "#Time sigma .001", "123456789|" * 8, "", LINE, "<-ObjDesig->*nnYYYY MM DD.DDDDD", LINE)
    table = pz.read_tracking(mpc(tmp_path, *lines))
    assert table.line.tolist() == [5, 5, 7, 7] and table.left_out == (("lines of text between observations", 3),)


def test_radar_whose_frequency_is_whole_megahertz(tmp_path):
    """The columns of the magnitude have digits of the frequency and of the station then."""
    head = "00433".ljust(14) + "R" + "1992 12 02.902778"
    first = (head + "   4218031212  " + "-     1235147  " + " 8510 " + "253").ljust(77) + "252"
    second = (head.replace("R", "r") + "C" + "         0650 " + "          052  ").ljust(68) + "253".ljust(9) + "252"
    table = pz.read_tracking(mpc(tmp_path, first, second))
    np.testing.assert_allclose(table.value, [42.18031212, -12351.47], rtol=1e-12)
    np.testing.assert_allclose(table.sigma, [0.65e-6, 0.52])
    assert abs(table.instant(0) - pz.Epoch("1992-12-02T21:40:00 UTC")) < 1e-9  # not 21:40:00.0192, as the digits say
    assert np.isnan(table.extra["magnitude"]).all() and set(table.extra["catalogue"]) == {""}
    assert dict(table.segments[0].frequencies)["transmit"] == 8510e6 and table.segments[0].path == ("253", "(433)", "252")


@pytest.mark.parametrize(
    "lines, what",
    [
        ((LINE, LINE[:79]), "line 2: an observation has 80 columns; this line has 79"),
        ((LINE, LINE.replace("12 43 22.43", "12 61 22.43")), "line 2: right ascension"),
        ((LINE, LINE.replace("-10 51 17.1", "-10 51 77.1")), "line 2: declination"),
        ((LINE, LINE.replace("12 43 22.43", "25 43 22.43")), "line 2: right ascension 25.7"),
        ((LINE, LINE.replace("01 26.170220", "13 26.170220")), "line 2: 2012-13-26"),
        ((LINE, LINE[:14] + "S" + LINE[15:]), "second line of the observation in line 2 is missing"),
        ((LINE, LINE[:14] + "s" + LINE[15:]), "line 2: a second line"),
        ((LINE[:14] + "S" + LINE[15:], LINE), "line 2: this is not the second line of the observation in line 1"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, lines, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(mpc(tmp_path, *lines))
    assert "a.obs: line " in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "packed, name",
    [
        ("00001", "(1)"), ("A0345", "(100345)"), ("z9999", "(619999)"), ("~0000", "(620000)"), ("~zzzz", "(15396335)"),
        ("     J95X00A", "1995 XA"), ("     J95X01L", "1995 XL1"), ("     J98SA8Q", "1998 SQ108"),
        ("     K07Tf8A", "2007 TA418"),
        ("     I98D00Q", "1898 DQ"), ("     J04O00A", "1904 OA"), ("     PLS2040", "2040 P-L"), ("     T3S4101", "4101 T-3"),
        ("     _QC0000", "2026 CA620"), ("     _QC0aEM", "2026 CZ6190"), ("     _QCzzzz", "2026 CL591673"),
        ("0001P", "1P"), ("0003D", "3D"), ("0073P      b", "73P-B"), ("    CJ95O010", "C/1995 O1"),
        ("    DJ93F02b", "D/1993 F2-B"),
        ("    PJ99XC0N", "P/1999 XN120"), ("J013S", "Jupiter 13"), ("    SK04S010", "S/2004 S 1"), ("     mine   ", "mine"),
    ],
)  # fmt: skip
def test_packed_designations_of_the_center(packed, name):
    assert unpack(packed) == name
    if name != "mine":
        assert pack(name) == packed.ljust(12)


ORDER = "ABCDEFGHJKLMNOPQRSTUVWXYZ"
years = st.integers(1800, 2199)
half_months = st.sampled_from("ABCDEFGHJKLMNOPQRSTUVWXY")
names = st.one_of(
    st.integers(0, 15396335).map("({})".format),
    st.builds(lambda y, h, o, n: f"{y} {h}{o}{n or ''}", years, half_months, st.sampled_from(ORDER), st.integers(0, 619)),
    st.builds(
        lambda y, h, o, n: f"{y} {h}{o}{n}",
        st.integers(2000, 2061), half_months, st.sampled_from(ORDER), st.integers(620, 591672),
    ),
    st.builds("{} {}".format, st.integers(0, 9999).map("{:04d}".format), st.sampled_from(["P-L", "T-1", "T-2", "T-3"])),
    st.builds("{}/{} {}{}".format, st.sampled_from("CPDXAI"), years, half_months, st.integers(1, 619)),
    st.builds("{}/{} {}{}-{}".format, st.sampled_from("CPD"), years, half_months, st.integers(1, 99), st.sampled_from("ABXYZ")),
    st.builds("{}{}".format, st.integers(1, 9999), st.sampled_from("PD")),
    st.builds("{} {}".format, st.sampled_from(["Mars", "Jupiter", "Saturn", "Uranus", "Neptune"]), st.integers(1, 999)),
    st.builds("S/{} {} {}".format, years, st.sampled_from("JSUN"), st.integers(1, 99)),
)  # fmt: skip


@given(names)
def test_designations_come_back_from_their_columns(name):
    packed = pack(name)
    assert len(packed) == 12 and unpack(packed) == name


@given(names, names)
def test_no_two_designations_pack_alike(one, other):
    assert (pack(one) == pack(other)) == (one == other)


def test_years_before_1925_may_be_written_with_a_letter():
    assert pack("A904 OA") == pack("1904 OA")


@pytest.mark.parametrize("name", ["", "Ceres", "(15396336)", "1995 IA", "C/1995 O1000", "1995 XA620"])
def test_what_no_rule_packs(name):
    with pytest.raises(ValueError, match=r"cannot be packed|more than two"):
        pack(name)


PSV = """\
# version=2017
# observatory
! mpcCode F51
permID |provID  |mode|stn |obsTime                 |ra        |dec       |rmsRA|rmsDec|rmsCorr|rmsTime|astCat|mag  |band
433    |        |CCD |F51 |2016-08-29T12:23:34.123Z|215.10254 |-12.547281|0.09 |0.08  |-0.214 |0.5    |Gaia1 |21.91|r
       |2016 PQ |CCD |F51 |2016-08-29T12:23:35Z    |0.5       |12.5      |     |      |       |       |Gaia1 |     |
"""
RECORD = "<{kind}><permID>433</permID>{body}</{kind}>"
TIME = "<obsTime>2016-08-29T12:23:34.123Z</obsTime>"
OPTICAL = (
    TIME
    + "<stn>F51</stn><ra>215.10254</ra><dec>-12.547281</dec><rmsRA>0.09</rmsRA><rmsDec>0.08</rmsDec><rmsCorr>-0.214</rmsCorr>"
)
RADAR = (
    TIME
    + "<trx>251</trx><rcv>253</rcv><delay>15.1</delay><rmsDelay>2.5</rmsDelay>"
    + "<doppler>-1e4</doppler><rmsDoppler>0.5</rmsDoppler>"
)


def ades(tmp_path, *records, kind="optical"):
    body = "".join(RECORD.format(kind=kind, body=record) for record in records)
    path = tmp_path / "a.xml"
    path.write_text(f'<?xml version="1.0"?>\n<ades version="2017"><obsBlock><obsData>{body}</obsData></obsBlock></ades>\n')
    return path


def test_ades_psv(tmp_path):
    path = tmp_path / "a.psv"
    path.write_text(PSV)
    table = pz.read_tracking(path)
    assert len(table) == 4 and table.objects == ("(433)", "2016 PQ") and table.stations == ("F51",)
    assert abs(table.instant(0) - pz.Epoch("2016-08-29T12:23:34.123 UTC")) < 1e-6
    np.testing.assert_allclose(np.degrees(table.value), [215.10254, -12.547281, 0.5, 12.5], rtol=1e-14)
    np.testing.assert_allclose(table.sigma / ARCSECOND, [0.09, 0.08, 0.2, 0.2])  # those of F51, where there are none
    np.testing.assert_allclose(table.correlation, [np.nan, -0.214, np.nan, np.nan])
    np.testing.assert_allclose(table.time_sigma, [0.5, 0.5, np.nan, np.nan])
    assert (
        table.extra["magnitude"][0] == 21.91 and table.extra["catalogue"][0] == "Gaia1" and table.line.tolist() == [5, 5, 6, 6]
    )


def test_ades_xml_is_the_same_as_psv(tmp_path):
    table = pz.read_tracking(ades(tmp_path, OPTICAL))
    np.testing.assert_allclose(np.degrees(table.value), [215.10254, -12.547281], rtol=1e-14)
    np.testing.assert_allclose(table.sigma / ARCSECOND, [0.09, 0.08])
    assert table.correlation[1] == -0.214 and (table.segments[0].angles, table.segments[0].frame) == ("astrometric", "ICRF")


def test_ades_radar(tmp_path):
    table = pz.read_tracking(ades(tmp_path, RADAR + "<frq>2380</frq><com>1</com>", kind="radar"))
    assert table.kinds == ("time_of_flight", "doppler")
    np.testing.assert_allclose(table.value, [15.1, -1e4])
    np.testing.assert_allclose(table.sigma, [2.5e-6, 0.5])
    (segment,) = table.segments
    assert segment.path == ("251", "(433)", "253") and dict(segment.frequencies)["transmit"] == 2380e6
    assert dict(segment.said)["echo"] == "centre of mass"


def test_ades_radar_between_strokes(tmp_path):
    path = tmp_path / "r.psv"
    path.write_text("""# version=2017
permID |trx |rcv |obsTime                |doppler    |delay       |rmsDoppler|rmsDelay|com|frq
    433|253 |253 |1992-12-02T21:40:00.02Z|           | 42.18031212|          | 0.650  |  1|8510.
    433|253 |252 |1992-12-02T21:40:00.02Z|-12351.47  |            | 0.52     |        |  1|8510.
""")
    table = pz.read_tracking(path)
    assert table.kinds == ("time_of_flight", "doppler") and table.stations == ("253", "252")
    np.testing.assert_allclose(table.value, [42.18031212, -12351.47], rtol=1e-14)
    np.testing.assert_allclose(table.sigma, [0.65e-6, 0.52])
    assert [segment.way for segment in table.segments] == ["two-way", "three-way"]


def test_ades_observers_that_move_and_offsets_from_stars(tmp_path):
    place = "<sys>ICRF_KM</sys><ctr>399</ctr><pos1>1000</pos1><pos2>-2000.5</pos2><pos3>3</pos3>"
    star = TIME + "<stn>244</stn><raStar>100</raStar><decStar>60</decStar>"
    star += "<deltaRA>1.0</deltaRA><deltaDec>-2.0</deltaDec>"
    table = pz.read_tracking(ades(tmp_path, OPTICAL + place, star, OPTICAL + "<deprecated>X</deprecated>"))
    np.testing.assert_allclose(table.places, [[1e6, -2000500.0, 3e3]])
    assert table.place.tolist() == [0, 0, -1, -1] and table.extra["place_axes"][0] == "GCRF"
    np.testing.assert_allclose(np.degrees(table.value[2:]), [100 + 2 / 3600, 60 - 2 / 3600], rtol=1e-12)
    assert table.left_out == (("observations that are deprecated", 1),)


@pytest.mark.parametrize(
    "old, new, what",
    [
        ("12:23:34.123Z", "12:23:34.123", "line 2: obsTime is"),
        ("215.10254", "375.0", "line 2: right ascension 375"),
        ("0.09", "-0.09", "line 2: rmsRA is -0.09"),
        ("-0.214", "-1.214", "line 2: rmsCorr"),
        ("<ra>215.10254</ra>", "", "line 2: the observation has neither ra and dec"),
        ("</obsData>", "", "line 2: the file is no whole XML"),
        ("<stn>F51</stn>", "<stn>F51</stn><sys>ITRF</sys>", "line 2: sys is 'ITRF'"),
    ],
)
def test_each_mistake_of_ades_has_one_line(tmp_path, old, new, what):
    path = ades(tmp_path, OPTICAL)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(ValueError, match=what) as error:
        pz.read_tracking(path)
    assert "\n" not in str(error.value) and "a.xml" in str(error.value)
