"""Sigmas of astrometry by the tables of Veres et al. (2017), fewer of a crowded night, and biases of star catalogues."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.formats.catalogue_bias import CATALOGUES, pixel_of

ARCSECOND = np.pi / 648000.0


def line(date, station, technique="C", catalogue="V", name="00433"):
    """One line in 80 columns."""
    text = f"{name:14s}{technique}{date:17s}12 43 22.430-10 51 17.10{'':9s}14.2 V{catalogue}MPE01{station:3s}"
    assert len(text) == 80
    return text


def read(tmp_path, *lines, **said):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines) + "\n")
    return pz.read_tracking(path, **said)


@pytest.mark.parametrize(
    ("date", "station", "technique", "catalogue", "arcseconds"),
    [
        ("2013 12 31.50000 ", "703", "C", "V", 1.0),
        ("2014 01 01.50000 ", "703", "C", "V", 0.8),
        ("2002 12 31.50000 ", "691", "C", "V", 0.6),
        ("2003 09 01.50000 ", "644", "C", "V", 0.4),
        ("2020 01 01.50000 ", "F51", "C", "V", 0.2),
        ("2020 01 01.50000 ", "G96", "B", "V", 0.5),
        ("2020 01 01.50000 ", "568", "C", "V", 0.1),
        ("2020 01 01.50000 ", "568", "C", "t", 0.2),
        ("2020 01 01.50000 ", "568", "C", "q", 1.0),
        ("2020 01 01.50000 ", "K92", "C", "V", 0.4),
        ("2020 01 01.50000 ", "250", "C", "V", 1.0),
        ("2020 01 01.50000 ", "250", "C", " ", 1.5),
        ("1880 01 01.50000 ", "535", " ", " ", 10.0),
        ("1949 01 01.50000 ", "703", " ", " ", 5.0),
        ("1950 06 01.50000 ", "675", "P", " ", 2.5),
        ("1990 06 01.50000 ", "675", "T", " ", 0.5),
        ("1990 06 01.50000 ", "675", "e", " ", 0.75),
        ("1890 06 01.50000 ", "675", "M", " ", 2.0),
        ("1990 06 01.50000 ", "675", "E", " ", 0.2),
    ],
)  # fmt: skip
def test_sigmas_of_the_paper(tmp_path, date, station, technique, catalogue, arcseconds):
    rows = read(tmp_path, line(date, station, technique, catalogue))
    np.testing.assert_allclose(rows.sigma / ARCSECOND, arcseconds, rtol=1e-12)
    assert any("Veres et al. 2017" in text for text in rows.assumed)


def test_a_night_of_a_station_counts_as_four_rows(tmp_path):
    """Sigmas of N > 4 rows grow by sqrt(N/4): together they tell as much as four."""
    night = [line(f"2020 01 01.{k}0000 ", "G96") for k in range(1, 7)]
    rows = read(tmp_path, *night, line("2020 01 02.40000 ", "G96"), line("2020 01 01.30000 ", "F51"))
    right = rows[rows.of_kind("right_ascension")]
    np.testing.assert_allclose(right.sigma[:6] / ARCSECOND, 0.5 * np.sqrt(6 / 4))
    np.testing.assert_allclose(np.sum(right.sigma[:6] ** -2.0), 4 * (0.5 * ARCSECOND) ** -2.0)
    np.testing.assert_allclose(right.sigma[6:] / ARCSECOND, [0.5, 0.2])
    assert any("more than four rows" in text for text in rows.assumed)


def test_what_the_user_and_the_file_say_goes_before(tmp_path):
    rows = read(tmp_path, line("2020 01 01.50000 ", "G96"), sigma="2arcsec")
    np.testing.assert_allclose(rows.sigma / ARCSECOND, 2.0)
    head = "permID|provID|stn|obsTime|ra|dec|rmsRA|rmsDec|astCat|mode\n"
    (tmp_path / "a.psv").write_text(
        f"{head}433||F51|2016-08-29T12:23:34Z|215.1|-12.5|0.09|0.08|Gaia1|CCD\n433||F51|2016-08-30T12:23:34Z|215.1|-12.5|||Gaia1|CCD\n"
    )
    np.testing.assert_allclose(pz.read_tracking(tmp_path / "a.psv").sigma / ARCSECOND, [0.09, 0.08, 0.2, 0.2])


def test_pixels_are_those_of_equal_area_whose_centres_are_in_them():
    """Centres by the formulas of Gorski et al. (2005), rings that begin at longitude zero; as many directions in each."""
    sides = 4
    p = np.arange(12 * sides**2)
    z, longitude = np.empty(len(p)), np.empty(len(p))
    for i in p:
        south = i >= 12 * sides**2 // 2 + 2 * sides and 12 * sides**2 - 1 - i < 2 * sides * (sides - 1)
        k = 12 * sides**2 - 1 - i if south else i
        if k < 2 * sides * (sides - 1):
            ring = int(np.floor(np.sqrt((k + 1) / 2 - np.sqrt(np.floor((k + 1) / 2))))) + 1
            j = k + 1 - 2 * ring * (ring - 1)
            z[i], longitude[i] = 1 - ring**2 / (3 * sides**2), np.pi / (2 * ring) * (j - 0.5)
        else:
            q = k - 2 * sides * (sides - 1)
            ring, j = q // (4 * sides) + sides, q % (4 * sides) + 1
            z[i], longitude[i] = (
                4 / 3 - 2 * ring / (3 * sides),
                np.pi / (2 * sides) * (j - (0.5 if (ring - sides) % 2 == 0 else 1.0)),
            )
        if south:
            z[i], longitude[i] = -z[i], 2 * np.pi - longitude[i]
    assert np.array_equal(pixel_of(sides, longitude, np.arcsin(z)), p)
    rng = np.random.default_rng(1)
    found = pixel_of(sides, rng.uniform(-2 * np.pi, 2 * np.pi, 400_000), np.arcsin(rng.uniform(-1, 1, 400_000)))
    count = np.bincount(found, minlength=len(p))
    assert len(count) == len(p) and abs(count - 400_000 / len(p)).max() < 5.5 * np.sqrt(400_000 / len(p))


def biases(tmp_path, sides=1):
    """A table whose pixel p has for catalogue c the numbers p, -p, 100 c and -100 c."""
    head = f"! biases\n! NSIDE= {sides}\n! a b c\n"
    rows = [
        " ".join(f"{0.01 * p} {-0.01 * p} {100 * c} {-100 * c}" for c in range(len(CATALOGUES))) for p in range(12 * sides**2)
    ]
    path = tmp_path / "bias.dat"
    path.write_text(head + "\n".join(rows) + "\n")
    return path


def test_biases_are_taken_off(tmp_path):
    plain = read(tmp_path, line("2010 01 01.50000 ", "250", "C", "U"), line("2010 01 01.60000 ", "250", "C", " "))
    rows = read(
        tmp_path,
        line("2010 01 01.50000 ", "250", "C", "U"),
        line("2010 01 01.60000 ", "250", "C", " "),
        debias=biases(tmp_path),
    )
    pixel = int(pixel_of(1, plain.value[:1], plain.value[1:2])[0])
    years = (pz.Epoch("2010-01-01T12:00:00 UTC") - pz.Epoch("2000-01-01T12:00:00 TT")) / 31557600.0
    rate = 0.1 * CATALOGUES.index("U")
    off = (plain.value - rows.value) / ARCSECOND
    expected = [(0.01 * pixel + years * rate) / np.cos(plain.value[1]), -0.01 * pixel - years * rate, 0.0, 0.0]
    np.testing.assert_allclose(off, expected, rtol=1e-9, atol=1e-9)
    assert any("taken off 1 of 2 directions" in text for text in rows.assumed)
    assert any("--debias" in text for text in plain.assumed)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("NSIDE", "SIDES"), "line 1: no line of the head says NSIDE="),
        (lambda text: text + "0 0\n", "13 lines of pixels; NSIDE=1 has 12"),
        (lambda text: text.replace(" 100 ", " x "), "is no number"),
    ],
)  # fmt: skip
def test_tables_of_biases_that_are_none(tmp_path, change, words):
    path = biases(tmp_path)
    path.write_text(change(path.read_text()))
    with pytest.raises(ValueError, match=words):
        read(tmp_path, line("2010 01 01.50000 ", "250", "C", "U"), debias=path)
