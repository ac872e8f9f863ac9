"""Orbits found without a guess: the truth is among them, with the probability and the covariance that are said."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.orbit import propagate_kepler
from piazzi.orbit.fits import Rows, Setting, fitted, squares
from piazzi.orbit.modes import density, thinned, two_body_modes
from piazzi.orbit.region import Region
from piazzi.orbit.starts import halton
from tests.references.tracks import ABOUT_EARTH, EARTH, RADIUS, TRACKS, solved, track


@pytest.mark.parametrize("kind", TRACKS)
def test_the_truth_is_among_the_modes(kind):
    for seed in range(100, 102):
        search, found, squares_off = solved(kind, seed)
        assert found is not None
        assert squares_off[found] < 35.0
        assert_allclose(sum(m.probability for m in search.modes), 1.0, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRACKS)
def test_the_truth_is_among_the_modes_of_many(kind):
    """In all but one of forty; its squared distance in units of the covariance is about that of chi-square."""
    found = [solved(kind, seed) for seed in range(40)]
    assert sum(k is None for _, k, _ in found) <= 1
    off = [s[k] for _, k, s in found if k is not None]
    assert 4.0 < np.median(off) < 9.0


def test_the_density_before_measurements_is_uniform_in_what_is_measured_and_in_the_logarithm_of_the_distance():
    """The determinant of the change of variables, by central differences."""
    here, moves = np.array([1.0, 0.2, -0.3]), np.array([0.1, 0.9, 0.2])

    def state(y):
        lon, lat, dlon, dlat, size, rate = y
        rho = np.exp(size)
        u = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
        east, north = np.array([-np.sin(lon), np.cos(lon), 0.0]), np.cross(u, [-np.sin(lon), np.cos(lon), 0.0])
        return np.concatenate([here + rho * u, moves + rate * u + rho * (dlon * east + dlat * north)])

    found = []
    for size in (0.3, 1.1):
        y = np.array([0.4, 0.0, 0.2, -0.1, size, 0.3])  # at the equator of the sky, where angles are lengths
        J = np.stack([(state(y + e) - state(y - e)) / 2e-5 for e in 1e-5 * np.eye(6)], axis=1)
        found.append(np.linalg.slogdet(J)[1] + density(10.0 * state(y)[None], 10.0 * here)[0])
    assert_allclose(found[0], found[1], atol=1e-8)


def test_derivatives_are_those_of_differences():
    """The triangle holds the curvature of the sum of squares for all kinds of rows, and fits end where its gradient is zero."""
    rng = np.random.default_rng(3)
    kinds = np.array([1.0, 2.0, 3.0, 4.0] * 3)
    J = len(kinds)
    x = np.array([7.1e6, 2e5, -3e5, 50.0, 6.1e3, 4.2e3, 3.0])
    t = np.linspace(-400.0, 500.0, J)
    place = RADIUS * np.array([0.9, 0.3, 0.3]) + 1e3 * rng.normal(size=(J, 3))
    moves = rng.normal(size=(J, 3))
    r, v = propagate_kepler(np.tile(x[:3], (J, 1)), np.tile(x[3:6], (J, 1)), EARTH, t)
    seen = r - place
    rho = np.linalg.norm(seen, axis=1)
    u = seen / rho[:, None]
    value = r.copy()
    value[kinds == 1, 0] = rho[kinds == 1]
    value[kinds == 2, 0] = (np.sum(u * (v - moves), axis=1) + x[6])[kinds == 2]
    value[kinds == 3] = u[kinds == 3]
    sigma = np.array([10.0, 0.1, 1e-5, 10.0])[kinds.astype(int) - 1][:, None] * [1.0, 1.0]
    shared = (kinds == 2).astype(float)
    rows = Rows(t=t, kind=kinds, observer=place, observer_velocity=moves, value=value, sigma=sigma, shared=shared)
    still = Setting(EARTH, 0.0, light=1e30, offset_sigma=50.0, steps=0)
    exact = fitted(rows, [x], still)
    assert exact.square[0] < 1e-2  # but for the prior of the constant
    unit = np.array([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3, 1e-2])
    ahead = np.array([[squares(rows, [x + s * e], still)[0] for s in (1, -1)] for e in unit * np.eye(7)])
    curvature = (ahead.sum(axis=1) - 2 * exact.square[0]) / unit**2
    assert_allclose(np.sum(exact.root[0] ** 2, axis=0), 0.5 * curvature, rtol=1e-4)


def test_plain_and_compiled_agree(monkeypatch):
    x, rows, _ = track("radar_pass", 1)
    few = thinned(rows, 8)
    starts = np.concatenate([x[:3] + 5e3, x[3:] + 5.0])
    found = fitted(few, [starts], Setting(EARTH, 0.0))
    monkeypatch.setenv("PIAZZI_JIT", "0")
    plain = fitted(few, [starts], Setting(EARTH, 0.0))
    assert_allclose(plain.state, found.state, rtol=1e-9)
    assert_allclose(plain.square, found.square, rtol=1e-6)


def test_a_row_of_no_information_changes_nothing():
    _, rows, _ = track("three_radars", 2)
    search = two_body_modes(rows, ABOUT_EARTH)
    names = ("t", "kind", "observer", "observer_velocity", "value", "shared")
    more = {name: np.concatenate([getattr(rows, name), getattr(rows, name)[:1]]) for name in names}
    wide = Rows(**more, sigma=np.concatenate([rows.sigma, [[1e15, 1e15]]]))
    other = two_body_modes(wide, ABOUT_EARTH, epoch=search.epoch)
    off = search.modes[0].root @ np.append(other.modes[0].state - search.modes[0].state, 0.0)
    assert np.abs(off).max() < 0.1


def test_orbits_through_the_body_have_no_probability():
    """As of a body that is larger than the orbit: what fits is not admissible."""
    x, rows, _ = track("radar_pass", 3)
    search = two_body_modes(rows, Region(EARTH, np.linalg.norm(x[:3]) + 200e3, 1e8))
    assert all(not m.admissible and m.probability == 0.0 for m in search.modes)


def test_the_sequence_is_that_of_halton():
    assert_allclose(halton(4, 2), [[1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9], [1 / 8, 4 / 9]])
