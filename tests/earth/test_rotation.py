"""Frames: the textbook example, ERFA called directly, and laws of rotations."""

import warnings

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.earth import EOP, Epoch
from piazzi.earth.eop import ARCSEC, tables

# Vallado, Fundamentals of Astrodynamics, examples 3-14 and 3-15; the places computed with ERFA (2006/2000A) and by Orekit's
# tests, which differ by 8 mm in a component between reductions
WHEN = Epoch("2004-04-06T07:51:28.386009 UTC")
HELD = EOP(ut1_utc=-0.4399619, xp=-0.140682, yp=0.333309, dx=-0.000205, dy=-0.000136)
R_ITRF, V_ITRF = np.array([-1033479.3830, 7901295.2754, 6380356.5958]), np.array([-3225.636520, -2872.451450, 5531.924446])
PLACES = {
    "GCRF": (5102508.95947, 6123011.39294, 6378136.93441),
    "EME2000": (5102509.0383, 6123011.9733, 6378136.3142),
    "PEF": (-1033475.0313, 7901305.5856, 6380344.5327),
    "CIRS": (5100018.41127, 6122786.35932, 6380344.53275),
    "TEME": (5094180.17, 6127644.65, 6380344.53),
}


@pytest.mark.parametrize("frame", PLACES)
def test_the_textbook_example(frame):
    place, velocity = earth.transform(R_ITRF, V_ITRF, "ITRF", frame, WHEN, HELD)
    assert_allclose(place, PLACES[frame], rtol=0, atol=0.02)
    back, speed = earth.transform(place, velocity, frame, "ITRF", WHEN, HELD)
    assert_allclose(back, R_ITRF, rtol=0, atol=1e-8)
    assert_allclose(speed, V_ITRF, rtol=0, atol=1e-10)  # through 500 m/s of the turn


def test_velocity_of_the_textbook_example():
    # with the length of day left out: 0.0016 s of 86400 s of 465 m/s
    assert_allclose(
        earth.transform(R_ITRF, V_ITRF, "ITRF", "GCRF", WHEN, HELD)[1], [-4743.22016, 790.53650, 5533.75572], rtol=0, atol=2e-5
    )


def erfa_matrix(epoch, eop):
    """GCRF to ITRF by ERFA's own recipe for the CIO-based transformation."""
    utc = epoch.jd("UTC")
    tt = epoch.jd("TT")
    x, y, s = erfa.xys06a(*tt)
    q = erfa.c2ixys(x + eop.dx * ARCSEC, y + eop.dy * ARCSEC, s)
    ut1 = erfa.utcut1(*utc, eop.ut1_utc)
    return erfa.c2tcio(q, erfa.era00(*ut1), erfa.pom00(eop.xp * ARCSEC, eop.yp * ARCSEC, erfa.sp00(*tt)))


def test_agrees_with_erfa_called_directly():
    rng = np.random.default_rng(3)
    for _ in range(200):
        epoch = Epoch.at(rng.uniform(-8e8, 8e8), 0.5)
        eop = EOP(*(rng.uniform(-0.4, 0.4, 3)), *(rng.uniform(-1e-3, 1e-3, 2)))
        assert_allclose(earth.rotation("GCRF", "ITRF", epoch, eop), erfa_matrix(epoch, eop), rtol=0, atol=1e-12)


def test_tables_interpolate_the_daily_values_and_pass_through_them():
    table = tables()
    for mjd in (41684.0, 51544.0, 57431.0, 57754.0):  # the last is the day after a leap second
        epoch = Epoch.from_jd(2400000.5, mjd, "UTC")
        at = int(mjd - table.mjd[0])
        whole, fraction = np.array(epoch.whole), np.array(epoch.fraction)
        assert table.ut1_tai(whole, fraction) == pytest.approx(table.daily_ut1_tai[at], abs=1e-12)
        assert_allclose(table.pole(whole, fraction).values, table.daily_pole[at], rtol=0, atol=1e-16)
    # IERS: UT1-UTC at 2016-02-13 0h and 14 0h is 0.0076 and 0.0047 s; the difference to UTC has no step at a leap second
    before, after = Epoch("2016-12-31T23:59:60.999999 UTC"), Epoch("2017-01-01T00:00:00 UTC")
    readings = [float(table.ut1_tai(np.array(e.whole), np.array(e.fraction))) for e in (before, after)]
    assert readings[0] == pytest.approx(readings[1], abs=2e-8)


@pytest.mark.parametrize("frame", earth.FRAMES)
@given(seconds=st.floats(-1e9, 8e8), span=st.floats(0, 1))
def test_rotations_are_orthogonal_and_inverse(frame, seconds, span):
    epoch = Epoch.at(seconds, span)
    eop = EOP(0.1, 0.2, 0.3)
    R = earth.rotation("GCRF", frame, epoch, eop)
    assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    assert_allclose(earth.rotation(frame, "GCRF", epoch, eop), R.T, rtol=0, atol=1e-15)


