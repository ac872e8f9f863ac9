"""Orbits between the ends of steps, and their derivatives by the first state."""

import numpy as np
import pytest

from piazzi.determination import sweep
from piazzi.determination.determining import prepared
from piazzi.determination.guesses import Guess
from piazzi.determination.setup import follow
from tests.determination.fixing import EPOCH, STATE, observations


def test_a_polynomial_of_degree_7_and_its_rates_are_exact():
    rng = np.random.default_rng(0)
    h, c = 28.0, rng.normal(size=(8, 3))
    at = np.arange(9.0)

    def ends(s):
        powers = s[:, None] ** np.arange(8)
        slopes = np.arange(8) * s[:, None] ** np.maximum(np.arange(8) - 1, 0)
        return np.stack([powers @ c, slopes @ c / h], axis=1)

    s = rng.uniform(0.0, 8.0, 50)
    np.testing.assert_allclose(sweep._between(ends(at), s, h), ends(s), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("many", [0, 1, 2, 7, 50])
def test_products_of_transition_matrices(many):
    Phi = np.eye(4) + 0.1 * np.random.default_rng(many).normal(size=(many, 4, 4))
    found, now = sweep.products(Phi), np.eye(4)
    assert len(found) == many + 1
    for one, expected in zip(found, [None, *Phi], strict=True):
        now = now if expected is None else expected @ now
        np.testing.assert_allclose(one, now, rtol=1e-10, atol=1e-12)


def test_epochs_within_steps_are_those_of_steps_to_each():
    """Passes of seconds: as by one step to each epoch, in fewer steps; where there are fewer epochs than steps it is that."""
    step, passes = 60.0, [0.0, 3000.0, 9000.0]
    t = np.concatenate([start + np.arange(0.0, 600.0, 4.0) for start in passes])
    made = prepared(observations(np.tile(STATE[:3], (3, 1)), t[:3], 10.0), guess=Guess(EPOCH, STATE[:3], STATE[3:], "test"))
    problem, first = made.problem, made.states[0]
    assert sweep._smooth(problem)
    x, W = sweep.swept(problem, t, first, step)
    exact, Phi = follow(problem, t, first, step)
    np.testing.assert_allclose(x[:, :3], exact[:, :3], atol=1e-5, rtol=0)
    np.testing.assert_allclose(x[:, 3:6], exact[:, 3:6], atol=1e-8, rtol=0)
    np.testing.assert_array_equal(x[:, 6:], exact[:, 6:])
    now = np.eye(len(first))
    for one, step_on in zip(W[1:], Phi, strict=True):
        now = step_on @ now
        assert (np.abs(one - now) <= 1e-7 * np.abs(now).max(axis=1, keepdims=True)).all()
    sparse = t[::150]
    np.testing.assert_array_equal(sweep.swept(problem, sparse, first, step)[0], follow(problem, sparse, first, step)[0])
