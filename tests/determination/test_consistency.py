"""Simulated determinations: every value is as far from the truth as its sigma says; how drag varies."""

from dataclasses import replace

import numpy as np
import pytest

from piazzi.determination import density
from piazzi.determination.orbit_forces import AirVaries, air_varies
from piazzi.determination.setup import follow
from tests.references.determinations import AIR, KINDS, begun, consistency, within


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
    place = given.problem.model.names.index("cd_a_m")
    Phi = follow(given.problem, np.array([last, *t[1:]]), first, given.chosen.max_step)[1]
    by = (Phi[1] @ Phi[0])[:6, place] * first[place] * 0.1
    assert not found[0].any()
    np.testing.assert_allclose(found[2], np.outer(by, by), rtol=1e-4, atol=1e-4 * np.abs(np.outer(by, by)).max())
