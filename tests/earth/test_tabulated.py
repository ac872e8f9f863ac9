"""Tables of orientation, bodies and stations against the routines that they stand for."""

import copy
import pickle

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.problem.outside import checked_functions

EPOCH = pz.Epoch("2016-12-30T07:13:11.3 UTC")  # two days before a leap second
LEAP = pz.Epoch("2017-01-01T00:00:00 UTC") - EPOCH
DAY = 86400.0
STATION = earth.Station.geodetic("Piazzi", np.radians(38.11), np.radians(13.35), 72.0)


@pytest.fixture(scope="module")
def times() -> np.ndarray:
    random = np.random.default_rng(18)
    return np.concatenate([random.uniform(0.0, 4 * DAY, 1500), LEAP + random.uniform(-3.0, 3.0, 500)])


def test_a_rotation_is_that_of_the_earth_over_midnights_and_a_leap_second(times):
    R, rate = earth.rotation_rate("GCRF", "ITRF", [EPOCH + t for t in times])
    v, dv = earth.Rotation("GCRF", "ITRF", EPOCH).pieces(0.0, 4 * DAY)(times)
    assert np.abs(v.reshape(-1, 3, 3) - R).max() < 1e-11
    # behind the leap second pieces begin a second before midnight, with the slope of UT1 of the day to come
    kept = (times < LEAP - 1.0) | ((times - LEAP) % DAY < DAY - 1.0)
    assert np.abs(dv.reshape(-1, 3, 3) - rate)[kept].max() < 1e-15
    assert np.abs(dv.reshape(-1, 3, 3) - rate).max() < 1e-14
    W = v.reshape(-1, 3, 3)
    assert np.abs(W @ W.transpose(0, 2, 1) - np.eye(3)).max() < 1e-14


def test_both_ways_share_a_table():
    there, back = earth.Rotation("GCRF", "ITRF", EPOCH), earth.Rotation("ITRF2014", "GCRF", EPOCH)
    assert there.signature.shared == back.signature.shared and there.checksum == back.checksum
    np.testing.assert_array_equal(there.block(0.0, DAY), back.block(0.0, DAY))
    r = (7e6, -1e6, 2e6)
    t = 12345.6
    fixed = there.value(t, *r)
    np.testing.assert_allclose(fixed, earth.rotation("GCRF", "ITRF", EPOCH + t) @ r, atol=1e-5)
    np.testing.assert_allclose(back.value(t, *fixed), r, rtol=1e-14, atol=1e-8)
    h = 10.0
    slope = (np.array(there.value(t + h, *r)) - there.value(t - h, *r)) / (2 * h)
    np.testing.assert_allclose(there.derivatives(t, *r)[:, 0], slope, atol=1e-3)
    np.testing.assert_allclose(there.derivatives(t, *r)[:, 1:] @ r, fixed, rtol=1e-15)


def test_one_table_for_two_epochs_is_refused():
    free = earth.Rotation("ITRF", "GCRF", EPOCH)
    other = earth.Rotation("GCRF", "ITRF", EPOCH, earth.EOP(ut1_utc=0.1))
    calls = {"bx, by, bz": "fixed(t, x, y, z)", "ax, ay, az": "free(t, bx, by, bz)"}
    given = {"fixed": other, "free": free}
    model = pz.Model(["x", "y", "z"], ["ax", "ay", "az"], definitions=calls, functions=given)
    with pytest.raises(ValueError, match="'fixed' and 'free' read one table, GCRF ITRF, but differ in their data"):
        checked_functions(given, model)


@pytest.mark.parametrize(("name", "metres"), [("sun", 0.01), ("moon", 1e-3), ("jupiter", 0.1)])
def test_a_body_is_where_its_series_is(times, name, metres):
    position, after, before = (earth.body(name, [EPOCH + (t + h) for t in times])[0] for h in (0.0, 60.0, -60.0))
    velocity = (after - before) / 120.0  # those of the series are shortened ones
    recipe = earth.Body(name, EPOCH)
    v, dv = recipe.pieces(0.0, 4 * DAY)(times)
    assert np.abs(v - position).max() < metres
    assert np.abs(dv - velocity).max() < 1e-4
    np.testing.assert_allclose(recipe.value(times[0]), v[0], rtol=1e-15)
    np.testing.assert_allclose(recipe.derivatives(times[0])[:, 0], dv[0], rtol=1e-12)


@pytest.mark.parametrize("tides", [True, False])
def test_a_place_is_the_station_turned_with_the_earth(times, tides):
    some = times[::20]
    at = [EPOCH + t for t in some]
    fixed = STATION.position(at)
    if tides:
        fixed = fixed + earth.station_displacement(fixed, at)
    position, velocity = earth.transform(fixed, np.zeros_like(fixed), "ITRF", "GCRF", at)
    v, dv = earth.Place(STATION, EPOCH, tides=tides).pieces(0.0, 4 * DAY)(some)
    assert np.abs(v[:, :3] - position).max() < 1e-5
    assert np.abs(v[:, 3:] - velocity).max() < (1e-4 if tides else 1e-7)  # the tide itself moves by 5e-5 m/s
    np.testing.assert_allclose(dv[:, :3], v[:, 3:], rtol=1e-12, atol=1e-9)


def test_values_do_not_depend_on_the_span():
    for recipe in (earth.Rotation("GCRF", "ITRF", EPOCH), earth.Body("moon", EPOCH), earth.Place(STATION, EPOCH)):
        short, long = recipe.pieces(DAY, DAY), recipe.pieces(-DAY, 3 * DAY)
        t = np.linspace(short.start, short.end - 1.0, 50)
        np.testing.assert_allclose(short(t)[0], long(t)[0], rtol=1e-13, atol=1e-13)
        assert (EPOCH + short.start).to("UTC").endswith("T00:00:00 UTC")


def test_recipes_have_copies():
    for recipe in (earth.Rotation("GCRF", "ITRF", EPOCH, earth.EOP(ut1_utc=0.1)), earth.Body("sun", EPOCH)):
        for other in (copy.deepcopy(recipe), pickle.loads(pickle.dumps(recipe))):
            assert other == recipe and other.checksum == recipe.checksum and other.span is None
            np.testing.assert_array_equal(other.block(0.0, 10.0), recipe.block(0.0, 10.0))


def test_frames_and_bodies_that_are_none_are_refused():
    with pytest.raises(ValueError, match="frame 'GCRX' is not known"):
        earth.Rotation("GCRX", "ITRF", EPOCH)
    with pytest.raises(ValueError, match="body 'son' is not known; did you mean 'sun'"):
        earth.Body("son", EPOCH)


def test_both_directions_of_a_rotation_share_their_days():
    from piazzi.earth.tabulated import _day

    epoch = pz.Epoch("2011-05-03T04:05:06 UTC")
    there, back = earth.Rotation("GCRF", "ITRF", epoch), earth.Rotation("ITRF", "GCRF", epoch)
    _day.cache_clear()
    there.block(0.0, 3e5)
    made = _day.cache_info().misses
    np.testing.assert_array_equal(back.block(0.0, 3e5), there.block(0.0, 3e5))
    assert _day.cache_info().misses == made > 3
