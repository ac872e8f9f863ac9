"""Times of a problem and of its tracking are seconds of TT past one instant, or past none."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from tests.laws.problems import b612

UTC = "2016-02-13T16:00:00 UTC"


def dated(epoch, **changes):
    return dataclasses.replace(b612(), epoch=epoch, **changes)


def test_nothing_changes_where_there_is_none():
    problem = b612()
    tracking = pz.simulate(problem, [0.0, 1.0], np.random.default_rng(0))
    assert problem.epoch is tracking.epoch is None
    assert pz.Tracking([0.0, 1e300], [1, 2]).epoch is None
    assert pz.Tracking([0.0], [1], epoch="").epoch is None


def test_a_date_moves_no_bit_of_an_estimate():
    times = np.arange(5) * 1.0
    plain, problem = b612(), dated(UTC)
    one, other = (pz.simulate(p, times, np.random.default_rng(0)) for p in (plain, problem))
    assert_array_equal(one.values, other.values)
    found = [pz.ExtendedKalmanFilter().estimate(p, t) for p, t in ((plain, one), (problem, other))]
    assert_array_equal(found[0].mean, found[1].mean)
    assert (found[0].epoch, found[1].epoch) == (None, pz.Epoch(UTC))


def test_text_needs_its_scale():
    with pytest.raises(ValueError, match="has no time scale: add one of UTC"):
        pz.Tracking([0.0], [1], epoch="2016-02-13T16:00:00")
    with pytest.raises(ValueError, match="has no time scale: add one of UTC"):
        dated("2016-02-13T16:00:00")
    with pytest.raises(TypeError, match="an Epoch is made of text"):
        dated(3)


@pytest.mark.parametrize("days", [0.5, 1, 400, -400])
def test_times_past_another_instant_differ_by_the_exact_difference(days):
    epoch = pz.Epoch(UTC)
    target = epoch + (days * 86400.0 + 0.25)
    tracking = pz.Tracking([0.0, 0.125, 3.5], [1, 2, 3], epoch=epoch)
    moved = tracking.with_epoch(target)
    assert_array_equal(moved.row_times, np.array([0.0, 0.125, 3.5]) - (days * 86400.0 + 0.25))
    assert moved.epoch == target
    assert_array_equal(moved.with_epoch(epoch).row_times, tracking.row_times)


def test_a_leap_second_counts():
    tracking = pz.Tracking([0.0], [1], epoch="2017-01-01T00:00:00 UTC")
    assert tracking.with_epoch("2016-12-31T00:00:00 UTC").row_times[0] == 86401.0


def test_epochs_that_differ_are_told_before_anything_is_estimated():
    problem = dated(UTC)
    tracking = pz.Tracking([0.0, 1.0], [1, 2], epoch="2016-02-13T16:00:01 UTC")
    with pytest.raises(
        ValueError, match=r"times of the tracking are past 2016.*tracking.with_epoch\(problem.epoch\) moves them"
    ):
        pz.ExtendedKalmanFilter().estimate(problem, tracking)
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking.with_epoch(problem.epoch))
    assert_array_equal(estimate.times, [1.0, 2.0])


def test_times_far_from_their_epoch_ask_for_a_nearer_one():
    for make in (
        lambda: pz.Tracking([0.0, 1e8], [1, 2], epoch=UTC),
        lambda: dated(UTC, prior_time=-1e8),
        lambda: pz.simulate(dated(UTC, prior_time=0.0), [0.0, 1e8], np.random.default_rng(0)),
        lambda: pz.Tracking([0.0], [1], epoch=UTC).with_epoch("2020-01-01 TT"),
    ):
        with pytest.raises(ValueError, match=r"s is 3.* years from the epoch, .*; times stay within 1e\+08 s") as error:
            make()
        assert "\n" not in str(error.value)
    assert pz.Tracking([0.0, 9.9e7], [1, 2], epoch=UTC).epoch == pz.Epoch(UTC)


@pytest.mark.parametrize(
    "epoch", [pz.Epoch(UTC), pz.Epoch.at(1.5e8, 0.1), pz.Epoch.at(-3e9, 1e-17), pz.Epoch("2016-01-01 TDB")]
)
def test_exact_text_comes_back_in_all_bits(epoch):
    assert pz.Epoch(epoch.exact()) == epoch
