"""Rows that are held back: how they are named, how they are predicted, and what the verdict says of it."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination import Guess
from piazzi.determination.approach import approached
from piazzi.determination.case import Case
from piazzi.determination.determining import prepared, solved
from piazzi.determination.fit import estimate, estimators
from piazzi.determination.holding import _by_steps, check, held
from piazzi.determination.honesty import unseen
from piazzi.determination.passes import passes
from piazzi.determination.sentence import Sentence
from piazzi.evaluate.information import predicted
from piazzi.formats import Observations, Segment, summary
from piazzi.formats.passes import numbered
from piazzi.problem.inputs import prepare

EPOCH = pz.Epoch("2016-02-13T12:00:00 UTC")
STATE = np.array([9643000.0, 6000000.0, 4600000.0, -3600.0, 4000.0, 1800.0])
SITES = ("7090", "7119", "7825", "7941")
SIGMA = 0.03


def test_what_to_hold_is_read_and_refused():
    assert [check(how) for how in ("last", "passes", "1/4", 0.25)] == ["last", "passes", 0.25, 0.25]
    for wrong in ("first", "0", "5/4", "1/0", "-1/2"):
        with pytest.raises(ValueError, match="write last, passes, none, or a share such as 1/4"):
            check(wrong)
    with pytest.raises(ValueError, match="hold"):
        pz.determine("nowhere.npt", hold="all of it")


def rows(t, station, segment=None):
    told = {"way": "two-way", "range_is": "half", "tag": "transmit", "wavelength": 5.32e-7}
    many = 1 if segment is None else int(segment.max()) + 1
    return Observations(
        epoch=EPOCH, t=t, value=np.full(len(t), 7e6), kinds=("range",),
        kind=np.zeros(len(t), dtype=int), participants=(*SITES, "LAGEOS-2"), station=station, object=len(SITES),
        segments=(Segment("UTC", **told),) * many, segment=0 if segment is None else segment, sigma=SIGMA, tag=1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def given():
    """A day of twelve passes over four stations without noise, and the setup that they make."""
    t = np.concatenate([7200.0 * k + np.arange(0.0, 1500.0, 300.0) for k in range(12)])
    station = np.repeat(np.arange(12) % 4, 5)
    made = prepared(rows(t, station), guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs")
    z = predicted(made.problem, prepare(made.problem, made.tracking), made.states)
    return with_values(made, z)


def with_values(made, z):
    return replace(
        made, tracking=pz.Tracking(made.tracking.row_times, z, made.tracking.row_stations, epoch=made.tracking.epoch)
    )


def noisy(given, seed, factor=1.0):
    return with_values(
        given, given.tracking.values + factor * SIGMA * np.random.default_rng(seed).standard_normal(given.tracking.values.shape)
    )


def test_revolutions_that_follow_each_other_are_two_passes_of_a_station():
    """A satellite at 500 km comes again after 94.6 minutes and is seen for ten: 85 minutes are no gap within a pass."""
    revolution = 2.0 * np.pi * np.sqrt(6878137.0**3 / 3.986004418e14)
    t = np.concatenate([np.arange(0.0, 600.0, 60.0), revolution + np.arange(0.0, 600.0, 60.0)])
    one = np.zeros(20, dtype=int)
    assert numbered(t, one, one).tolist() == [1] * 10 + [2] * 10


def test_passes_are_parted_by_gaps_and_by_blocks_that_follow_each_other(given):
    """Twelve of the made-up day; a block that overlaps another, as angles beside ranges, is of the same pass."""
    keep = np.ones(len(given.rows), dtype=bool)
    found = passes(given, keep)
    assert [len(own) for own in found] == [5] * 12
    keep[:3] = False
    assert [len(own) for own in passes(given, keep)] == [2] + [5] * 11
    seen = given.measured.observations
    for segment, expected in (([0, 1, 0, 1, 1], [5]), ([0, 0, 1, 1, 1], [5]), ([0, 1, 3, 4, 5], [5])):
        blocks = replace(seen, segment=np.array(segment + [2] * 55), segments=(seen.segments[0],) * 6)
        parted = replace(given, measured=replace(given.measured, observations=blocks))
        assert [len(own) for own in passes(parted, np.ones(60, dtype=bool))][: len(expected)] == expected


def test_blocks_of_a_file_with_a_pause_between_them_are_passes_everywhere():
    """A station that turns to another satellite for a quarter of an hour begins a pass, one whose file is cut does not."""
    t = np.concatenate([np.arange(0.0, 300.0, 60.0), 1200.0 + np.arange(0.0, 300.0, 60.0)])
    block = np.repeat([0, 1], 5)
    assert numbered(t, np.zeros(10, dtype=int), block).tolist() == [1] * 5 + [2] * 5
    assert numbered(t, np.zeros(10, dtype=int), 0 * block).tolist() == [1] * 10
    assert numbered(60.0 * np.arange(10), np.zeros(10, dtype=int), block).tolist() == [1] * 10
    seen = rows(t, np.zeros(10, dtype=int), block)
    made = prepared(seen, guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"), stations="ilrs", estimate="bias.range/pass=1m")
    counted = [len(own) for own in passes(made, np.ones(10, dtype=bool))]
    assert [one["rows"] for one in summary(seen)["passes"]] == counted == [5, 5]
    assert list(made.problem.model.constants) == ["range_bias_1", "range_bias_2"]


@pytest.mark.slow  # kernels of ten seconds
def test_predictions_are_those_of_a_fit_without_the_pass(given):
    """The step from the whole solution against the graph that never saw the pass, with the same derivatives."""
    one = approached(noisy(given, 3))
    full = solved(one, estimators(("graph",)), case=Case(hold="passes"))
    left = full.held.groups[5]
    rest = full.keep.copy()
    rest[left.rows] = False
    without = estimate(one, estimators(("graph",))["graph"], rest)
    computed = predicted(one.problem, prepare(one.problem, one.tracking), without.mean)
    assert left.residual == pytest.approx(one.tracking.values[left.rows] - computed[left.rows], abs=1e-4)


def test_passes_that_are_left_out_in_turn_are_predicted_as_each_by_itself(given):
    """The others need no orbit of their own where the farthest step was straight, to a tenth of a sigma of the prediction."""
    one = approached(noisy(given, 4))
    full = solved(one, estimators(("graph",)), case=Case(hold="passes"))
    found = full.held
    for group in found.groups:
        (alone,) = _by_steps(one, full.estimate, full.analysis, full.keep, [group.rows])
        assert np.abs(alone.residual - group.residual).max() < 0.1 * SIGMA
        assert alone.squares == pytest.approx(group.squares, rel=1e-2)
        assert (alone.rows == group.rows).all()


def test_squares_are_honest_over_seeds(given):
    """The mean over twelve passes left out, each with its covariance, is one per value."""
    runs = [solved(approached(noisy(given, seed)), estimators(("graph",)), case=Case(hold="passes")) for seed in range(4)]
    values = sum(r.held.freedom for r in runs)
    mean = sum(r.held.nees * r.held.freedom for r in runs) / values
    assert abs(mean - 1.0) < 5.0 * np.sqrt(2.0 / values) * 1.5  # passes share rows: half as sure again
    assert np.mean([r.held.coverage for r in runs]) == pytest.approx(0.95, abs=0.05)
    assert all(r.verdict["honest"].ok and "12 passes left out in turn" in r.verdict["honest"].sentence for r in runs)
    small = solved(approached(noisy(given, 9, factor=3.0)), estimators(("graph",)), case=Case(hold="last"))
    assert len(small.held.groups) == 1 and small.to_dict()["held"]["how"] == "last"


def test_a_pass_without_which_there_is_no_orbit_is_skipped(given):
    """Two passes of which one is held back leave a few ranges, which are no orbit."""
    one = approached(noisy(given, 1))
    full = solved(one, estimators(("graph",)), case=Case(hold="last"))
    few = np.zeros(len(one.rows), dtype=bool)
    few[:8] = True
    found = held(one, estimators(("graph",))["graph"], full.estimate, full.analysis, few, "passes")
    assert found.skipped == 2 and not found.groups


def test_the_verdict_is_not_honest_where_predictions_are_bad(given):
    one = approached(noisy(given, 2))
    full = solved(one, estimators(("graph",)), case=Case(hold="passes"))
    assert unseen(full.verdict["honest"], full.held).ok
    worse = replace(full.held, groups=tuple(replace(g, squares=4.0 * g.squares) for g in full.held.groups))
    said = unseen(Sentence(True, 1.0, "", "Honest: so it is."), worse)
    assert said.ok is False and said.figure == pytest.approx(np.sqrt(worse.nees)) and said.sentence.startswith("Not honest")
