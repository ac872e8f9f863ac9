"""Predictions for laser stations: values by hand from the files, each field of their headers, leap seconds."""

import numpy as np
import pytest

import piazzi as pz

ONE = """\
H1 CPF  2  HTS 2016 12 31 12 366 1 lageos1 NONE
H2  7603901 1155     8820 2016 12 31  0  0  0 2017  1  2  0  0  0   300 1 1  {frame} 0 {com} 1
H5 0.2510
H9
10 {direction} 57753  86399.500000  0    2966379.904    4195129.466  -11136763.061
20 {direction} 1.0 -2.0 3.5
10 {direction} 57754  0.250000  1    2966379.904    4195129.466  -11136763.061
10 {direction} 57754  2.250000  1    2966379.904    4195129.466  -11136763.061
99
"""


def cpf(tmp_path, frame=0, com=0, direction=0, **changes):
    text = ONE.format(frame=frame, com=com, direction=direction)
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "a.cpf"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "place, name, target, cospar, states, first, last, position, end",
    [
        ("ilrs", "galileo212_cpf_180613_6641.esa", "galileo212", "2016-069B", 193, "2018-06-12T23:59:42", "2018-06-14T23:59:42",
         (-3442706.377, 29234902.063, 3170080.159), (-7329586.488, -24111259.078, -15507306.979)),
        ("ilrs", "lageos1_cpf_180613_16401.hts", "lageos1", "1976-039A", 582, "2018-06-12T23:30:00", "2018-06-14T23:55:00",
         (2966379.904, 4195129.466, -11136763.061), (-5292229.761, 4106329.723, -10235338.181)),
        ("ilrs", "cpf_all_fields.csg", "orekitSat", "2012-345BU", 2, "2018-06-12T23:59:42", "2018-06-13T00:14:42",
         (-3442706.377, 29234902.063, 3170080.159), (-3443218.148, 29401194.353, 489466.784)),
        ("earth/lageos2", "lageos2_cpf_160213_5441.sgf", "lageos2", "1992-070B", 288,
         "2016-02-13T00:00:00", "2016-02-13T23:55:00",
         (7049498.186, 5346456.274, 8307028.039), (-10108280.313, -3150523.401, -6140646.075)),
    ],
)  # fmt: skip
def test_predictions_of_the_ilrs(data_dir, place, name, target, cospar, states, first, last, position, end):
    (arc,) = pz.read_ephemeris(data_dir / place / name).arcs
    assert (arc.name, arc.identifier, arc.frame, arc.scale, len(arc)) == (target, cospar, "ITRF", "UTC", states)
    assert (
        abs(arc.instant(0) - pz.Epoch(f"{first} UTC")) < 1e-9 and abs(arc.instant(states - 1) - pz.Epoch(f"{last} UTC")) < 1e-9
    )
    np.testing.assert_array_equal(arc.position[[0, -1]], [position, end])


@pytest.mark.parametrize(
    "name, line, what",
    [
        ("cpf_corrupted_data.csg", 4, "position is 'corrupted'"),
        ("cpf_invalid_format.csg", 1, "H1 says 'CDR'"),
        ("cpf_unexpected_end_of_file.csg", 6, "cut short"),
    ],
)
def test_broken_files_are_refused_with_their_line(data_dir, name, line, what):
    read = pz.read_tracking if "format" in name else pz.read_ephemeris
    with pytest.raises(ValueError, match=what) as error:
        read(data_dir / "ilrs" / name)
    assert f"{name}: line {line}: " in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("code, frame", [*enumerate(("ITRF", "TOD", "EME2000"))])
def test_each_frame(tmp_path, code, frame):
    assert pz.read_ephemeris(cpf(tmp_path, frame=code)).arcs[0].frame == frame


def test_velocities_and_what_positions_are_of(tmp_path):
    orbit = pz.read_ephemeris(cpf(tmp_path))
    np.testing.assert_array_equal(orbit.arcs[0].velocity[:2], [[1.0, -2.0, 3.5], [np.nan] * 3])
    assert dict(orbit.said)["positions of"] == "the centre of mass"
    assert dict(pz.read_ephemeris(cpf(tmp_path, com=1)).said)["positions of"] == "the reflector"


def test_readings_go_on_over_a_leap_second(tmp_path):
    """2016 ended with 23:59:60: under the flag, a reading 0.25 s past midnight is 23:59:60.25, one of 2.25 s 00:00:01.25."""
    (arc,) = pz.read_ephemeris(cpf(tmp_path)).arcs
    assert [arc.instant(k).to("UTC") for k in range(3)] == [
        "2016-12-31T23:59:59.5 UTC", "2016-12-31T23:59:60.25 UTC", "2017-01-01T00:00:01.25 UTC",
    ]  # fmt: skip
    np.testing.assert_allclose(np.diff(arc.t), [0.75, 2.0], rtol=0, atol=1e-9)


def test_positions_with_light_time_are_no_orbit(tmp_path):
    with pytest.raises(ValueError, match="light time"):
        pz.read_ephemeris(cpf(tmp_path, direction=1))


@pytest.mark.parametrize(
    "old, new, what",
    [
        ("99\n", "", "ends without record 99"),
        ("2966379.904", "inf", "line 5: position is 'inf'"),
        ("57754  2.25", "57754  0.25", "line 8: the position is not later"),
        ("20 0 1.0 -2.0 3.5", "80 0 1.0 -2.0 3.5", "line 6: record '80' is not known"),
        ("300 1 1  0", "300 1 1  7", "line 2: reference frame 7"),
        ("CPF  2", "CPF  4", "line 1: CPF version 4"),
        ("86399.5", "99999.5", "line 5: the second of the day"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, old, new, what):
    with pytest.raises(ValueError, match=what) as error:
        pz.read_ephemeris(cpf(tmp_path, **{old: new}))
    assert "\n" not in str(error.value) and "a.cpf" in str(error.value)
