"""Orbit messages: what stands in the files, written down by hand, and broken files refused with their line."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz

DAY = 86400.0
# file: arcs as (states, first date, last date, first position and velocity in km, frame, centre, object), in this order
EPHEMERIDES = {
    "OEMExample1.txt": [
        (4, "1996-12-18T12:00:00.331", "1996-12-28T21:28:00.331",
         (2789.619, -280.045, -1746.755, 4.73372, -2.49586, -1.04195)),
        (4, "1996-12-28T21:29:07.267", "1996-12-30T01:28:02.267",
         (-2432.166, -63.042, 1742.754, 7.33702, -3.495867, -1.041945)),
        (5, "1996-12-28T21:29:07.267", "1996-12-30T01:28:02.267",
         (-2432.166, -63.042, 1742.754, 7.33702, -3.495867, -1.041945)),
    ],
    "OEMExample3.txt": [
        (3, "1996-12-18T12:00:00.331", "1996-12-18T12:02:00.331",
         (2789.619, -280.045, -1746.755, 4.73372, -2.49586, -1.04195)),
        (3, "1996-12-28T21:29:07.267", "1996-12-28T22:00:02.267",
         (-2432.166, -63.042, 1742.754, 7.33702, -3.495867, -1.041945)),
        (3, "1996-12-28T21:29:07.267", "1996-12-28T22:00:02.267",
         (-2432.166, -63.042, 1742.754, 7.33702, -3.495867, -1.041945)),
    ],
    "OEMExample3.xml": [
        (4, "1996-12-18T12:00:00.331", "1996-12-28T21:28:00.331",
         (2789.6, -280.0, -1746.8, 4.73, -2.50, -1.04)),
    ],
    "OEMExample5.txt": [
        (49, "2017-04-11T22:31:43.121856", "2017-04-12T22:31:43.121856",
         (2906.2752178573, 4076.3580691129, 4561.3636609099, -6.8794973158, 1.4495313106, 3.0813176196)),
    ],
    "oemLowerCaseValue.oem": [
        (6, "2015-08-27T00:00:00", "2015-08-27T00:05:00",
         (-1600.194956730110, -6345.331918850360, 1422.104331222477, 7.520571068128, -1.773112169167, 0.5662794064653)),
    ],
    "test_cov.oem": [
        (2, "2019-09-09T00:00:00", "2019-09-09T00:01:00",
         (3156.6549969124, -5911.7573076895715, -1096.3791113140421, 4.69978050838293, 1.4281202051395843, 5.885987840847974)),
    ],
}  # fmt: skip
ABOUT = {
    "OEMExample1.txt": ("MARS GLOBAL SURVEYOR", "1996-062A", "MARS BARYCENTER", "EME2000", "UTC"),
    "OEMExample3.txt": ("MARS GLOBAL SURVEYOR", "1996-062A", "MARS BARYCENTER", "EME2000", "UTC"),
    "OEMExample3.xml": ("MARS GLOBAL SURVEYOR", "2000-028A", "MARS BARYCENTER", "EME2000", "UTC"),
    "OEMExample5.txt": ("ISS", "1998-067A", "EARTH", "GCRF", "UTC"),
    "oemLowerCaseValue.oem": ("test", "2000-000A", "EARTH", "EME2000", "UTC"),
    "test_cov.oem": ("25544", "25544", "EARTH", "TOD", "UTC"),
}
LOWER = [
    3.331349476038534e-04, 4.618927349220216e-04, 6.782421679971363e-04, -3.070007847730449e-04, -4.221234189514228e-04,
    3.231931992380369e-04, -3.349365033922630e-07, -4.686084221046758e-07, 2.484949578400095e-07, 4.296022805587290e-10,
    -2.211832501084875e-07, -2.864186892102733e-07, 1.798098699846038e-07, 2.608899201686016e-10, 1.767514756338532e-10,
    -3.041346050686871e-07, -4.989496988610662e-07, 3.540310904497689e-07, 1.869263192954590e-10, 1.008862586240695e-10,
    6.224444338635500e-10,
]  # fmt: skip
BROKEN = {
    "odm/oem/OEM-covariance-number-format-error.txt": (52, "'this-is-not-a-number'; it must be a number"),
    "odm/oem/OEM-ephemeris-number-format-error.txt": (44, "a state is a date and six or nine numbers"),
    "odm/oem/OEM-inconsistent-time-systems.txt": (33, "TIME_SYSTEM is 'TCG', and UTC in line 11"),
    "odm/oem/OEM-keyword-within-covariance.txt": (91, "'USER_DEFINED_TEST_KEY' is no keyword of the covariances"),
    "odm/oem/OEM-keyword-within-ephemeris.txt": (24, "'USER_DEFINED_TEST_KEY = bad'"),
    "odm/oem/OEM-too-few-covariance-columns.txt": (55, "row 5 of a covariance has 5 numbers, not 4"),
    "odm/oem/OEM-too-large-covariance-dimension.txt": (91, "a covariance begins with EPOCH"),
    "odm/oem/OEM-too-many-covariance-columns.txt": (51, "row 1 of a covariance has 1 numbers, not 6"),
    "odm/oem/OEM-too-small-covariance-dimension.txt": (89, "the covariance of line 83 has 4 rows; it must have 6"),
    "odm/oem/OEM-wrong-keyword.txt": (19, "'WRONG_KEYWORD' is no keyword of the metadata"),
    "odm/oem/OEMExample2.txt": (13, "TIME_SYSTEM is 'MRT', which has no fixed relation to TT"),
    "odm/oem/OEMExample7.txt.post": (1, "of no format that is known"),
    "odm/oem/OEMExample7.txt.pre": (5, "do not end with META_STOP"),
    "odm/oem/OEMExample9.txt": (13, "'MRT'"),
    "odm/omm/OMM-empty-object-id.txt": (6, "has no OBJECT_ID"),
    "odm/omm/OMM-empty-object-id.xml": (11, "has no OBJECT_ID"),
    "odm/omm/OMM-number-format-error.txt": (15, "ARG_OF_PERICENTER is 'this-is-not-a-number'"),
    "odm/omm/OMM-wrong-keyword.txt": (9, "'WRONG_KEYWORD' is no keyword of an OMM"),
    "odm/omm/OMMExample3.txt": (13, "'MRT'"),
    "odm/omm/spurious-metadata.xml": (17, "one <metadata>, and this is the second"),
    "odm/opm/OPM-dummy-ssb.txt": (8, "'TCB'"),
    "odm/opm/OPM-incompatible-units.txt": (20, "SOLAR_RAD_AREA is in [s]; it must be in [m**2]"),
    "odm/opm/OPM-no-designator.txt": (11, "'GMST'"),
    "odm/opm/OPM-non-standard-units.txt": (12, "'GMST'"),
    "odm/opm/OPM-number-format-error.txt": (8, "'MET'"),
    "odm/opm/OPM-unknown-center.txt": (10, "'GMST'"),
    "odm/opm/OPM-wrong-keyword.txt": (11, "'WRONG_KEYWORD' is no keyword of an OPM"),
    "odm/opm/OPMExample6.txt": (13, "'GMST'"),
    "odm/opm/spurious-metadata.xml": (23, "one <metadata>, and this is the second"),
    "ndm/NDM-ocm-apm.xml": (1, "the file holds no OEM, OPM or OMM, but apm, ocm"),
    "ndm/NDM-opm-entity.xml": (2, "DOCTYPE"),
    "ndm/empty.xml": (1, "the file holds no OEM, OPM or OMM, but nothing"),
    "ndm/wrong-format.txt": (1, "of no format that is known"),
}


def matrix(lower):
    """The symmetric matrix of a lower triangle, entry by entry, in m and s."""
    out, given = np.zeros((6, 6)), iter(lower)
    for i in range(6):
        for j in range(i + 1):
            out[i, j] = out[j, i] = next(given) * 1e6
    return out


@pytest.mark.parametrize("name", EPHEMERIDES)
def test_ephemerides_hold_what_stands_in_them(name, data_dir):
    found = pz.read_ephemeris(data_dir / "ccsds/odm/oem" / name)
    assert found.format == "OEM" and len(found.arcs) == len(EPHEMERIDES[name])
    for arc, (count, first, last, state) in zip(found.arcs, EPHEMERIDES[name], strict=True):
        assert (arc.name, arc.identifier, arc.centre, arc.frame, arc.scale) == ABOUT[name]
        assert len(arc) == count
        for k, date in ((0, first), (-1, last)):
            assert abs(arc.instant(k) - pz.Epoch(f"{date} {arc.scale}")) < 1e-9
        assert_allclose(np.concatenate([arc.position[0], arc.velocity[0]]), np.array(state) * 1e3, rtol=1e-12)


def test_metadata_accelerations_and_covariances(data_dir):
    found = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample3.txt")
    second, third = found.arcs[1:]
    assert (second.interpolation, second.degree) == ("hermite", 2)
    assert [str(useable) for useable in second.useable] == ["1996-12-28T21:29:07.267 UTC", "1996-12-30T01:18:02.5 UTC"]
    assert_array_equal(second.acceleration[0], [0.0, 0.0, 0.0])
    assert np.isnan(second.acceleration[1:]).all()
    assert second.covariance_frames == ("EME2000",) and third.covariance_frames == ("RTN", "EME2000")
    assert_allclose(second.covariance[0, :2, :2], [[333.13494, 461.89273], [461.89273, 678.24216]], rtol=1e-15)
    assert_allclose(third.covariance[1, 5], np.array([-3.0302350e-07, -4.8783858e-07, 3.4302008e-07, 1.7581520e-10,
                                                      1.0077514e-10, 6.2244443e-10]) * 1e6, rtol=1e-15)  # fmt: skip
    assert abs(third.epoch + third.covariance_t[1] - pz.Epoch("1996-12-29T21:00:00 UTC")) < 1e-9
    xml = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample3.xml").arcs[0]
    assert_allclose(xml.acceleration[0], [8.0, 1.0, -159.0], rtol=1e-15)
    assert xml.covariance_frames == ("ITRF",) and dict(xml.said)["REF_FRAME"] == "J2000"
    framed = pz.read_ephemeris(data_dir / "ccsds/odm/oem/test_cov.oem").arcs[0]
    assert framed.frame_epoch == pz.Epoch("2019-09-09T00:00:00 UTC")
    assert pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEM-Issue839.txt").arcs[0].scale == "TAI"


@pytest.mark.parametrize("name", ["OEMExample4.txt", "OEMExample5ITRF.txt", "OEMExample6.txt", "OEMExample8.txt", "test.oem",
                                  "ISS.resampled.truncated.txt", "OEMExampleWithHeaderComment.txt"])  # fmt: skip
def test_rows_of_all_other_ephemerides_are_those_of_a_plain_reader(name, data_dir):
    path = data_dir / "ccsds/odm/oem" / name
    rows = [line.split() for line in path.read_text().split("COVARIANCE_START")[0].splitlines()]
    rows = [row for row in rows if len(row) in (7, 10) and row[0][:2] in ("19", "20")]
    found = pz.read_ephemeris(path)
    positions = np.concatenate([arc.position for arc in found.arcs])[: len(rows)]
    assert_array_equal(positions, np.array([[float(word) * 1e3 for word in row[1:4]] for row in rows]))
    lines = path.read_text().splitlines()
    assert lines[found.arcs[0].lines[0] - 1].split() == rows[0]


@pytest.mark.parametrize("name", ["OPMExample4.txt", "OPMExample3.txt", "OPM-frame-mapper-gcrf.txt"])
def test_states_of_messages(name, data_dir):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/opm" / name).arcs[0]
    frame = {"OPMExample4.txt": "RTN", "OPMExample3.txt": "TOD", "OPM-frame-mapper-gcrf.txt": "ZZRF"}[name]
    assert arc.covariance_frames == (frame,)
    assert_allclose(arc.covariance[0], matrix(LOWER), rtol=1e-15)
    if name == "OPMExample3.txt":
        assert str(arc.epoch) == "1998-12-18T14:28:15.1172 UTC" == str(arc.frame_epoch)
        assert_allclose(arc.velocity[0], [-873.160, 8740.420, -4191.076], rtol=1e-15)
        assert dict(arc.spacecraft) == {
            "mass": 3000.0, "radiation_area": 18.77, "radiation_coefficient": 1.0, "drag_area": 18.77, "drag_coefficient": 2.5,
        }  # fmt: skip
    else:
        assert_allclose(arc.position[0], [6655994.2, -40218575.1, -82917.7], rtol=1e-15)
        elements = dict(arc.elements)
        assert_allclose([elements["semi_major_axis"], elements["gm"]], [41399512.3, 398600.4415e9], rtol=1e-15)
        assert_allclose(elements["true_anomaly"], math.radians(41.922339), rtol=1e-15)
    if name == "OPM-frame-mapper-gcrf.txt":
        assert arc.scale == "TAI" and arc.frame == "ICRF"
        first, second = arc.burns
        assert abs(first.epoch - pz.Epoch("2000-06-03T09:00:34.1 TAI")) < 1e-9
        assert (first.duration, first.mass, first.frame, second.frame) == (132.6, -18.418, "EME2000", "RTN")
        assert_allclose(first.delta_v, [-23.257, 16.8316, -8.93444], rtol=1e-14)


def test_manoeuvres_and_time_scales_of_other_messages(data_dir):
    folder = data_dir / "ccsds/odm/opm"
    three = pz.read_ephemeris(folder / "OPMExample5.txt").arcs[0]
    assert len(three.burns) == 3 and three.scale == "GPS" and three.epoch == pz.Epoch("2006-06-03T00:00:00 GPS")
    partial = pz.read_ephemeris(folder / "OPMExamplePartialManeuver.txt")
    assert partial.arcs[0].burns[0].duration == 0.0 and math.isnan(partial.arcs[0].burns[0].mass)
    assert partial.assumed == ("manoeuvres without MAN_DURATION are impulsive",)
    for name, scale, centre in [("emb", "TT", "EMB"), ("solar-system-barycenter", "TDB", "SOLAR SYSTEM BARYCENTER"),
                                ("earth-moon-barycenter", "UT1", "EARTH MOON BARYCENTER"),
                                ("earth-barycenter", "TDB", "EARTH BARYCENTER"),
                                ("earth-dash-moon-barycenter", "TDB", "EARTH-MOON BARYCENTER")]:  # fmt: skip
        arc = pz.read_ephemeris(folder / f"OPM-dummy-{name}.txt").arcs[0]
        assert (arc.scale, arc.centre, arc.frame) == (scale, centre, "ICRF")
        assert abs(arc.epoch - pz.Epoch(f"2000-01-01T03:04:05.678 {scale}")) < 1e-9
    for name in ("OPMExample1.txt", "OPMExample2.txt", "OPMExample7.txt", "OPMExample8.txt", "OPM-dummy-moon-EME2000.txt"):
        assert len(pz.read_ephemeris(folder / name).arcs) == 1
    odd = pz.read_ephemeris(folder / "OPM-unknown-frame.txt")
    assert odd.arcs[0].frame == "ZZRF" and "--frame" in odd.open[0]


@pytest.mark.parametrize("path", ["odm/opm/OPMExample3.xml", "ndm/NDM-opm.xml"])
def test_states_in_xml(path, data_dir):
    arc = pz.read_ephemeris(data_dir / "ccsds" / path).arcs[0]
    assert str(arc.epoch) == "1996-12-18T14:28:15.1172 UTC" and arc.name == "OSPREY 5"
    assert arc.covariance_frames == ("ITRF",)
    assert_allclose(arc.covariance[0][5], np.array([0.245, 0.965, 0.950, 0.435, 0.621, 0.991]) * 1e6, rtol=1e-15)
    assert dict(arc.spacecraft)["mass"] == 3000.0


def test_units_beside_numbers_are_taken(data_dir, tmp_path):
    text = (data_dir / "ccsds/odm/opm/OPM-non-standard-units.txt").read_text().replace("GMST", "UTC")
    (tmp_path / "a").write_text(text)
    arc = pz.read_ephemeris(tmp_path / "a").arcs[0]
    assert_allclose(arc.position[0], [6503514.0, 1239647.0, -717490.0], rtol=1e-15)
    assert_allclose(arc.velocity[0], [-873.16, 8740.42, -4191.076], rtol=1e-15)
    assert_allclose(arc.covariance[0], matrix(LOWER), rtol=1e-15)
    assert arc.covariance_frames == ("TEME",)
    assert ("USER_DEFINED_EARTH_MODEL", "WGS-84") in arc.said


@pytest.mark.parametrize(
    "name", ["OMMExample1.txt", "OMMExample2.txt", "OMMExample2.xml", "OMM-with-units.xml", "OMMExample5.txt"]
)
def test_mean_elements(name, data_dir):
    found = pz.read_ephemeris(data_dir / "ccsds/odm/omm" / name)
    assert not found.arcs and len(found.mean) == 1
    mean = found.mean[0]
    assert mean.epoch == pz.Epoch("2007-064T10:34:41.4264 UTC")
    assert mean.theory == ("SGP4-XP" if name == "OMMExample5.txt" else "SGP/SGP4")
    elements = dict(mean.elements)
    assert_allclose(elements["mean_motion"], 1.00273272 * 2 * math.pi / DAY, rtol=1e-15)
    assert_allclose(elements["mean_anomaly"], math.radians(150.1602), rtol=1e-15)
    assert_allclose(elements["gm"], 398600.8e9, rtol=1e-15)
    assert dict(mean.said)["NORAD_CAT_ID"] == "23581" and mean.frame == "TEME"
    if "2." in name or "units" in name:
        assert_allclose(np.reshape(mean.covariance, (6, 6)), matrix(LOWER), rtol=1e-15)
        assert mean.covariance_frame == "TEME"


def test_other_mean_elements(data_dir):
    for name in ("OMMExample4.txt", "OMMExample4.xml"):
        mean = pz.read_ephemeris(data_dir / "ccsds/odm/omm" / name).mean[0]
        assert mean.name == "STARLETTE" and mean.epoch == pz.Epoch("2021-03-22T13:21:09.224928 UTC")
        assert dict(mean.elements)["eccentricity"] == 0.0205751 and dict(mean.said)["BSTAR"] == "-.47102E-5"
    mean = pz.read_ephemeris(data_dir / "ccsds/odm/omm/OMMExample3_utc.txt").mean[0]
    assert dict(mean.elements)["semi_major_axis"] == 6.8e6 and mean.covariance_frame == "TNW"
    assert dict(mean.spacecraft)["mass"] == 300.0


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_are_refused_with_file_line_and_reason(name, data_dir):
    line, reason = BROKEN[name]
    path = data_dir / "ccsds" / name
    with pytest.raises(ValueError) as refusal:
        pz.read_ephemeris(path)
    text = str(refusal.value)
    assert text.startswith(f"{path}: line {line}: ") and reason in text
    assert "\n" not in text and len(text) < 300 + len(str(path))


def test_states_are_fixes(data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/odm/oem/OEMExample3.txt")
    assert len(rows) == 9 * 6 and rows.kinds == ("x", "y", "z", "vx", "vy", "vz")
    assert_allclose(rows.value[:6], [2789619.0, -280045.0, -1746755.0, 4733.72, -2495.86, -1041.95], rtol=4e-16)
    assert rows.objects == ("MARS GLOBAL SURVEYOR",) and rows.stations == ()
    assert rows.segments[0].frame == "EME2000"
    second = rows[rows.segment == 1]
    assert_allclose(second.sigma[:2], [math.sqrt(333.13494), math.sqrt(678.24216)], rtol=1e-15)
    assert np.isnan(second.sigma[6:]).all() and "--sigma" in rows.open[-1]
    with pytest.raises(ValueError, match="mean elements, which are no measurements"):
        pz.read_tracking(data_dir / "ccsds/odm/omm/OMMExample1.txt")
    with pytest.raises(ValueError, match="measurements, no orbit"):
        pz.read_ephemeris(data_dir / "ccsds/tdm/kvn/TDMExample2.txt")


OEM = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2020-01-01T00:00:00
ORIGINATOR = X
META_START
OBJECT_NAME = A
OBJECT_ID = B
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
START_TIME = 2020-01-01T00:00:00
STOP_TIME = 2020-01-01T00:01:00
META_STOP
2020-01-01T00:00:00 7000 0 0 0 7.5 0
2020-01-01T00:01:00 6990 400 0 0 7.5 0
"""


