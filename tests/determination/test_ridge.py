"""Arcs that are too short for an orbit: what they determine, and how far away the body may be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.determination.centres import centre_of
from piazzi.determination.initial import _why_not
from piazzi.determination.initial_result import InitialOrbits, OrbitMode, UndeterminedError
from piazzi.determination.ridge import OPEN, _ends, _speeds, counted, openness, ridge
from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import DIRECTION, POSITION, RANGE, RATE, Rows
from piazzi.orbit.modes import two_body_modes
from piazzi.orbit.starts import moment
from tests.references.tracks import ABOUT_EARTH, ABOUT_SUN, EARTH, asteroid, low, near, orbit, packed, seen

EPOCH = pz.Epoch("2024-01-01T00:00:00 UTC")


def short(seed, times, sigma=1e-5):
    """Directions of a satellite of any height, its state, and the place of the station at time zero."""
    rng = np.random.default_rng(seed)
    while True:
        x = orbit(rng, EARTH, 10.0 ** rng.uniform(6.87, 7.62), 0.001, rng.uniform(-1, 1))
        up = x[:3] / np.linalg.norm(x[:3])
        station = near(rng, np.arcsin(up[2]), np.arctan2(up[1], up[0]), 0.1)
        rows = seen(rng, x, station, times, {"direction": sigma})
        if len(rows) == len(times):
            return x, packed(rows), station(float(np.median(times)))[0]


@pytest.mark.parametrize(
    ("kinds", "known"),
    [
        ([(0.0, POSITION)], 3),  # one fix
        ([(0.0, RANGE)] * 4, 3),  # four distances at once say where it is, and no more
        ([(0.0, RANGE), (0.0, RATE), (1.0, RANGE)], 3),
        ([(0.0, DIRECTION), (0.0, RANGE), (0.0, RATE)], 4),
        ([(0.0, POSITION), (1.0, POSITION), (2.0, RANGE)], 6),
    ],
)
def test_rows_that_are_too_few_for_any_orbit_are_counted(kinds, known):
    t, kind = (np.array(column) for column in zip(*kinds, strict=True))
    none = np.zeros((len(t), 3))
    assert counted(Rows(t=t, kind=kind, observer=none, observer_velocity=none, value=none, sigma=none[:, :2])) == known


def test_a_short_arc_is_a_ridge_and_a_pass_is_none():
    _, rows, _ = short(3, np.arange(0.0, 20.0, 4.0))
    wide, known = openness(two_body_modes(rows, ABOUT_EARTH).modes[0])
    assert wide > OPEN and known < 6
    rng = np.random.default_rng(5)
    x, *under = low(rng)
    full = packed(seen(rng, x, near(rng, *under, 0.05), np.arange(-200.0, 200.0, 10.0), {"direction": 1e-5, "range": 10.0}))
    wide, known = openness(two_body_modes(full, ABOUT_EARTH).modes[0])
    assert wide < OPEN and known == 6


@pytest.mark.slow
def test_the_truth_is_in_the_admissible_region_as_often_as_it_says():
    """Distances and rates are drawn as they are before the measurements: 90 % of the truths are between the 5 and the 95 %."""
    times, inside, count = np.arange(0.0, 40.0, 8.0), 0, 30
    for seed in range(count):
        rng = np.random.default_rng(seed)
        _, rows, _ = short(seed, times)
        given = moment(rows, 16.0, 100.0)
        low_end, top = _ends(given, ABOUT_EARTH)
        while True:
            distance = np.exp(rng.uniform(np.log(low_end), np.log(top)))
            middle, reach = _speeds(given, ABOUT_EARTH, np.array([distance]))
            rate = middle + 1.2e4 * rng.uniform(-1, 1)
            r = given.observer + distance * given.direction
            v = given.velocity + distance * given.direction_rate + rate * given.direction
            if abs(rate - middle) < reach[0] and ABOUT_EARTH.holds(np.concatenate([r, v])[None])[0]:
                break
        back = np.concatenate(propagate_kepler(r, v, EARTH, -given.t))
        station = {at: (o, w) for at, o, w in zip(rows.t, rows.observer, rows.observer_velocity, strict=True)}
        drawn = packed(seen(rng, back, station.__getitem__, rows.t, {"direction": 1e-5}, lowest=None))
        found = ridge(drawn, ABOUT_EARTH, EPOCH, 4)
        assert_allclose(found.probability.sum(), 1.0)
        assert ABOUT_EARTH.holds(found.states).all()
        lowest, middle, highest = found.quantiles(found.distance)
        assert lowest <= middle <= highest
        inside += lowest <= distance <= highest
    assert inside >= 23  # of 27 that are expected; fewer happens once in a hundred


def test_the_attributable_is_the_direction_and_its_rate():
    """As differences of the true direction have them, within the sigmas that a straight line leaves."""
    times = np.arange(0.0, 20.0, 4.0)
    _, rows, _ = short(8, times, sigma=1e-7)
    found = ridge(rows, ABOUT_EARTH, EPOCH, 4)
    k = 2
    right, dec, east, north = found.attributable
    u = rows.value[k]
    assert abs(np.arcsin(u[2]) - dec) < 1e-5
    v = (rows.value[k + 1] - rows.value[k - 1]) / (rows.t[k + 1] - rows.t[k - 1])
    assert abs(v @ [-np.sin(right), np.cos(right), 0.0] - east) < 1e-6
    assert_allclose(np.hypot(east, north), np.linalg.norm(v), rtol=1e-3)
    assert (found.sigma > 0).all()


@pytest.mark.parametrize("about", ["earth", "sun"])
def test_two_directions_are_an_attributable_and_one_time_is_less(about):
    if about == "earth":
        _, rows, _ = short(4, np.array([0.0, 30.0]))
        region = ABOUT_EARTH
    else:
        rows, region = packed(asteroid(np.random.default_rng(1))[1]).of([0, 3]), ABOUT_SUN
    found = ridge(rows, region, EPOCH, 4)
    assert found.attributable is not None and len(found.distance)
    assert "4 of six numbers" in str(found) and "arcsec/s" in str(found) and "km away" in str(found)
    one = ridge(rows.of([0]), region, EPOCH, 2)
    assert one.attributable is None and not len(one.distance)
    assert one.to_dict()["distance"] is None
    assert str(one).endswith("2 of six numbers")


def test_a_ridge_is_told_and_can_be_sent_to_other_processes():
    import pickle

    _, rows, _ = short(4, np.array([0.0, 30.0]))
    found = InitialOrbits((), 10, 5, ridge=ridge(rows, ABOUT_EARTH, EPOCH, 4))
    facts = found.to_dict()
    assert facts["schema"] == "piazzi.orbits/1" and facts["modes"] == [] and facts["ridge"]["known"] == 4
    error = UndeterminedError(found)
    assert "a ridge, no orbit" in str(error)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize(
    ("speed", "says"),
    [(1.0, ""), (0.3, "through the Earth, down to"), (1.45, "not bound"), (1.4, "farther than")],
)
def test_what_is_no_orbit_for_a_whole_turn_is_said(speed, says):
    """Across the radius at a share of the circular speed: the other apsis is at r s^2 / (2 - s^2)."""
    r = 7e6
    state = np.array([r, 0.0, 0.0, 0.0, speed * np.sqrt(EARTH / r), 0.0])
    found = _why_not(state, ABOUT_EARTH, centre_of("earth"))
    assert says in found and bool(found) == bool(says)
    if speed < 1.0:
        assert f"{r * speed**2 / (2 - speed**2) / 1e3:,.0f} km" in found
    told = InitialOrbits((OrbitMode(EPOCH, state, np.eye(6), 1.0, 1.0, 6, found),), 1, 1)
    assert (found in str(told)) and told.to_dict()["modes"][0]["why_not"] == found
