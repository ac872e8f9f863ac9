"""Orbits between the ends of steps, and their derivatives by the first state."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.determination import sweep
from piazzi.determination.determining import prepared
from piazzi.determination.guesses import Guess
from piazzi.determination.setup import follow
from piazzi.problem.dense import dense_grid, on_dense_grid, products
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
    found, now = products(Phi), np.eye(4)
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
    assert dense_grid(problem, t, step)
    x, W = sweep.swept(problem, t, first, step)
    exact, Phi = follow(problem, t, first, step)
    np.testing.assert_allclose(x[:, :3], exact[:, :3], atol=1e-5, rtol=0)
    np.testing.assert_allclose(x[:, 3:6], exact[:, 3:6], atol=1e-8, rtol=0)
    np.testing.assert_array_equal(x[:, 6:], exact[:, 6:])
    now = np.eye(len(first))
    for one, step_on in zip(W[1:], Phi, strict=True):
        now = step_on @ now
        assert (np.abs(one - now) <= 1e-7 * np.abs(now).max(axis=1, keepdims=True)).all()
    far = 4.0 * t  # steps of four minutes, in which the edges of shadows are lost to a grid
    assert not dense_grid(problem, far, 4 * step) and sweep._smooth(problem)
    short = t[:20]
    np.testing.assert_array_equal(sweep.swept(problem, short, first, step)[0], follow(problem, short, first, step)[0])


LOW = np.array([6.9e6, 0.0, 0.0, 0.0, 1.2e3, 7.505e3])
TRANSFER = np.array([6.7e6, 0.0, 0.0, 0.0, 9.3e3, 3.9e3])


@pytest.mark.parametrize("orbit", [LOW, TRANSFER], ids=["low", "transfer"])
def test_a_grid_is_as_near_to_the_orbit_as_measurements_can_see(orbit):
    """Against steps of order 8 an eighth as long: at epochs within steps, a millimetre in eight hours, and its rate."""
    t = np.unique(np.concatenate([start + np.arange(0.0, 400.0, 3.3) for start in (0.0, 12000.0, 28400.0)]))
    made = prepared(observations(np.tile(orbit[:3], (3, 1)), t[:3], 10.0), guess=Guess(EPOCH, orbit[:3], orbit[3:], "test"))
    problem, first, step = made.problem, made.states[0], made.chosen.max_step
    x, W = on_dense_grid(problem, t, first, dense_grid(problem, t, step))
    exact, Phi = follow(problem, t, first, step / 8)
    np.testing.assert_allclose(x[:, :3], exact[:, :3], atol=1e-3, rtol=0)
    np.testing.assert_allclose(x[:, 3:6], exact[:, 3:6], atol=1e-6, rtol=0)
    # the edges of the half-shadow leave 2e-5 between lengths of steps of order 8
    assert (np.abs(W - products(Phi)) <= 1e-5 * np.abs(W).max(axis=2, keepdims=True)).all()


def test_graph_and_batch_find_on_the_grid_what_the_graph_finds_state_by_state():
    """Within a thousandth of a sigma, covariances and innovations too, and the same bits again."""
    t = np.concatenate([start + np.arange(0.0, 400.0, 5.0) for start in (0.0, 6000.0)])
    guess = Guess(EPOCH, LOW[:3], LOW[3:], "test")
    made = prepared(observations(np.tile(LOW[:3], (len(t), 1)), t, 10.0), guess=guess)
    path = follow(made.problem, t, made.states[0], made.chosen.max_step)[0]
    tracking = made.tracking
    values = path[:, :3] + 10.0 * np.random.default_rng(1).standard_normal((len(t), 3))
    tracking = pz.Tracking(tracking.row_times, values, tracking.row_stations, epoch=tracking.epoch)
    begun = follow(made.problem, t, made.states[0] + [30.0, 20.0, 10.0, 0.03, 0.02, 0.01, *[0.0] * (path.shape[1] - 6)], 30.0)[
        0
    ]
    graph, batch = pz.FactorGraph(start=begun), pz.BatchLeastSquares(start=begun[0], tolerance=1e-4)
    alone = pz.FactorGraph(start=begun, solver="chain").estimate(made.problem, tracking)
    sigma = np.sqrt(np.diagonal(alone.covariance, axis1=1, axis2=2))
    unit = sigma[:, :, None] * sigma[:, None]
    assert alone.success
    for estimator in (graph, batch):
        found = estimator.estimate(made.problem, tracking)
        assert found.success, found.message
        assert found.details["grid_step"] < made.chosen.max_step
        assert (np.abs(found.mean - alone.mean) <= 1e-3 * sigma).all()
        np.testing.assert_allclose(found.covariance / unit, alone.covariance / unit, rtol=0, atol=1e-3)
        np.testing.assert_allclose(found.innovations, alone.innovations, rtol=0, atol=1e-2)
        np.testing.assert_array_equal(found.mean, estimator.estimate(made.problem, tracking).mean)
