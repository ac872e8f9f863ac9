"""Tides of stations: the values that the IERS publishes with its routines, and laws of potentials."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi.earth.tides
from piazzi import earth
from piazzi.earth import EOP, Epoch
from piazzi.earth.tides import pole_tide, solid_tide, station_displacement

# Headers of DEHANTTIDEINEL, IERS Conventions 2010, chapter 7: station, Sun, Moon and displacement in metres, ITRF, 0h UTC
PUBLISHED = {
    "2009-04-13": (
        (4075578.385, 931852.890, 4801570.154),
        (137859926952.015, 54228127881.4350, 23509422341.6960),
        (-179996231.920342, -312468450.131567, -169288918.592160),
        (0.07700420357108126, 0.06304056321824968, 0.05516568152597247),
    ),
    "2012-07-13": (
        (1112189.660, -4842955.026, 3985352.284),
        (-54537460436.2357, 130244288385.279, 56463429031.5996),
        (300396716.912, 243238281.451, 120548075.939),
        (-0.02036831479592075833, 0.05658254776225972449, -0.07597679676871742227),
    ),
    "2015-07-15": (
        (1112200.5696, -4842957.8511, 3985345.9122),
        (100210282451.6279, 103055630398.3160, 56855096480.4475),
        (369817604.4348, 1897917.5258, 120804980.8284),
        (0.00509570869172363845, 0.0828663025983528700, -0.0636634925404189617),
    ),
}
UT_IS_UTC = EOP()  # as the routine has it


@pytest.mark.parametrize("date", PUBLISHED)
def test_published_displacements(date):
    station, sun, moon, published = (np.array(v) for v in PUBLISHED[date])
    assert_allclose(solid_tide(station, sun, moon, Epoch(f"{date} UTC"), UT_IS_UTC), published, rtol=0, atol=3e-5)


@pytest.mark.parametrize("date", PUBLISHED)
def test_what_is_left_is_the_precession_that_the_routine_adds_twice(date, monkeypatch):
    """The routine adds general precession to a mean longitude of the Moon that is of date already, but not in tau."""
    arguments = piazzi.earth.tides._arguments

    def as_published(whole, fraction, eop):
        gmst, angles = arguments(whole, fraction, eop)
        t = whole / 86400.0 / 36525.0
        precession = np.radians(1.396971278 * t + 0.000308889 * t**2)
        return gmst + precession, angles + precession * np.array([1.0, 0, 0, 0, 0])

    monkeypatch.setattr(piazzi.earth.tides, "_arguments", as_published)
    station, sun, moon, published = (np.array(v) for v in PUBLISHED[date])
    assert_allclose(solid_tide(station, sun, moon, Epoch(f"{date} UTC"), UT_IS_UTC), published, rtol=0, atol=2e-7)


def test_published_parts_out_of_phase_and_by_latitude(monkeypatch):
    """Headers of ST1IDIU, ST1ISEM and ST1L1: each alone; the sizes that they are given have six digits."""
    tides = piazzi.earth.tides
    station, sun, moon, _ = (np.array(v) for v in PUBLISHED["2009-04-13"])
    parts = {
        ("H_DIURNAL", "L_DIURNAL"): (-0.2836337012840008e-3, 0.1125342324347507e-3, -0.2471186224343683e-3),
        ("H_SEMIDIURNAL", "L_SEMIDIURNAL"): (-0.2801334805106874e-3, 0.2939522229284325e-4, -0.6051677912316722e-4),
        ("L1_DIURNAL", "L1_SEMIDIURNAL"): (0.2367189532359759e-3, 0.5181609907284959e-3, -0.3014881422940428e-3),
    }
    for names, published in parts.items():
        with monkeypatch.context() as patch:
            for other in (n for pair in parts if pair != names for n in pair):
                patch.setattr(tides, other, 0.0)
            alone = solid_tide(station, sun, moon, Epoch("2009-04-13 UTC"), UT_IS_UTC)
            for name in names:
                patch.setattr(tides, name, 0.0)
            without = solid_tide(station, sun, moon, Epoch("2009-04-13 UTC"), UT_IS_UTC)
        assert_allclose(alone - without, published, rtol=0, atol=3e-10)


def test_published_lines_by_frequency(monkeypatch):
    """Headers of STEP2DIU and STEP2LON, whose T is 0.1059411362080767 centuries at 0h UT."""
    from piazzi.earth import scales
    from piazzi.earth.tides import _by_frequency

    station = np.array(PUBLISHED["2009-04-13"][0])
    radius = np.linalg.norm(station)
    sp, cp, longitude = station[2] / radius, np.hypot(*station[:2]) / radius, np.arctan2(station[1], station[0])
    t = 0.1059411362080767 * 36525.0
    midnight = np.floor(t - 0.5) + 0.5
    when = Epoch.from_jd(2451545.0 + midnight, t - midnight, "TT")
    ahead = scales.to_tt("TT", np.array(51544.5 + midnight), np.array(0.0), np.array(0.0))

    class Hour:  # UT1 such that the hour of the day is zero
        def ut1_tai(self, whole, fraction):
            return np.asarray(scales.TT_TAI - (when.whole + when.fraction - ahead[0] - ahead[1]))

    une = 1e-3 * _by_frequency(sp, cp, longitude, np.array(when.whole), np.array(when.fraction), Hour())
    up = station / radius
    north = np.array([-sp * np.cos(longitude), -sp * np.sin(longitude), cp])
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    both = np.array([0.4193085327321284701e-2, 0.1456681241014607395e-2, 0.5123366597450316508e-2])
    both += np.array([-0.9780962849562107762e-4, -0.2236349699932734273e-4, 0.3561945821351565926e-3])
    assert_allclose(une @ np.array([up, north, east]), both, rtol=0, atol=3e-5)


def test_many_at_once_are_each_alone():
    days = [Epoch("2016-02-13 UTC") + 7000.0 * k for k in range(6)]
    station = earth.ilrs_stations()["7090"]
    together = station_displacement(station.position(days), days)
    for k, day in enumerate(days):
        assert_allclose(together[k], station_displacement(station.position(day), day), rtol=0, atol=1e-15)
    assert 0.05 < np.ptp(together @ earth.up_north_east(station.position(days[0]))[0]) < 0.6


def test_the_permanent_tide_stays():
    """Averaged over the nodal period the tide at the equator is the permanent one, -A0 H0 sqrt(5/4pi) h2 (IERS, eq. 7.14)."""
    rng = np.random.default_rng(3)
    days = [Epoch("2000-01-01 UTC") + float(s) for s in rng.uniform(0.0, 18.61 * 365.25 * 86400.0, 4000)]
    place = np.array([6378137.0, 0.0, 0.0])
    turn = earth.rotation("GCRF", "ITRF", days, UT_IS_UTC)
    sun, moon = (np.einsum("kij,kj->ki", turn, earth.body(name, days)[0]) for name in ("sun", "moon"))
    mean = np.mean(solid_tide(place, sun, moon, days, UT_IS_UTC)[:, 0])
    permanent = 0.6078 * -0.31460 * np.sqrt(5 / (4 * np.pi)) * -0.5
    assert mean == pytest.approx(permanent, abs=0.006)  # the spread is 0.2 m: three sigmas of the mean of as many
    assert permanent == pytest.approx(0.060, abs=0.001)


def test_the_tide_of_the_pole_is_that_of_its_potential():
    """Displacement = h2/g V up, l2/g grad V across, with the centrifugal potential V (IERS 7.1.4: h2 0.6207, l2 0.0836)."""
    spin, gravity, radius = 7.292115e-5, 9.798, 6378136.6
    epoch = Epoch("2016-02-13 UTC")
    years = (epoch - Epoch.at(0.0)) / (365.25 * 86400)
    eop = EOP(xp=0.31, yp=-0.05)
    m1 = np.radians((0.31 - 0.055 - 0.001677 * years) / 3600)
    m2 = -np.radians((-0.05 - 0.3205 - 0.00346 * years) / 3600)

    def potential(r):  # -(Omega^2) (m1 x z + m2 y z), of which -Omega^2 r^2/2 sin(2 theta) (m1 cos + m2 sin) is the same
        return -(spin**2) * (m1 * r[0] * r[2] + m2 * r[1] * r[2])

    rng = np.random.default_rng(8)
    for _ in range(50):
        up = rng.normal(size=3)
        up /= np.linalg.norm(up)
        r = radius * up
        slope = np.array([(potential(r + d) - potential(r - d)) / 2.0 for d in np.eye(3)])
        across = slope - up * (up @ slope)
        expected = (0.6207 * potential(r) * up + 0.0836 * radius * across) / gravity
        assert_allclose(pole_tide(r, epoch, eop), expected, rtol=0, atol=4e-4)  # millimetres are published as 33 and 9
