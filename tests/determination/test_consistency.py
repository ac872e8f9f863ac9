"""Simulated determinations: every value is as far from the truth as its sigma says; how drag varies."""

from dataclasses import replace

import numpy as np
import pytest

from piazzi.determination import density
from piazzi.determination.approach import approached
from piazzi.determination.course import _estimated_air, _with_density, course_of
from piazzi.determination.density import with_density
from piazzi.determination.determining import ready, solved
from piazzi.determination.fit import estimators
from piazzi.determination.orbit_forces import AirVaries, air_varies
from piazzi.determination.physical import air_of, is_node, nodes_of
from piazzi.determination.setup import follow
from piazzi.estimate.chi_square import quantile
from piazzi.orbit import state_axes
from tests.references.determinations import AIR, KINDS, begun, consistency, drawn, predictions, within


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
    # between nodes it is linear, and it goes back to the model's outside: by the rate of a coefficient that is as much larger
    mean = given.problem.mean.copy()
    mean[:6], mean[where] = low.states[0][:6], np.random.default_rng(0).standard_normal(len(where))
    nodes = root @ mean[where]
    for when in (t[2] + 0.25 * (t[3] - t[2]), t[0] - 7200.0, t[-1] + 7200.0):
        inside = np.interp(when, t, nodes) * np.exp(-max(t[0] - when, when - t[-1], 0.0) / varies.time)
        other = given.problem.mean.copy()
        other[:6] = mean[:6]
        other[names.index("cd_a_m_share")] += inside
        np.testing.assert_allclose(given.problem.dynamics(mean, when), given.problem.dynamics(other, when), rtol=1e-13)


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
    """With an infinite time the departure multiplies the coefficient: its effect is the derivative by it, once over."""
    given = begun(AIR)
    last, first = given.tracking.times[-1], given.states[-1]
    t = np.array([last - 10.0, last + 40000.0, last + 86400.0])

    class Estimate:
        times, mean = given.tracking.times, given.states

    given = replace(given, chosen=replace(given.chosen, air_varies=AirVaries(0.1, 1e15)))
    found = density.departure(given, Estimate, t)
    place = given.problem.model.names.index("cd_a_m_share")
    Phi = follow(given.problem, np.array([last, *t[1:]]), first, given.chosen.max_step)[1]
    by = (Phi[1] @ Phi[0])[:6, place] * 0.1
    assert not found[0].any()
    np.testing.assert_allclose(found[2], np.outer(by, by), rtol=1e-4, atol=1e-4 * np.abs(np.outer(by, by)).max())


@pytest.mark.slow
def test_a_file_of_a_determination_predicts_as_surely_as_the_determination():
    """That of before held the density at its last value for sure: three days on its sigma was a third of what it is."""
    given = begun(AIR)
    found = solved(ready(drawn(AIR, given, 3)[0]), estimators(("graph",)))
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


def test_the_density_of_a_file_is_that_at_its_epoch_in_units_of_the_coefficient():
    """Between nodes it is linear, as it was estimated: c (3 d1 + d2)/4, beside c w for a wave, with a covariance of its own."""
    names, dates = ["x", "cd_a_m", "density_1", "density_2", "density_cos"], [-3600.0, 10800.0]
    P = np.diag([1.0, 0.04, 0.09, 0.16, 0.25])
    mean, wide = _with_density(dates, names, np.array([0.0, 2.0, 0.2, -0.2, 0.3]), P)
    assert mean.tolist() == pytest.approx([0.0, 2.0, 0.2, 2.0 * 0.1, 2.0 * 0.3])
    by_drag, by_share = np.array([0.1, 0.3]), 2.0 * np.array([[0.75, 0.25, 0.0], [0.0, 0.0, 1.0]])
    expected = 0.04 * np.outer(by_drag, by_drag) + by_share @ P[2:, 2:] @ by_share.T
    np.testing.assert_allclose(wide[np.ix_([3, 4], [3, 4])], expected, rtol=1e-14)
    np.testing.assert_allclose(wide[1, [1, 3, 4]], 0.04 * np.array([1.0, 0.1, 0.3]), rtol=1e-14)
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