def test_axes_that_nobody_knows_are_those_that_the_user_says(data_dir):
    path = data_dir / "ccsds/odm/opm/OPM-unknown-frame-mapper.txt"
    told = pz.read_ephemeris(path, frame="gcrf")
    assert (told.arcs[0].frame, told.arcs[0].covariance_frames, told.open) == ("GCRF", ("GCRF",), ())
    assert pz.read_tracking(path, frame="GCRF").segments[0].frame == "GCRF"
    known = data_dir / "ccsds/odm/opm/OPMExample4.txt"
    assert pz.read_ephemeris(known, frame="GCRF").arcs[0].frame == "TOD"
    with pytest.raises(ValueError, match="axes 'ITTF' are none of"):
        pz.read_ephemeris(known, frame="ITTF")


def test_names_may_have_brackets(tmp_path):
    (tmp_path / "a").write_text(OEM.replace("OBJECT_NAME = A", "OBJECT_NAME = DEBRIS [1993-036A]"))
    assert pz.read_ephemeris(tmp_path / "a").objects == ("DEBRIS [1993-036A]",)


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("00:01:00 6990", "00:00:00 nan", 14, "a state is a date"),
        ("T00:01:00 6990", " 00:01:00 6990", 14, "a state is a date"),
        ("2020-01-01T00:01:00 6990", "2019-01-01T00:01:00 6990", 14, "the state is before the one above it"),
        ("2020-01-01T00:01:00 6990", "2020-13-01T00:01:00 6990", 14, "is no date of UTC"),
        ("2020-01-01T00:01:00 6990", "1950-12-01T00:01:00 6990", 14, "is no date of UTC"),
        ("STOP_TIME = 2020", "STOP_TIME = 2O20", 11, "STOP_TIME: date '2O20-01-01T00:01:00' cannot be read"),
        ("OBJECT_ID = B\n", "", 11, "the metadata has no OBJECT_ID"),
        ("META_STOP\n", "INTERPOLATION_DEGREE = 5.5\nMETA_STOP\n", 12, "must be a whole number"),
        ("VERS = 2.0", "VERS = 4.0", 1, "the version of the message is '4.0'"),
        ("2020-01-01T00:00:00 7000 0 0 0 7.5 0\n2020-01-01T00:01:00 6990 400 0 0 7.5 0\n", "", 12, "the segment has no states"),
        ("400 0 0 7.5 0\n", "400 0 0 7.5 0\nCOVARIANCE_START\n", 15, "do not end with COVARIANCE_STOP"),
        ("400 0 0 7.5 0\n", "400 0 0 7.5 0\nCOVARIANCE_START\nCOVARIANCE_STOP\n2020\n", 17, "stands behind the covariances"),
        ("META_START\n", "META_START\nMETA_START\n", 4, "do not end with META_STOP"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, old, new, line, says):
    assert old in OEM
    (tmp_path / "a").write_text(OEM.replace(old, new, 1))
    with pytest.raises(ValueError, match=f": line {line}: ") as refusal:
        pz.read_ephemeris(tmp_path / "a")
    assert says in str(refusal.value)


def test_opm_whose_metadata_have_marks(tmp_path):
    """Other messages put them between META_START and META_STOP, and some write OPM and OMM so, too."""
    text = """CCSDS_OPM_VERS = 2.0
CREATION_DATE = 2017-06-21T13:20:25
ORIGINATOR = X

META_START
OBJECT_NAME = A
OBJECT_ID = 1998-067A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
META_STOP

EPOCH = 2008-09-20T12:25:40.104192
X = 3459023.611 [m]
Y = 5617.725542 [km]
Z = 1316.222323
X_DOT = -3535.844 [m/s]
Y_DOT = 3.550405
Z_DOT = -5.846067 [km/s]
"""
    path = tmp_path / "a.opm"
    path.write_text(text)
    (arc,) = pz.read_ephemeris(path).arcs
    np.testing.assert_allclose(arc.position, [[3459023.611, 5617725.542, 1316222.323]], rtol=1e-14)
    np.testing.assert_allclose(arc.velocity, [[-3535.844, 3550.405, -5846.067]], rtol=1e-14)
