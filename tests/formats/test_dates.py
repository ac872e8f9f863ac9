"""Columns of dates against `Epoch`, one by one."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.formats.dates import instants, read_dates

GOOD = [
    "2005-06-08T17:41:00", "2005-159T17:41:00", "2005-159T17:41:00.000077", "1998-06-10T00:57:37Z", "2016-12-31T23:59:60.5",
    "2024-02-29 12:00:00.123456789", "2024-366T23:59:59.9", "1969-12-31T00:00:00", "2000-01-01T00:00:00.1Z",
    "2016-366T23:59:60",
]  # fmt: skip
BAD = [
    "2005-13-08T17:41:00", "2005-06-31T17:41:00", "2005-366T17:41:00", "2005-000T17:41:00", "2005-06-08T24:01:00",
    "2005-06-08T17:60:00", "2005-06-08T17:41:60", "2005-06-08T17:41:0x", "2005-06-08T17:41:00.", "2005-06-08T17:41:00.1x",
    "2005-06-08", "", "x", "2005-06-08T17:41", "2005/06/08T17:41:00", "2005-06-08T17:41:00+01:00", "2005-06-08T17:41:00ZZ",
    "2005-06-08T17:41:00.5.5", "20A5-06-08T17:41:00",
]  # fmt: skip


@pytest.mark.parametrize("scale", ["UTC", "TAI", "TT", "TDB", "TCG", "GPS", "UT1"])
def test_good_dates_are_those_of_epoch(scale):
    texts = [text for text in GOOD if scale == "UTC" or not (":60" in text or "Z" in text)]
    readings, bad = read_dates(np.array(texts, dtype="S"))
    assert not bad.any()
    epoch, t = instants(scale, readings)
    for text, seconds in zip(texts, t, strict=True):
        one = pz.Epoch(f"{text} {scale}" if not text.endswith("Z") else text)
        assert abs((one - epoch) - seconds) < 1e-6 * 1e-6 + abs(seconds) * 3e-16, text


def test_bad_dates_are_told_row_by_row():
    _, bad = read_dates(np.array(GOOD + BAD, dtype="S"))
    assert_array_equal(bad, [False] * len(GOOD) + [True] * len(BAD))


def test_no_dates_are_no_dates():
    readings, bad = read_dates(np.zeros(0, dtype="S20"))
    assert len(bad) == len(instants("UTC", readings).t) == 0


def test_utc_before_1960_is_refused_with_its_row():
    readings, bad = read_dates(np.array(["1970-01-01T00:00:00", "1801-01-01T00:00:00"], dtype="S"))
    assert not bad.any()
    with pytest.raises(ValueError, match="row 1: there is no UTC before 1960"):
        instants("UTC", readings)
