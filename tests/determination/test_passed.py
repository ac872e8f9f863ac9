"""Passes of a stream are told as they end."""

import pytest

import piazzi as pz
from piazzi.determination.live import Taken
from piazzi.determination.passed import Passes

EPOCH = pz.Epoch("2026-11-03T00:00:00 UTC")


def row(t, station, value, used=True):
    return Taken(EPOCH + t, station, {"range": value}, used, "" if used else "outlier", (1.0, 2.0, 3.0 + t))


def test_a_pass_ends_where_its_station_was_silent_for_an_hour():
    passes, told = Passes(), []
    for t, station, value, used in [
        (0.0, "A", 1.0, True), (60.0, "B", 2.0, True), (120.0, "A", -3.0, True), (180.0, "A", 50.0, False),
        (3700.0, "B", None, True), (3781.0, "B", 0.0, True), (9000.0, "A", 0.5, True),
    ]:  # fmt: skip
        told.append(passes.take(row(t, station, value, used)))
    assert [len(one) for one in told] == [0, 0, 0, 0, 1, 1, 1]
    assert (told[4][0].station, told[4][0].count) == ("B", 1)  # silent for 3640 s: what comes is another pass
    first, second = told[5][0], told[6][0]
    assert (first.station, first.count, first.used, first.values) == ("A", 3, 2, 2)
    assert first.weighted_rms == pytest.approx(5.0**0.5)  # (1 + 9) / 2: what was rejected is no part of it
    assert (first.first - EPOCH, first.last - EPOCH, first.sigma[2]) == (0.0, 180.0, 183.0)
    assert (second.station, second.count, second.values) == ("B", 2, 1)
    (last,) = passes.end()
    assert (last.station, last.count) == ("A", 1) and not passes.end()


def test_it_says_itself_in_a_line():
    passes = Passes()
    passes.take(row(0.0, "BER", None))
    (one,) = passes.end()
    assert one.weighted_rms is None and "weighted" not in str(one)
    assert str(one) == "pass over BER: 2026-11-03T00:00:00 UTC to 2026-11-03T00:00:00 UTC, 1 of 1 rows used, R 1 T 2 N 3 m"
