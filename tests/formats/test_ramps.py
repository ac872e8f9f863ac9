"""Ramped frequencies against exact sums, and corrections that are left to the reader."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.formats import Correction
from piazzi.formats.corrections import corrected
from piazzi.formats.ramps import Ramp, ramp_of
from tests.formats.test_tdm import message, read


def test_the_ramps_of_the_standards_example(data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExample4.txt")
    ramp = ramp_of(rows, "DSS-24")
    seconds = [0, 177, 354, 531, 1062, 1593]  # 00:31:51, 34:48, 37:45, 40:42, 49:33 (a rate alone), 58:24
    assert_allclose(ramp.t, seconds, rtol=0, atol=1e-9)
    going_on = 7180064682.2366 + 0.59299 * 531
    given = [7180064367.3536, 7180064472.3146, 7180064577.2756, 7180064682.2366, going_on, 7180065326.56141]
    assert_allclose(ramp.frequency, given, rtol=1e-15)
    assert_allclose(ramp.rate, [0.59299, 0.59305, 0.59299, 0.59299, 0.62085, 0.62085], rtol=1e-15)
    assert_allclose(ramp.at([100.0, 1100.0]), [7180064367.3536 + 59.299, going_on + 0.62085 * 38], rtol=1e-15)
    assert np.isnan(ramp.at(-1.0)) and np.isnan(ramp.cycles(-1.0, 5.0))


def test_cycles_are_the_exact_integral():
    rng = np.random.default_rng(1)
    t = np.sort(rng.integers(0, 40000, 30)).astype(float)
    t = np.unique(t)
    ramp = Ramp(t, 8.4e9 + rng.integers(-100000, 100000, len(t)), rng.integers(-64, 64, len(t)) / 64)
    start = rng.integers(int(t[0]), 40000, 200).astype(float)
    end = start + rng.integers(1, 2000, 200)
    for one, other, cycles in zip(start.tolist(), end.tolist(), ramp.cycles(start, end).tolist(), strict=True):
        exact = Fraction(0)
        for k in range(len(t)):
            stop = t[k + 1] if k + 1 < len(t) else 1e9
            a, b = Fraction(max(one, t[k])), Fraction(min(other, stop))
            if b > a:
                f, r, zero = Fraction(ramp.frequency[k]), Fraction(ramp.rate[k]), Fraction(t[k])
                exact += f * (b - a) + r * ((b - zero) ** 2 - (a - zero) ** 2) / 2
        assert abs(cycles - float(exact)) <= 1e-6 + 2e-16 * float(exact)


def test_a_frequency_that_nobody_gave_is_told(tmp_path, data_dir):
    rows = pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExample4.txt")
    with pytest.raises(ValueError, match="no frequency that yyyy-nnnA transmitted is given"):
        ramp_of(rows, "yyyy-nnnA")
    with pytest.raises(ValueError, match="no participant 'DSS-25'; did you mean 'DSS-24'"):
        ramp_of(rows, "DSS-25")
    constant = ramp_of(pz.read_tracking(data_dir / "ccsds/tdm/kvn/TDMExample2.txt"), "yyyy-nnnA")
    assert constant.at(1e4) == 32023442781.733


DATA = [f"{key} = 2020-01-01T00:00:00 {value}" for key, value in [
    ("RANGE", 1000), ("ANGLE_1", 10), ("ANGLE_2", 20), ("DOPPLER_INSTANTANEOUS", 1), ("RECEIVE_FREQ_1", 5), ("MAG", 9),
]]  # fmt: skip
CORRECTIONS = {"CORRECTION_RANGE": 0.5, "CORRECTION_ANGLE_1": 1, "CORRECTION_ANGLE_2": -1, "CORRECTION_DOPPLER": 0.25,
               "CORRECTION_RECEIVE": 2, "CORRECTION_MAG": 0.5}  # fmt: skip


@pytest.mark.parametrize("applied", ["YES", "NO", None])
def test_corrections_are_added_once(tmp_path, applied):
    rows = read(tmp_path, message(DATA, ANGLE_TYPE="AZEL", CORRECTIONS_APPLIED=applied, **CORRECTIONS))
    done = corrected(rows)
    added = [500.0, np.pi / 180, -np.pi / 180, 250.0, 2.0, 0.5] if applied == "NO" else [0.0] * 6
    assert_allclose(done.value - rows.value, added, rtol=0, atol=1e-12)
    assert {c.applied for c in done.segments[0].corrections} == ({None} if applied is None else {True})
    assert_array_equal(corrected(done).value, done.value)


def test_aberration_cannot_be_added(tmp_path):
    text = message(DATA, ANGLE_TYPE="RADEC", CORRECTIONS_APPLIED="NO", CORRECTION_ABERRATION_YEARLY="0.005")
    rows = read(tmp_path, text)
    with pytest.raises(ValueError, match="'aberration_yearly' is not applied, and cannot be"):
        corrected(rows)
    away = rows[~rows.of_kind("right_ascension", "declination")]
    assert_array_equal(corrected(away).value, away.value)
    other = replace(rows, segments=(replace(rows.segments[0], corrections=(Correction("troposphere", None, False),)),))
    assert corrected(other).segments[0].corrections == other.segments[0].corrections