@pytest.mark.parametrize("frame", ["ITRF", "PEF"])
def test_the_rate_is_that_of_the_matrix_and_is_a_turn(frame):
    epoch = Epoch("2020-06-01T03:00:00 UTC")
    h = 30.0
    R, rate = earth.rotation_rate("GCRF", frame, epoch)
    ahead, behind = (earth.rotation("GCRF", frame, epoch + s * h) for s in (1, -1))
    ahead2, behind2 = (earth.rotation("GCRF", frame, epoch + 2 * s * h) for s in (1, -1))
    difference = (8 * (ahead - behind) - (ahead2 - behind2)) / (12 * h)
    assert_allclose(rate, difference, rtol=0, atol=1e-15)
    omega = rate @ R.T
    assert_allclose(omega, -omega.T, rtol=0, atol=1e-17)
    assert np.linalg.norm([omega[0, 1], omega[0, 2], omega[1, 2]]) == pytest.approx(7.292115e-5, rel=1e-6)


def test_teme_is_pef_turned_by_the_sidereal_time_of_1982():
    epoch = Epoch("2016-02-13T16:00:00 UTC")
    angle = erfa.gmst82(*epoch.jd("UT1"))
    expected = [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    assert_allclose(earth.rotation("TEME", "PEF", epoch), expected, rtol=0, atol=1e-12)
    # of date by the theory of 1980 and TEME differ by the equation of the equinoxes only
    turn = earth.rotation("TEME", "TOD_1980", epoch)
    equinoxes = erfa.eqeq94(*epoch.jd("TT"))
    assert np.arctan2(turn[0, 1], turn[0, 0]) == pytest.approx(-equinoxes, abs=5e-7)


def test_the_mean_equator_of_j2000_is_23_mas_from_the_gcrf():
    turn = earth.rotation("GCRF", "EME2000", Epoch("2016-02-13 UTC"))
    angle = np.linalg.norm([turn[1, 2] - turn[2, 1], turn[2, 0] - turn[0, 2], turn[0, 1] - turn[1, 0]]) / 2
    assert angle / ARCSEC * 1e3 == pytest.approx(23.2, abs=0.2)
    assert_allclose(earth.rotation("EME2000", "MOD", Epoch.at(0.0)), np.eye(3), rtol=0, atol=1e-12)


def test_many_epochs_at_once_are_each_alone():
    epochs = [Epoch("2020-06-01 UTC") + 1000.0 * i for i in range(5)]
    together, rates = earth.rotation_rate("TEME", "ITRF", epochs)
    for epoch, matrix, rate in zip(epochs, together, rates, strict=True):
        one, one_rate = earth.rotation_rate("TEME", "ITRF", epoch)
        assert_allclose(matrix, one, rtol=0, atol=1e-15)
        assert_allclose(rate, one_rate, rtol=0, atol=1e-19)
    places = np.tile(R_ITRF, (5, 1))
    turned, none = earth.transform(places, None, "ITRF", "GCRF", epochs)
    assert turned.shape == (5, 3) and none is None


def test_names_of_frames():
    epoch = Epoch("2020-06-01 UTC")
    assert_allclose(earth.rotation("itrf2014", "gcrs", epoch), earth.rotation("ITRF", "GCRF", epoch))
    assert_allclose(earth.rotation("J2000", "ITRF-97", epoch), earth.rotation("EME2000", "ITRF", epoch))
    with pytest.raises(ValueError, match=r"frame 'B1950' is not known; there are GCRF"):
        earth.rotation("B1950", "GCRF", epoch)
    with pytest.raises(ValueError, match=r"position has shape \(2,\)"):
        earth.transform([1.0, 2.0], None, "ITRF", "GCRF", epoch)


def test_dates_outside_of_the_tables_are_warned_of_once_with_metres():
    table = tables()
    fresh = earth.EOPTable(table.mjd, table.daily_ut1_tai, table.daily_pole, table.source, table.measured)
    late = Epoch.from_jd(2400000.5, float(table.mjd[-1]) + 100.0, "UTC")
    with pytest.warns(earth.EOPWarning, match=r"up to 4\d m on the ground"):
        earth.rotation("GCRF", "ITRF", late, fresh)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        earth.rotation("GCRF", "ITRF", late, fresh)
    fresh = earth.EOPTable(table.mjd, table.daily_ut1_tai, table.daily_pole, table.source, table.measured)
    with pytest.warns(earth.EOPWarning, match=r"begin at 1962-01-01; UT1 is from Espenak and Meeus 2006"):
        earth.rotation("GCRF", "ITRF", Epoch("1801-01-01 TT"), fresh)


@pytest.mark.parametrize(
    ("given", "message"), [({"ut1_utc": 37.0}, "ut1_utc is 37.0 s"), ({"xp": float("nan")}, "xp is nan arcsec")]
)
def test_values_that_no_pole_has_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        EOP(**given)
