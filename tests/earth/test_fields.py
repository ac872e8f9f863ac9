"""Gravity coefficients: the package against its source, every layout, changes in time, and broken files."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from piazzi.earth import Epoch, GravityField, gravity_field, read_gravity
from piazzi.earth.fields import normalisation
from tests.waiting import little

HEAD = """\
product_type                gravity_field
modelname                   small
earth_gravity_constant      0.3986004415E+15
radius                      0.63781363E+07
max_degree                  2
errors                      no
norm                        fully_normalized
tide_system                 zero_tide
end_of_head ====
"""
ROWS = "gfc 0 0 1.0 0.0\ngfc 2 0 -0.4841D-03 0.0d0\ngfc 2 1 0 0\ngfc 2 2 2.4e-6 -1.4e-6\n"


@pytest.fixture
def small(tmp_path):
    def write(text: str, name: str = "small.gfc") -> Path:
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


def test_the_field_in_the_package_is_that_of_its_source(data_dir):
    packaged, source = gravity_field("EGM2008"), read_gravity(data_dir / "earth/gravity/EGM2008_120.gfc")
    assert packaged.degree == 120 and packaged.tide_system == "tide_free"
    assert (packaged.gm, packaged.radius) == (source.gm, source.radius) == (3.986004415e14, 6378136.3)
    assert_array_equal(packaged.c, source.c)
    assert_array_equal(packaged.s, source.s)
    with pytest.raises(ValueError, match="read-only"):
        packaged.c[2, 0] = 0.0


@pytest.mark.parametrize(
    ("file", "degree", "tide", "place", "c", "s"),
    [  # read in the files by eye
        ("GGM05S.gfc", 180, "zero_tide", (2, 0), -0.48416945732e-3, 0.0),
        ("JGM3.gfc", 70, "unknown", (3, 0), 0.957170590888e-6, 0.0),
        ("EGM96-truncated-21x21", 21, "tide_free", (5, 5), 0.174971983203e-6, -0.669384278219e-6),
        ("eigen-6s-truncated", 20, "tide_free", (2, 0), -4.84165299820e-4, 0.0),
    ],
)
def test_every_layout(data_dir, file, degree, tide, place, c, s):
    field = read_gravity(data_dir / "earth/gravity" / file)
    assert (field.degree, field.tide_system) == (degree, tide)
    assert (field.c[place], field.s[place]) == (c, s)
    assert field.c[0, 0] == 1.0


def test_a_field_with_rates_and_waves_at_a_date(data_dir):
    field = read_gravity(data_dir / "earth/gravity/eigen-6s-truncated")
    epoch = Epoch("2007-04-02T07:30:00 TT")
    years = (epoch - Epoch("2005-01-01 TT")) / (365.25 * 86400)
    turn = 2 * np.pi * years
    # the rows of degree 2, order 0, and the rule, both as the file's own header gives them
    expected = -4.84165299820e-04 - 1.26059939709e-11 * years
    expected += 4.10019292536e-11 * np.cos(turn) + 5.32367408468e-11 * np.sin(turn)
    expected += 3.33920225943e-11 * np.cos(2 * turn) - 2.44369818145e-11 * np.sin(2 * turn)
    now = field.at(epoch)
    assert now.c[2, 0] == pytest.approx(expected, abs=1e-19)
    assert now.terms == ()
    assert field.terms  # the field itself keeps its changes


def test_a_field_in_pieces_at_a_date(data_dir):
    field = read_gravity(data_dir / "earth/gravity/EIGEN-6S4-v2-truncated")
    epoch = Epoch("1999-07-02 TT")  # in the piece from 1950 to 15 August 2002
    turn = 2 * np.pi * (epoch - Epoch("1950-01-01 TT")) / (365.25 * 86400)
    expected = 7.01776593302e-11 + 7.81500675516e-11 * np.cos(turn) - 2.91423806169e-12 * np.sin(turn)
    expected += -3.34601799827e-11 * np.cos(2 * turn) - 2.09359348050e-11 * np.sin(2 * turn)
    assert field.at(epoch).c[1, 0] == pytest.approx(expected, abs=1e-20)
    assert field.at(Epoch("2200-01-01 TT")).c[2, 0] == pytest.approx(-4.8416e-4, abs=2e-8)


def test_the_permanent_tide_is_counted_once(small):
    zero = read_gravity(small(HEAD + ROWS))
    free = zero.in_tide_system("tide_free")
    # IERS Conventions 2010, 6.2.2: the zero-tide C20 has the permanent deformation, 4.2e-9, and it makes the Earth flatter
    assert free.c[2, 0] - zero.c[2, 0] == pytest.approx(4.2e-9, abs=0.01e-9)
    assert_allclose(free.in_tide_system("zero_tide").c, zero.c, rtol=0, atol=1e-19)
    assert zero.in_tide_system("zero_tide").c[2, 0] == zero.c[2, 0]
    unknown = read_gravity(small(HEAD.replace("zero_tide", "unknown") + ROWS))
    with pytest.raises(ValueError, match=r"small \(small.gfc\) says unknown of its tide system: name it"):
        unknown.in_tide_system("tide_free")


def test_unnormalised_coefficients_are_normalised(small):
    plain = read_gravity(small(HEAD.replace("fully_normalized", "unnormalized") + ROWS))
    # J2 = -C20 unnormalised = -sqrt(5) C20 normalised; and sqrt(5/12) for (2, 2)
    assert plain.c[2, 0] == pytest.approx(-0.4841e-3 / np.sqrt(5), rel=1e-15)
    assert plain.c[2, 2] == pytest.approx(2.4e-6 / np.sqrt(5 / 12), rel=1e-14)
    assert normalisation(3)[3, 1] == pytest.approx(np.sqrt(7 / 6), rel=1e-14)


def test_a_field_cut_at_a_degree_and_order():
    field = gravity_field("EGM2008")
    cut = field.truncated(8, 3)
    assert cut.c.shape == (9, 9) and not cut.c[:, 4:].any() and cut.c[8, 3] == field.c[8, 3]
    with pytest.raises(ValueError, match=r"degree 121 and order 121 are asked for; EGM2008 \(package, .*\) goes to 120"):
        field.truncated(121)


def test_loading_the_package_is_quick():
    from piazzi.earth.fields import _packaged

    # a bound on accidents only: 3 ms when measured
    assert isinstance(little(lambda: _packaged.__wrapped__("EGM2008"), 1.0), GravityField)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + ROWS.replace("-1.4e-6", "-1.4x-6"), "small.gfc, line 13: '-1.4x-6' is not a number"),
        (HEAD + ROWS.replace("-1.4e-6", "nan"), "line 13: 'nan' is not finite"),
        (HEAD + ROWS.replace(" -1.4e-6", ""), "line 13: a row has degree, order, C and S; this one has 3 values"),
        (HEAD + ROWS + "gfc 2 2 0 0\n", "line 14: degree 2, order 2 stands twice"),
        (HEAD + ROWS + "gfc 3 0 0 0\n", "line 14: degree 3, order 0 in a field of degree 2"),
        (HEAD + ROWS + "gfc 2 -1 0 0\n", "line 14: '-1' is no degree or order"),
        (
            HEAD.replace("max_degree                  2", "max_degree 40") + ROWS,
            "max_degree is 40, but the rows end at degree 2",
        ),
        (HEAD.replace("max_degree                  2", "max_degree 99999") + ROWS, "'99999' is no degree"),
        (HEAD.replace("radius", "radios") + ROWS, "the header has no radius"),
        (HEAD.replace("0.63781363E+07", "-1") + ROWS, "radius -1; both must be positive"),
        (HEAD.replace("errors                      no", "errors maybe") + ROWS, "errors 'maybe' are not known"),
        (HEAD + ROWS + "trnd 2 0 1e-11 0\n", "degree 2, order 0 has no row gfct before it"),
        ("hello\n", "neither an ICGEM file"),
        ("", "neither an ICGEM file"),
    ],
)
def test_broken_files_are_refused_with_the_place(small, text, message):
    with pytest.raises(ValueError, match=message) as refused:
        read_gravity(small(text))
    assert str(refused.value).startswith("small.gfc")


def test_an_unknown_model_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"'EGM84' is neither in the package \(EGM2008, IERS2010\) nor a file"):
        gravity_field("EGM84", tmp_path)
