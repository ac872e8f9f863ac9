"""Tides of UT1 and of the pole within the day, and libration: the values that the IERS published for its routines, and laws."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.earth.eop import ARCSEC, tables
from piazzi.earth.scales import DAY, TT_TAI
from piazzi.earth.subdaily import libration, ocean_tides, subdaily
from piazzi.scenarios.earth_functions import written_orientation

EPOCH = pz.Epoch("2016-12-30T07:13:11.3 UTC")  # two days before a leap second
LEAP = pz.Epoch("2017-01-01T00:00:00 UTC") - EPOCH
HELD = earth.EOP(0.1, 0.2, 0.3)


def test_tides_of_the_oceans_are_those_of_the_conventions():
    # header of the IERS routine ORTHO_EOP of 2010-03-19, MJD 47100: x, y (uas), UT1 (us)
    assert_allclose(
        ocean_tides(np.array(47100.0))[0],
        [-162.8386373279636530, 117.7907525842668974, -23.39092370609808214],
        rtol=0,
        atol=1e-8,
    )


def test_libration_is_that_of_the_conventions():
    # headers of PMSDNUT2 of 2011-10-13 (uas) and UTLIBR of 2010-06-23 (us, us/day), whose constants are in single precision
    assert_allclose(libration(np.array(54335.0))[0][:2], [24.83144238273364834, -14.09240692041837661], rtol=0, atol=1e-6)
    values, rates = libration(np.array([44239.1, 55227.4]))
    assert_allclose(values[:, 2], [2.441143834386761746, -2.655705844335680244], rtol=0, atol=2e-8)
    # published for the length of day, the rate of UT1 with the other sign, from a table of its own with one decimal
    assert_allclose(-rates[:, 2], [-14.78971247349449492, 27.39445826599846967], rtol=0, atol=0.3)


def test_sizes_and_periods():
    mjd = 55000.0 + np.arange(0.0, 64.0, 1.0 / 32.0)
    values, rates = subdaily(mjd)
    assert 0.2e-3 < np.abs(values[:, :2]).max() / ARCSEC < 1e-3
    assert 2e-5 < np.abs(values[:, 2]).max() < 1e-4
    assert np.abs(rates[:, 2]).max() * DAY < 1e-3  # of the length of day
    power = np.abs(np.fft.rfft(values * np.hanning(len(mjd))[:, None], axis=0)) ** 2
    cycles = np.fft.rfftfreq(len(mjd), 1.0 / 32.0)
    tidal = ((cycles > 0.75) & (cycles < 1.2)) | ((cycles > 1.7) & (cycles < 2.2))
    assert np.all(power[~tidal].sum(0) < 1e-4 * power.sum(0))


def test_rates_are_those_of_the_values():
    mjd, h = 57000.0 + np.random.default_rng(5).uniform(0.0, 3000.0, 50), 1e-3
    ahead, behind, ahead2, behind2 = (subdaily(mjd + k * h)[0] for k in (1, -1, 2, -2))
    difference = (8.0 * (ahead - behind) - (ahead2 - behind2)) / (12.0 * h * DAY)
    size = np.abs(difference).max(0)
    assert_allclose(subdaily(mjd)[1] / size, difference / size, rtol=0, atol=1e-7)


def test_they_are_added_to_daily_values_with_the_sense_of_each():
    epoch = pz.Epoch("2020-06-01T03:00:00 UTC")
    turn = earth.rotation("GCRF", "ITRF", epoch, earth.SubdailyEOP()) @ earth.rotation("GCRF", "ITRF", epoch).T
    x, y, ut1 = subdaily(np.array(sum(epoch.jd("UT1")) - 2400000.5))[0]
    z = -2.0 * np.pi * 1.00273781191135448 / DAY * ut1  # W = R1(-y) R2(-x), the Earth ahead by the rate of its angle
    expected = np.array([[1.0, -z, x], [z, 1.0, -y], [-x, y, 1.0]])
    assert_allclose(turn, expected, rtol=0, atol=1e-13)
    assert 5e-10 < np.abs(turn - np.eye(3)).max() < 1e-8
    instant = np.array(epoch.whole), np.array(epoch.fraction)
    assert_allclose(earth.SubdailyEOP().pole(*instant).values[2:], tables().pole(*instant).values[2:], rtol=0, atol=0)


def test_ut1_of_an_epoch_has_them_too():
    epoch = pz.Epoch("2020-06-01T03:00:00 UTC")
    instant = np.array(epoch.whole), np.array(epoch.fraction)
    days = (epoch.jd("UT1", earth.SubdailyEOP())[1] - epoch.jd("UT1")[1]) * DAY
    expected = earth.SubdailyEOP().ut1_tai(*instant) - tables().ut1_tai(*instant)
    assert days == pytest.approx(float(expected), abs=2e-11) and abs(days) > 1e-6
    assert float(earth.SubdailyEOP(HELD).ut1_tai(*instant)) == pytest.approx(HELD.ut1_tai(*instant), abs=1e-4)
    assert epoch.jd("UT1")[1] == pytest.approx(epoch.jd("TT")[1] + (tables().ut1_tai(*instant) - TT_TAI) / DAY, abs=1e-14)


def test_nodes_are_the_rotation_over_midnights_and_a_leap_second():
    random = np.random.default_rng(18)
    times = np.concatenate([random.uniform(0.0, 4 * DAY, 1500), LEAP + random.uniform(-3.0, 3.0, 500)])
    eop = earth.SubdailyEOP()
    R, rate = earth.rotation_rate("GCRF", "ITRF", [EPOCH + t for t in times], eop)
    v, dv = earth.Rotation("GCRF", "ITRF", EPOCH, eop).pieces(0.0, 4 * DAY)(times)
    assert np.abs(v.reshape(-1, 3, 3) - R).max() < 1e-11
    kept = (times < LEAP - 1.0) | ((times - LEAP) % DAY < DAY - 1.0)  # as without them
    assert np.abs(dv.reshape(-1, 3, 3) - rate)[kept].max() < 1e-15


def test_the_switch_changes_nodes_only():
    plain, tidal = (earth.Rotation("GCRF", "ITRF", EPOCH, eop) for eop in (None, earth.SubdailyEOP()))
    assert plain.signature == tidal.signature and plain.checksum != tidal.checksum
    assert plain.block(0.0, DAY).shape == tidal.block(0.0, DAY).shape
    assert earth.Rotation("GCRF", "ITRF", EPOCH, earth.SubdailyEOP(HELD)).checksum != tidal.checksum


def test_they_are_asked_for_where_orientation_is(tmp_path):
    import astropy_iers_data

    file = tmp_path / "finals"
    file.write_bytes(b"\n".join(Path(astropy_iers_data.IERS_A_FILE).read_bytes().splitlines()[:20]))
    assert earth.read_forces("degree=2 eop=subdaily", 800e3).eop == earth.SubdailyEOP()
    assert earth.read_forces("degree=2 eop=daily", 800e3).eop is None
    of_file = earth.read_forces(f"degree=2 eop=subdaily:{file}", 800e3).eop
    assert of_file.daily.source == str(file)
    assert written_orientation(of_file) == f"subdaily:{file}"
    assert written_orientation(earth.SubdailyEOP()) == "subdaily"
    assert written_orientation(earth.SubdailyEOP(HELD)) == {**vars(HELD), "subdaily": True}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('"subdaily"', earth.SubdailyEOP()),
        ("{ ut1_utc = 0.1, subdaily = true }", earth.SubdailyEOP(earth.EOP(0.1))),
        ("{ ut1_utc = 0.1, subdaily = false }", earth.EOP(0.1)),
    ],
)
def test_files_of_forces(tmp_path, line, expected):
    file = tmp_path / "forces.toml"
    file.write_text(f"[earth]\ndegree = 2\neop = {line}\n")
    assert earth.read_forces(str(file), 800e3).eop == expected
    file.write_text("[earth]\neop = { subdaily = 1 }\n")
    with pytest.raises(ValueError, match="eop: subdaily is 1; it must be true or false"):
        earth.read_forces(str(file), 800e3)


def test_they_are_not_added_twice():
    with pytest.raises(ValueError, match="added once"):
        earth.SubdailyEOP(earth.SubdailyEOP())
