"""Files of Earth orientation: the two of the IERS, and broken ones."""

from pathlib import Path

import astropy_iers_data
import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.earth import delta_t, read_eop
from piazzi.earth.eop import ARCSEC


def head(path: str, count: int) -> list[str]:
    return Path(path).read_text(encoding="ascii").splitlines()[:count]


def test_rows_of_finals2000a(tmp_path):
    file = tmp_path / "finals"
    file.write_text("\n".join(head(astropy_iers_data.IERS_A_FILE, 10)))
    table = read_eop(file)
    # 1973-01-02: UT1-UTC 0.8084178 s with TAI-UTC 12 s; pole 0.120733, 0.136966 arcsec; dX, dY -0.766, -0.720 mas
    assert table.mjd[0] == 41684.0 and len(table.mjd) == 10
    assert table.daily_ut1_tai[0] == pytest.approx(0.8084178 - 12.0, abs=1e-12)
    assert_allclose(table.daily_pole[0] / ARCSEC, [0.120733, 0.136966, -0.000766, -0.000720], rtol=1e-12)
    assert table.measured == 41693.0


def test_rows_of_c04(tmp_path):
    file = tmp_path / "c04"
    file.write_text("\n".join(head(astropy_iers_data.IERS_B_FILE, 16)))
    table = read_eop(file)
    assert table.mjd[0] == 37665.0
    assert_allclose(table.daily_pole[0] / ARCSEC, [-0.0127, 0.213, 0, 0], rtol=1e-12)
    # 1962-01-01: TAI-UTC 1.845858 s (UTC - TAI formula of that time), UT1-UTC 0.0326338 s
    assert table.daily_ut1_tai[0] == pytest.approx(0.0326338 - 1.845858, abs=1e-6)


def test_the_two_agree_where_both_have_measured():
    one, other = read_eop(astropy_iers_data.IERS_A_FILE), read_eop(astropy_iers_data.IERS_B_FILE)
    days = np.arange(57000.0, 60000.0)
    a, b = (table.daily_ut1_tai[(days - table.mjd[0]).astype(int)] for table in (one, other))
    assert np.abs(a - b).max() < 2e-4  # s: the errors of daily UT1 in the rapid file


@pytest.mark.parametrize("cell", ["0.1234567", " .1234567", "-.1234567", "+0.123456", "12345.e-5", "1234567.0", "- .123456"])
def test_numbers_in_columns_are_those_of_float(tmp_path, cell):
    lines, file = head(astropy_iers_data.IERS_B_FILE, 20), tmp_path / "c04"
    lines[12] = lines[12][:38] + f"{cell:>12}" + lines[12][50:]
    file.write_text("\n".join(lines))
    if cell.startswith("- "):
        with pytest.raises(ValueError, match=r"line 13: '- \.123456' is not a number"):
            read_eop(file)
        return
    columns = (26, 38), (38, 50), (62, 74), (74, 86)
    wanted = np.array([[float(line[a:b]) for a, b in columns] for line in lines if line[:4].isdigit()])
    assert (read_eop(file).daily_pole == wanted * ARCSEC).all()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda lines: ["hello", *lines], "neither finals2000A nor EOP C04"),
        (
            lambda lines: [*lines[:3], lines[3].replace("0.7998729", "0.79x8729"), *lines[4:]],
            "line 4: '0.79x8729' is not a number",
        ),
        (lambda lines: [*lines[:3], *lines[4:]], "after MJD 41686 one is missing"),
        (lambda lines: lines[:3], "at least four"),
        (lambda lines: [], "neither finals2000A nor EOP C04"),
    ],
)
def test_broken_files_are_refused_with_the_place(tmp_path, damage, message):
    file = tmp_path / "eop.txt"
    file.write_text("\n".join(damage(head(astropy_iers_data.IERS_A_FILE, 10))))
    with pytest.raises(ValueError, match=message) as refused:
        read_eop(file)
    assert str(refused.value).startswith("eop.txt")


# Means of Morrison and Stephenson 2004 with their standard errors, as the source of the polynomials prints them
@pytest.mark.parametrize(
    ("year", "value", "error"), [(1600, 120, 20), (1700, 9, 5), (1750, 13, 2), (1800, 14, 1), (1850, 7, 1), (1900, -3, 1)]
)
def test_delta_t_is_that_of_its_source(year, value, error):
    assert abs(float(delta_t.delta_t(np.array(float(year)))) - value) <= error
    assert float(delta_t.delta_t_error(np.array(float(year)))) == pytest.approx(error)


def test_delta_t_meets_the_tables_of_1962():
    table = read_eop(astropy_iers_data.IERS_B_FILE)
    assert 32.184 - table.daily_ut1_tai[0] == pytest.approx(float(delta_t.delta_t(np.array(1962.0))), abs=0.3)
    for piece in (1700.0, 1800.0, 1860.0, 1900.0, 1920.0, 1941.0, 1961.0):
        before, after = delta_t.delta_t(np.array([piece - 1e-6, piece]))
        assert before == pytest.approx(after, abs=0.6)


def test_years_without_a_model_are_refused():
    with pytest.raises(ValueError, match=r"year 1500\.00: Delta T is known here from 1600 to 1986"):
        delta_t.delta_t(np.array(1500.0))
