"""Simulated determinations: every value is as far from the truth as its sigma says; how drag varies."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination import density
from piazzi.determination.approach import approached
from piazzi.determination.course import _estimated_air, _with_density, course_of
from piazzi.determination.density import Law, with_density
from piazzi.determination.determining import prepared, ready, solved
from piazzi.determination.fit import estimators
from piazzi.determination.orbit_forces import AirVaries, air_varies
from piazzi.determination.physical import air_of, believed, is_node, nodes_of, said, share_of, slope_of, value_of
from piazzi.determination.setup import follow
from piazzi.estimate.chi_square import quantile
from piazzi.evaluate.information import predicted
from piazzi.orbit import state_axes
from piazzi.problem.inputs import prepare
from tests.references.determinations import (
    AIR,
    KINDS,
    begun,
    consistency,
    drawn,
    predictions,
    ranges,
    seen_rows,
    station,
    within,
)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_every_value_is_consistent(name):
    names, values = consistency(KINDS[name], 6)
    degrees = [6, *[1] * (len(names) - 1)]
    wrong = [label for label, good in zip(names, within(values, degrees, 0.9999), strict=True) if not good]
    assert not wrong, dict(zip(names, values.mean(axis=0) / degrees, strict=True))


def test_density_varies_more_where_the_sun_matters_more_and_less_where_its_activity_is_followed():
    low, middle, high = (air_varies(h, False).sigma for h in (200e3, 550e3, 1e6))
    assert (low, high) == (0.2, 0.5) and low < middle < high
    assert air_varies(550e3, True).sigma == pytest.approx(0.5 * middle)


@pytest.fixture(scope="module")
def low():
    """A low orbit whose coefficient of drag is estimated, with measurements."""
    return drawn(AIR, begun(AIR), 1)[0]


@pytest.mark.slow
def test_density_is_a_gauss_markov_process_at_its_nodes(low):
    """Covariances of the density at its nodes, from its law: sigma^2 exp(-|lag| / time)."""
    given = with_density(approached(low))
    varies, names = given.chosen.air_varies, given.problem.model.names
    where = [i for i, name in enumerate(names) if is_node(name)]
    root = air_of(given.problem)[1]
    P = root @ given.problem.covariance[np.ix_(where, where)] @ root.T
    t = np.array([when - given.measured.epoch for when in nodes_of(given.problem)])
    law = varies.sigma**2 * np.exp(-np.abs(np.subtract.outer(t, t)) / varies.time)
    np.testing.assert_allclose(P, law, rtol=1e-12)
    np.testing.assert_allclose([t[0], t[-1]], given.tracking.times[[0, -1]], atol=1e-6)
    assert sum(f"is estimated at {len(t)} times" in text for text in given.assumed) == 1
    # the coefficient has the mean and sigma of before, and is log-normal: exp(m + v/2), and sqrt(exp(v) - 1) of that
    m, v = (of[names.index("cd_a_m_log")] for of in (given.problem.mean, np.diag(given.problem.covariance)))
    assert (np.exp(m + v / 2.0), np.sqrt(np.expm1(v))) == pytest.approx((1.0, 0.5))
    # its logarithm is linear between nodes; outside it has the mean of a log-normal that is known there: exp(mean + variance/2)
    mean = given.problem.mean.copy()
    mean[:6], mean[where] = low.states[0][:6], np.random.default_rng(0).standard_normal(len(where))
    steady = -(varies.sigma**2) / 2.0
    nodes = said(given.problem, mean)[0][where]
    np.testing.assert_allclose(nodes, steady + root @ mean[where], rtol=1e-13)
    assert believed(given.problem, names[where[-1]]) == pytest.approx((steady, varies.sigma))
    mean[names.index("cd_a_m_log")] = np.log(1.3)
    before = low.problem
    assert before.model.names[6:] == ("cd_a_m_share",)
    for when in (t[2] + 0.25 * (t[3] - t[2]), t[0] - 7200.0, t[-1] + 7200.0):
        left = np.exp(-max(t[0] - when, when - t[-1], 0.0) / varies.time)
        middle = steady + (np.interp(when, t, nodes) - steady) * left
        factor = np.exp(middle + varies.sigma**2 * (1.0 - left**2) / 2.0)
        other = replace(before, parameters={**before.parameters, "cd_a_m": before.parameters["cd_a_m"] * factor})
        at = np.append(mean[:6], share_of(1.3))
        np.testing.assert_allclose(given.problem.dynamics(mean, when)[:6], other.dynamics(at, when)[:6], rtol=1e-12)


@pytest.mark.slow
def test_density_is_left_as_the_model_has_it_where_drag_hardly_moves_the_orbit(low):
    near = approached(low)
    weak = replace(near, problem=replace(near.problem, parameters={**near.problem.parameters, "cd_a_m": 1e-9}))
    assert with_density(weak) is weak
    said_by_user = replace(near, chosen=replace(near.chosen, air_varies=None))
    assert with_density(said_by_user) is said_by_user


@pytest.mark.slow
def test_predictions_through_a_density_that_varies_are_as_good_as_they_say():
    found = predictions(AIR, 6, days=(1, 3))
    assert found.mean(axis=0).max() < quantile(0.9999, 6) / 6, found.mean(axis=0)


@pytest.mark.slow
def test_a_departure_that_never_ends_is_a_wrong_coefficient():
    """With an infinite time it multiplies the coefficient by a log-normal factor, whose variance is exp(sigma^2) - 1."""
    given = begun(AIR)
    last, first = given.tracking.times[-1], given.states[-1]
    t = np.array([last - 10.0, last + 40000.0, last + 86400.0])
    place = given.problem.model.names.index("cd_a_m_share")

    class Estimate:
        times, mean, covariance = given.tracking.times, given.states, np.zeros((1, len(first), len(first)))

    given = replace(given, chosen=replace(given.chosen, air_varies=AirVaries(0.5, 1e15)))
    found = density.departure(given, Estimate, t)
    Phi = follow(given.problem, np.array([last, *t[1:]]), first, given.chosen.max_step)[1]
    by = (Phi[1] @ Phi[0])[:6, place] * value_of(first[place]) / slope_of(first[place])
    law = np.expm1(0.25) * np.outer(by, by)
    assert not found[0].any()
    np.testing.assert_allclose(found[2], law, rtol=1e-4, atol=1e-4 * np.abs(law).max())
    # a coefficient c of variance v has the mean square c^2 + v
    Estimate.covariance[-1, place, place] = 3.0 * (value_of(first[place]) / slope_of(first[place])) ** 2
    np.testing.assert_allclose(density.departure(given, Estimate, t)[2], 4.0 * found[2], rtol=1e-12)


@pytest.mark.parametrize("known", (True, False))
def test_processes_beside_a_state_make_the_covariance_of_a_log_normal_density(known):
    """Of exp(g) over its mean it is exp(C(t, t')) - 1, with C the covariance of g from where that is known, or steady."""
    sigma, time = 0.4, 5000.0
    for t, later in ((100.0, 100.0), (500.0, 4000.0), (9000.0, 30000.0)):
        own = Law(sigma, time, known).variances(t)
        sum_of_processes = own @ np.exp(-np.array(density.ORDERS) * (later - t) / time)
        C = sigma**2 * (np.exp(-(later - t) / time) - known * np.exp(-(later + t) / time))
        assert sum_of_processes == pytest.approx(np.expm1(C), rel=3e-5)


@pytest.fixture(scope="module")
def found():
    """A determination of a low orbit, the density among what is estimated."""
    return solved(ready(drawn(AIR, begun(AIR), 3)[0]), estimators(("graph",)))


@pytest.mark.slow
def test_the_next_night_knows_coefficient_and_density_as_results_have_them(found):
    """The prior of its own unknowns, told as results tell it, is what the first night says at its epoch."""
    t, which = seen_rows(AIR)
    facts = {**found.to_dict(), "verdict": {}}  # which may make sigmas larger
    rows = ranges(AIR, t + float(found.estimate.times[-1]) + 60.0, which)
    given = with_density(prepared(rows, prior=facts, stations=[station(n) for n in AIR.sites], **AIR.words))
    told, J = said(given.problem, given.problem.mean)
    P = J @ given.problem.covariance @ J.T
    own = [given.problem.model.names.index(name) for name in ("cd_a_m_log", "air_1", "density_cos")]
    where = [facts["names"].index(name) for name in ("cd_a_m", f"density_{len(facts['density'])}", "density_cos")]
    np.testing.assert_allclose(told[own], np.array(facts["mean"])[where], rtol=1e-12)
    np.testing.assert_allclose(P[np.ix_(own, own)], np.array(facts["covariance"])[np.ix_(where, where)], rtol=1e-9)
    assert believed(found.problem, "cd_a_m_log") == pytest.approx((0.02, 0.01))  # as cd_a_m=0.02 cd=0.5 says


@pytest.fixture(scope="module")
def next_night(found):
    """Three hours behind it, whose prior it is: what is known of the density then is less than its steady sigma."""
    t, which = seen_rows(AIR)
    own = t < 3 * 3600.0
    rows = ranges(AIR, t[own] + float(found.estimate.times[-1]) + 60.0, which[own])
    facts = {**found.to_dict(), "verdict": {}}  # which may make sigmas larger
    given = prepared(rows, prior=facts, stations=[station(n) for n in AIR.sites], **AIR.words)
    z = predicted(given.problem, prepare(given.problem, given.tracking), given.states)
    z += AIR.sigma * np.random.default_rng(9).standard_normal(z.shape)
    tracking = pz.Tracking(given.tracking.row_times, z, given.tracking.row_stations, epoch=given.tracking.epoch)
    return solved(ready(replace(given, tracking=tracking)), estimators(("graph",)))


@pytest.mark.slow
@pytest.mark.parametrize("night", ["found", "next_night"])
def test_a_file_of_a_determination_predicts_as_surely_as_the_determination(night, request):
    """That of before held the density at its last value for sure: three days on its sigma was a third of what it is."""
    found = request.getfixturevalue(night)
    read = course_of(found.to_dict(), found.epoch)
    last = found.estimate.mean[-1]  # the same forces, the waves of the density over a turn among them
    moved = read.problem.dynamics(read.problem.mean, 0.0)[3:6]
    np.testing.assert_allclose(moved, found.problem.dynamics(last, found.estimate.times[-1])[3:6], rtol=0, atol=1e-8)
    assert any("back to its model" in text for text in read.assumed)
    for days in (1.0, 3.0):
        when = found.epoch + 86400.0 * days
        x, P = found.orbit.at(when), found.orbit.covariance(when, "RTN")
        there, wide = read.beliefs(np.array([when - read.epoch]))
        axes = state_axes(x[:3], x[3:])[:3, :3]
        sigma = np.sqrt(np.diag(axes @ wide[0, :3, :3] @ axes.T))
        ratio = sigma / np.sqrt(np.diag(P)[:3])
        assert (ratio > 0.95).all() and (ratio < 1.05).all(), ratio
        assert (np.abs(axes @ (there[0, :3] - x[:3])) < 0.1 * sigma).all()


def test_the_density_of_a_file_is_that_at_its_epoch():
    """Between nodes its logarithm is linear, as it was estimated: (3 d1 + d2)/4, beside a wave."""
    names, dates = ["x", "cd_a_m", "density_1", "density_2", "density_cos"], [-3600.0, 10800.0]
    P = np.diag([1.0, 0.04, 0.09, 0.16, 0.25])
    mean, wide = _with_density(dates, names, np.array([0.0, 2.0, 0.2, -0.2, 0.3]), P)
    assert mean.tolist() == pytest.approx([0.0, 2.0, 0.2, 0.1, 0.3])
    assert wide[3, 3] == pytest.approx(0.75**2 * 0.09 + 0.25**2 * 0.16) and wide[3, 2] == pytest.approx(0.75 * 0.09)
    assert wide[4, 4] == 0.25 and wide[1].tolist() == [0.0, 0.04, 0.0, 0.0, 0.0]
    assert _estimated_air(names, dates, dict.fromkeys(names)) == ["density_2", "density_cos"]
    assert not _estimated_air(names, [], dict.fromkeys(names)) and not _estimated_air(names, dates, {})


def test_density_has_as_many_nodes_as_measurements_tell_apart():
    """The first wave that is left out moves all rows together by less than a sigma: its acceleration integrated twice."""
    varies, span, rows = AirVaries(0.3, 86400.0), 2.0 * 86400.0, 400
    t = np.linspace(0.0, span, 20001)
    for force in (3e-7, 1e-6):  # of drag, sigmas of a row per s2
        told = density._told_apart(force * np.linspace(0.0, span, rows) ** 2 / 2.0, varies, span)
        for waves, over in ((np.ceil(told + 0.5), False), (np.floor(told - 0.5), True)):
            amplitude = varies.sigma * np.sqrt(4.0 * span / varies.time) / (np.pi * waves)
            speed = np.cumsum(force * amplitude * np.cos(np.pi * waves * t / span)) * t[1]
            place = np.cumsum(speed - speed.mean()) * t[1]
            energy = rows * np.var(np.interp(np.linspace(0.0, span, rows), t, place))
            assert (energy > 1.0) == over, (force, waves, energy)
