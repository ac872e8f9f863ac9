"""Rows that do not fit: gross errors, a station exchanged, a wrong clock, a pass not settled; and nothing right is lost."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination.analysis import analysed
from piazzi.determination.approach import approached
from piazzi.determination.completeness import left_out, words_for
from piazzi.determination.determining import solved
from piazzi.determination.editing import edited
from piazzi.determination.faults import CLOCK, MASK, OUTLIER, SETTLING, STATION
from piazzi.determination.fit import estimators
from piazzi.earth.defaults import read_forces
from piazzi.evaluate.information import predicted
from piazzi.problem.inputs import prepare
from tests.determination.lasers import EACH, SIGMA, twelve_passes

LOST = 1.0 / 20.0  # of rows that are left out, as the guide says


@pytest.fixture(scope="module")
def given():
    """Twelve passes over four stations without noise."""
    made = twelve_passes()
    return with_values(made, predicted(made.problem, prepare(made.problem, made.tracking), made.states))


def with_values(made, z):
    tracking = made.tracking
    return replace(made, tracking=pz.Tracking(tracking.row_times, z, tracking.row_stations, epoch=tracking.epoch))


def noise(given, seed):
    return SIGMA * np.random.default_rng(seed).standard_normal(given.tracking.values.shape)


def seen_from(given, rows, station):
    """Ranges of rows had another station of the problem measured them."""
    tracking = given.tracking
    names = tracking.row_stations.copy()
    names[rows] = next(s.name for s in given.problem.stations if given.measured.labels[s.name] == station)
    moved = pz.Tracking(tracking.row_times, tracking.values, names, epoch=tracking.epoch)
    return predicted(given.problem, prepare(given.problem, moved), given.states)[rows]


def late(given, rows, seconds):
    """Ranges of rows whose clock is fast by so much: what was measured so much earlier, by a polynomial through the pass."""
    t = given.tracking.row_times[rows]
    return np.polynomial.Polynomial.fit(t, given.tracking.values[rows, 0], 9)(t - seconds)[:, None]


def test_what_was_wrong_is_named_and_nothing_right_is_lost(given):
    """Over seeds: 5 % gross errors of 10 to 1e5 sigma, a pass of another station, a pass whose clock is 0.2 s fast."""
    exchanged, clock = np.arange(3 * EACH, 4 * EACH), np.arange(6 * EACH, 7 * EACH)
    lost = left = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        z = given.tracking.values.copy()
        z[exchanged] = seen_from(given, exchanged, "7119")
        z[clock] = late(given, clock, 0.2)
        z += noise(given, seed)
        others = np.setdiff1d(np.arange(len(z)), np.concatenate([exchanged, clock]))
        gross = rng.choice(others, round(0.05 * len(z)), replace=False)
        z[gross, 0] += SIGMA * rng.choice([-1.0, 1.0], len(gross)) * 10.0 ** rng.uniform(1.0, 5.0, len(gross))
        guess = replace(given.guess, position=given.guess.position + 5e3)
        found = solved(approached(replace(with_values(given, z), guess=guess)), estimators(("graph",)))
        assert found.determined
        assert set(found.reasons[exchanged]) == {STATION} and set(found.reasons[clock]) == {CLOCK}
        assert not found.keep[gross].any()
        good = np.setdiff1d(others, gross)
        lost, left = lost + int((~found.keep[good]).sum()), left + int((~found.keep).sum())
        said = found.verdict["honest"].sentence
        assert "fits 7119" in said and " s fast" in said and found.verdict["honest"].ok is True
        told = float(said.partition("a clock that is ")[2].split()[0])
        assert told == pytest.approx(0.2, abs=1e-3)
    assert lost <= LOST * left + 3.0 * np.sqrt(LOST * left)


def test_of_rows_that_are_right_none_is_left_out(given):
    """Over 200 seeds of normal noise: in one of twenty some row at most, not one row in fifty of all."""
    lost = [
        int((~edited(made, analysed(made, given.states))[0]).sum())
        for made in (with_values(given, given.tracking.values + noise(given, seed)) for seed in range(200))
    ]
    assert np.count_nonzero(lost) <= 10 + 3.0 * np.sqrt(10) and sum(lost) <= 2 * np.count_nonzero(lost)


def test_a_pass_that_had_not_settled_and_rows_below_the_mask(given):
    """The first three rows of a pass drift; of a station whose mask is above the object an outlier says so."""
    z = given.tracking.values + noise(given, 5)
    start = np.arange(4 * EACH, 4 * EACH + 3)
    z[start, 0] += SIGMA * np.array([300.0, 100.0, 40.0])
    low = 9 * EACH + 5
    z[low, 0] += 1000.0 * SIGMA
    masked = with_values(given, z)
    name = given.tracking.row_stations[low]
    stations = [
        replace(s, place=replace(s.place, station=replace(s.place.station, mask=1.5))) if s.name == name else s
        for s in masked.problem.stations
    ]
    masked = replace(masked, problem=replace(masked.problem, stations=stations))
    found = solved(approached(masked), estimators(("graph",)))
    assert found.reasons[start].tolist() == [SETTLING] * 3 and found.reasons[low] == MASK
    assert np.isfinite(found.residuals["o_minus_c"].values[~found.keep]).all()  # still shown


def test_more_than_a_fifth_is_a_verdict_and_no_edit(given):
    """A quarter of the rows far off, spread over all passes: none is left out, and the residuals say so."""
    z = given.tracking.values + noise(given, 6)
    z[::4, 0] += 50.0 * SIGMA
    found = solved(approached(with_values(given, z)), estimators(("graph",)))
    assert found.keep.all() and found.verdict["honest"].ok is False and not (found.reasons == OUTLIER).any()


def test_a_clock_is_named_at_the_first_rows_of_all_too(given):
    """Rows that were measured before the problem begins: 0.5 s before their first time."""
    clock = np.arange(EACH)
    z = given.tracking.values.copy()
    z[clock] = late(given, clock, 0.5)
    found = solved(approached(with_values(given, z + noise(given, 8))), estimators(("graph",)))
    assert set(found.reasons[clock]) == {CLOCK} and " s fast" in found.verdict["honest"].sentence


def test_complete_is_what_a_fit_with_the_larger_field_changes(given):
    """Against two fits of the same rows, in fields of degree 6 and 12: the largest change of a state in sigma."""
    z = given.tracking.values + noise(given, 7)

    def fitted(degree):
        functions = given.problem.functions
        field = replace(functions["field"], degree=degree, gradient_degree=degree)
        problem = replace(given.problem, functions={**functions, "field": field})
        return solved(approached(replace(with_values(given, z), problem=problem)), estimators(("batch",)))

    small, large = fitted(6), fitted(12)
    moved = np.abs(large.estimate.mean[0, :6] - small.estimate.mean[0, :6])
    expected = float(np.max(moved / np.sqrt(np.diag(small.estimate.covariance[0])[:6])))
    found = left_out(small.setup, small.estimate.mean, small.analysis, small.keep)
    assert found["gravity to degree 12 instead of degree 6"] == pytest.approx(expected, rel=0.05)
    said = small.verdict["complete"]
    assert said.figure == max(found.values()) and said.ok is (said.figure <= 1.0)
    named = {
        "gravity to degree 12 instead of degree 6",
        "the pole tide",
        "frame dragging",
        "the pull of Venus",
        "sunlight",
    }
    words = words_for(small.setup, sorted(named))
    assert read_forces(words, 6000e3).forces.degree == 12 and words.startswith(
        "default relativity=schwarzschild,lense-thirring "
    )
    assert words.endswith("degree=12 radiation=cannonball tides=solid,k1,pole bodies=sun,moon,venus")
    assert said.ok or f"--forces '{words_for(small.setup, [n for n, moved in found.items() if moved > 1.0])}'" in said.sentence


def fitted(given, **switches):
    """The fit of rows so quiet that none is left out."""
    problem = replace(given.problem, parameters={**given.problem.parameters, **switches})
    z = given.tracking.values + 0.3 * noise(given, 7)
    return solved(approached(replace(with_values(given, z), problem=problem)), estimators(("batch",)))


@pytest.fixture(scope="module")
def whole(given):
    return fitted(given, moon_on=1.0, relativity_on=1.0)


@pytest.mark.parametrize(("switch", "name"), [("moon_on", "the pull of Moon"), ("relativity_on", "relativity")])
def test_complete_is_what_a_fit_with_the_force_changes(given, whole, switch, name):
    """Against two fits of the same rows, with the force and without it."""
    without = fitted(given, **{"moon_on": 1.0, "relativity_on": 1.0, switch: 0.0})
    assert without.keep.all() and whole.keep.all()
    moved = np.abs(whole.estimate.mean[0, :6] - without.estimate.mean[0, :6])
    expected = float(np.max(moved / np.sqrt(np.diag(without.estimate.covariance[0])[:6])))
    found = left_out(without.setup, without.estimate.mean, without.analysis, without.keep)
    assert found[name] == pytest.approx(expected, rel=0.05)
    assert name not in left_out(whole.setup, whole.estimate.mean, whole.analysis, whole.keep)
