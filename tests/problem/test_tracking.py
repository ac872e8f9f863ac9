"""A tracking is one flat, time-sorted table; what does not fit the problem is refused with the row."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from tests.laws.problems import b612, network

NAN = np.nan

BAD = {
    "nothing": (lambda: pz.Tracking([], []), "there are no measurements"),
    "all missing": (lambda: pz.Tracking([0, 1], [NAN, NAN]), "there are no measurements: every value is missing"),
    "NaN time": (lambda: pz.Tracking([0, NAN], [1, 2]), "time of row 1 is nan; it must be finite"),
    "infinite time": (lambda: pz.Tracking([0, np.inf], [1, 2]), "time of row 1 is inf; it must be finite"),
    "time runs back": (lambda: pz.Tracking([0, 2, 1], [1, 2, 3]), "times must increase: row 2 is at 1 s, after 2 s"),
    "a span that no number holds": (
        lambda: pz.Tracking([-1e308, 0, 1e308], [1, 2, 3]),
        r"row 2 is at 1e\+308 s, too far after -1e\+308 s: the interval is not finite",
    ),
    "infinite measurement": (
        lambda: pz.Tracking([0, 1], [1, -np.inf]),
        r"measurement of row 1 \(t = 1 s\), component 0, is -inf; write NaN",
    ),
    "too few values": (lambda: pz.Tracking([0, 1], [1]), r"measurements have shape \(1,\) for 2 times"),
    "three axes": (lambda: pz.Tracking([0], np.zeros((1, 1, 1))), "measurements have shape"),
    "text": (lambda: pz.Tracking([0], ["a"]), "measurements is not made of real numbers|measurements are not made"),
    "names of other length": (lambda: pz.Tracking([0, 1], [1, 2], ["a"]), "row_stations has 1 names for 2 rows"),
    "truth of other length": (
        lambda: pz.Tracking([0, 1], [1, 2], truth=np.zeros((3, 4))),
        r"truth has shape \(3, 4\) for 2 epochs",
    ),
    "infinite truth": (
        lambda: pz.Tracking([0, 1], [1, 2], truth=[[0, 1], [2, np.inf]]),
        "truth of epoch 1, state 1, is inf; it must be finite",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_table_is_refused_in_one_line(name):
    make, match = BAD[name]
    with pytest.raises(ValueError, match=match) as error:
        make()
    assert "\n" not in str(error.value)


def test_rows_of_one_time_are_one_epoch():
    t = pz.Tracking([0, 0, 1, 3, 3, 3], np.arange(6.0), ["a", "b", "a", "a", "b", "c"])
    assert_array_equal(t.times, [0, 1, 3])
    assert_array_equal(t.first_row, [0, 2, 3, 6])
    assert t.values.shape == (6, 1)


def test_table_cannot_change():
    times, values = np.arange(3.0), np.ones(3)
    t = pz.Tracking(times, values)
    times[0], values[0] = -5.0, 7.0
    assert t.times[0] == 0.0
    assert t.values[0, 0] == 1.0
    for array in (t.times, t.values, t.row_times):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9.0


ESTIMATE = pz.ExtendedKalmanFilter().estimate


def test_unknown_station_is_told_with_the_nearest():
    with pytest.raises(ValueError, match="unknown station 'rader'; did you mean 'radar'"):
        ESTIMATE(b612(), pz.Tracking([0, 1], [1, 1], ["radar", "rader"]))


def test_one_station_needs_no_name_but_several_do():
    t = pz.Tracking([0, 1], [1, 1])
    assert_array_equal(t.stations_of(b612()), [0, 0])
    with pytest.raises(ValueError, match="does not say which station measured; the problem has north, south, east, west"):
        ESTIMATE(network(np.random.default_rng(0)), t)


def test_no_stations_no_estimate():
    with pytest.raises(ValueError, match="the problem has no stations"):
        ESTIMATE(b612(stations=()), pz.Tracking([0, 1], [1, 1]))


def test_more_values_than_components_are_refused():
    with pytest.raises(ValueError, match=r"row 1 \(t = 1 s\) has more values than the 1 components of station 'radar'"):
        ESTIMATE(b612(), pz.Tracking([0, 1], [[1, NAN], [1, 2]]))


def test_padding_adds_missing_values_only():
    t = pz.Tracking([0, 1], [[1.0], [2.0]])
    assert_array_equal(t.padded(3), [[1, NAN, NAN], [2, NAN, NAN]])
    assert_array_equal(pz.Tracking([0], [[1.0, NAN, NAN]]).padded(1), [[1.0]])


def test_one_million_rows_are_checked_quickly():
    n = 1_000_000
    t = pz.Tracking(np.arange(n) * 0.1, np.zeros(n))
    assert len(t.times) == n
