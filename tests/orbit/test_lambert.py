"""Lambert's problem: what comes out lands where it should, and is the same as in 50 digits."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi.orbit import lambert, lambert_all, propagate_kepler
from tests.references.exact_orbits import lambert_velocity

MU = 398600.4418
PLUNGE = 3e-11  # what the propagation, not the solver, loses on hyperbolas that pass the centre at a thousandth of their length


def drawn(n, seed):
    """Positions over two orders of magnitude and times from a hundredth to a hundred times that of half a circle."""
    rng = np.random.default_rng(seed)
    r = rng.normal(size=(2, n, 3))
    r *= 10.0 ** rng.uniform(-1, 1, (2, n, 1)) / np.linalg.norm(r, axis=-1, keepdims=True)
    s = 0.5 * (np.linalg.norm(r, axis=-1).sum(0) + np.linalg.norm(r[1] - r[0], axis=-1))
    T = 10.0 ** rng.uniform(-2, 2.5, n)
    turns = np.floor(rng.random(n) * np.maximum(T / np.pi, 1)) * (rng.random(n) < 0.7)
    return r[0], r[1], T * np.sqrt(s**3 / 2), {"prograde": rng.random(n) < 0.5, "turns": turns, "late": rng.random(n) < 0.5}


def landing(r1, v1, dt, mu, r2):
    """How far from r2 the orbit ends, relative to it and to how far errors of the start would carry."""
    end = propagate_kepler(r1, v1, mu, dt)[0]
    size = np.linalg.norm(v1, axis=-1)[:, None], np.linalg.norm(r1, axis=-1)[:, None]
    moved = [propagate_kepler(r1, v1 + 1e-7 * size[0] * e, mu, dt)[0] for e in np.eye(3)]
    moved += [propagate_kepler(r1 + 1e-7 * size[1] * e, v1, mu, dt)[0] for e in np.eye(3)]
    away = sum(np.linalg.norm(m - end, axis=-1) for m in moved) / 1e-7
    return np.linalg.norm(end - r2, axis=-1) / (np.linalg.norm(r2, axis=-1) + away)


@pytest.mark.parametrize("n", [pytest.param(4000, id="few"), pytest.param(200_000, marks=pytest.mark.slow, id="many")])
def test_every_orbit_lands(n):
    r1, r2, dt, which = drawn(n, 7)
    v1, _ = lambert(r1, r2, dt, 1.0, **which)
    missing = np.isnan(v1).any(axis=1)
    assert not missing[which["turns"] == 0].any()
    assert missing.mean() < 0.02
    some = ~missing
    errors = landing(r1[some], v1[some], dt[some], 1.0, r2[some])
    assert np.median(errors) < 1e-15
    assert np.max(errors) < PLUNGE


@pytest.mark.parametrize("n", [pytest.param(25, id="few"), pytest.param(300, marks=pytest.mark.slow, id="many")])
def test_velocities_are_those_of_fifty_digits(n):
    r1, r2, dt, which = drawn(n, 3)
    v1, _ = lambert(r1, r2, dt, 1.0, **which)
    for k in np.flatnonzero(~np.isnan(v1[:, 0])):
        exact = lambert_velocity(r1[k], r2[k], dt[k], 1.0, v1[k])
        assert np.linalg.norm(v1[k] - exact) < 2e-14 * np.linalg.norm(exact), k


def test_turns_are_found_up_to_the_last_and_none_is_invented():
    """At the least time for so many turns the two orbits are one; a little less time leaves none."""
    r1, r2 = np.array([1.0, 0.2, 0.1]), np.array([-0.4, 1.3, 0.3])
    times = np.linspace(20, 60, 4001)
    for turns in (1, 3):
        v_early = lambert(r1, r2, times, 1.0, turns=turns)[0]
        v_late = lambert(r1, r2, times, 1.0, turns=turns, late=True)[0]
        there = ~np.isnan(v_early[:, 0])
        assert_allclose(there, ~np.isnan(v_late[:, 0]))
        first = np.argmax(there)
        assert not first or there[first:].all()
        assert not there[:first].any()
        gap = np.linalg.norm(v_early - v_late, axis=1)
        assert (np.diff(gap[there]) > 0).all()
        for k in (first, first + 1, 4000):
            for v in (v_early[k], v_late[k]):
                assert landing(r1[None], v[None], times[k], 1.0, r2)[0] < 1e-13
    for transfer in lambert_all(r1, r2, 60.0, 1.0):
        a = 1 / (2 / np.linalg.norm(r1) - transfer.v1 @ transfer.v1)
        assert transfer.turns <= 60.0 / (2 * np.pi * a**1.5) < transfer.turns + 1 if a > 0 else not transfer.turns
        assert (np.cross(r1, transfer.v1)[2] > 0) == transfer.prograde


def test_all_orbits_are_different_and_complete():
    r1, r2 = np.array([1.0, 0, 0]), np.array([0.3, 1.1, -0.2])
    found = lambert_all(r1, r2, 30.0, 1.0)
    v = np.array([t.v1 for t in found])
    apart = np.linalg.norm(v[:, None] - v, axis=-1) + 10 * np.eye(len(v))
    assert apart.min() > 1e-3
    for prograde in (True, False):
        most = max(t.turns for t in found if t.prograde == prograde)
        assert sum(t.prograde == prograde for t in found) == 2 * most + 1
        assert np.isnan(lambert(r1, r2, 30.0, 1.0, prograde=prograde, turns=most + 1)[0]).all()


def test_half_a_turn_lies_in_the_plane_of_the_axis():
    v1, v2 = lambert([1.0, 0, 0], [-2.0, 0, 0], 3.0, 1.0, about=(0, -1, 1))
    assert_allclose(np.cross([1, 0, 0], v1) / np.linalg.norm(np.cross([1, 0, 0], v1)), [0, -np.sqrt(0.5), np.sqrt(0.5)])
    assert_allclose(propagate_kepler([1.0, 0, 0], v1, 1.0, 3.0)[1], v2, atol=1e-13)
    v1, _ = lambert([1.0, 0, 0], [-2.0, 0, 0], 3.0, 1.0, prograde=False, about=(0, -1, 1))
    assert np.cross([1, 0, 0], v1) @ [0, -1, 1] < 0


def test_straight_up():
    """Positions on one ray: a throw along the radius."""
    v1, v2 = lambert([1.0, 0, 0], [1.5, 0, 0], 0.4, 1.0)
    assert_allclose(v1[1:], 0, atol=1e-15)
    assert v1[0] ** 2 / 2 - 1 == pytest.approx(v2[0] ** 2 / 2 - 1 / 1.5)


def test_backwards_in_time_is_the_mirror():
    """Velocities change sign with time: from r2 to r1 the other way around."""
    r1, r2, dt, which = drawn(300, 9)
    v1, v2 = lambert(r1, r2, dt, 1.0, **which)
    w2, w1 = lambert(r2, r1, dt, 1.0, **{**which, "prograde": ~which["prograde"]})
    size = np.linalg.norm(v1, axis=1)
    some = size > 0
    assert np.max(np.linalg.norm(v1 + w1, axis=1)[some] / size[some]) < 1e-13
    assert np.max((np.linalg.norm(v2 + w2, axis=1) / np.linalg.norm(v2, axis=1))[some]) < 1e-13


def test_the_textbook_example():
    radius = 6378.137
    r1, r2 = radius * np.array([2.5, 0, 0]), radius * np.array([1.9151111, 1.6069690, 0])
    v1, v2 = lambert(r1, r2, 76 * 60.0, MU)
    assert_allclose(v1, [2.058913, 2.915965, 0], atol=1e-6)
    assert_allclose(v2, [-3.451565, 0.910315, 0], atol=1e-6)


def cases(data_dir):
    """Published cases: number, the six entries as lists of numbers."""
    found = []
    for line in (data_dir / "earth" / "iod" / "lamberttest.dat").read_text().splitlines():
        if heading := re.match(r"\s*#\s*(\d+)", line):
            found.append([int(heading[1])])
        elif not line.startswith("#") and (numbers := re.findall(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?", line)) and found:
            found[-1].append([float(x) for x in numbers])
    return [case for case in found if len(case) == 7]


def test_published_cases(data_dir):
    """All 87, with their traps: each orbit lands, in 50 digits too; equal positions are refused; printed answers come out."""
    answered, refused = 0, 0
    for number, _, r1, v1, r2, v2, (dt, *_) in cases(data_dir):
        if r1 == r2:
            refused += 1
            with pytest.raises(ValueError, match="the two positions are equal"):
                lambert_all(r1, r2, dt, MU)
            continue
        found = lambert_all(r1, r2, dt, MU)
        v = np.array([t.v1 for t in found])
        assert landing(np.tile(r1, (len(v), 1)), v, dt, MU, np.array(r2)).max() < PLUNGE, number
        sine = np.linalg.norm(np.cross(r1, r2)) / np.linalg.norm(r1) / np.linalg.norm(r2)
        for transfer in found[:: max(1, len(found) - 1)] if sine > 1e-14 else ():  # of 38 the plane is that of the axis
            exact = lambert_velocity(r1, r2, dt, MU, transfer.v1)
            assert np.linalg.norm(transfer.v1 - exact) < 1e-12 * np.linalg.norm(exact), number
        if number in (75, 77):  # of the others, velocities in the file are those of the bodies, and not of the transfer
            answered += 1
            assert min(np.linalg.norm([*(t.v1 - v1), *(t.v2 - v2)]) for t in found) < 1e-8, number
    assert (answered, refused) == (2, 3)


def test_uncompiled_code_gives_the_same(monkeypatch):
    r1, r2, dt, which = drawn(30, 5)
    compiled = lambert(r1, r2, dt, 1.0, **which)
    monkeypatch.setenv("PIAZZI_JIT", "0")
    assert_allclose(lambert(r1, r2, dt, 1.0, **which), compiled, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt": -3.0}, "time between the positions is -3; it must be positive"),
        ({"dt": 0.0}, "it must be positive"),
        ({"r2": [1.0, 0, 0]}, "the two positions are equal"),
        ({"r1": [0.0, 0, 0]}, "r1 is zero"),
        ({"r1": [1.0, np.nan, 0]}, "must be finite"),
        ({"r1": [1.0, 0]}, r"r1 has shape \(2,\)"),
        ({"mu": 0.0}, "mu is 0"),
        ({"turns": -1}, "turns are -1"),
        ({"turns": 0.5}, "turns are 0.5"),
        ({"about": (0, 0, 0)}, "axis of the motion"),
        ({"r1": [0, 0, 1.0], "r2": [0, 0, -2.0]}, "on one line, which leaves the plane open"),
    ],
)
def test_what_has_no_answer_is_refused(change, message):
    given = {"r1": [1.0, 0, 0], "r2": [0, 1.0, 0], "dt": 1.0, "mu": 1.0} | change
    with pytest.raises(ValueError, match=message):
        lambert(**given)
