"""When the iterations end: steps that are small, steps that are rounding, and what is asked to tell them apart."""

import numpy as np
import pytest

import piazzi as pz
from piazzi.estimate import gauss_newton


def ended(monkeypatch, sizes, **changes):
    """How often a graph is iterated whose steps have these sizes, and why it stops."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    left = iter(sizes)
    monkeypatch.setattr(gauss_newton, "_size", lambda chain: next(left))
    monkeypatch.setattr(gauss_newton, "_rounding", lambda chain, solver: 2e-4)
    for name, value in changes.items():
        monkeypatch.setattr(gauss_newton, name, value)
    model = pz.Model(["x", "v"], ["v", "0"], [pz.Sensor("place", ["x"])])
    prior, noise = pz.Gaussian([0, 1], np.eye(2)), pz.ProcessNoise([0, 0.1])
    problem = pz.Problem(model, prior, noise, [pz.Station("here", "place", 1.0)])
    tracking = pz.simulate(problem, np.arange(6.0), np.random.default_rng(0))
    estimate = pz.FactorGraph().estimate(problem, tracking)
    assert estimate.success, estimate.message
    return estimate.iterations, estimate.details["stopped"]


@pytest.mark.parametrize(
    ("sizes", "iterations", "why"),
    [
        ([1.0, 8e-4, 1.6e-4, 3e-4, 1e-9], 3, "rounding"),  # by chance a fifth of the step before
        ([1.0, 8e-4, 1.6e-5, 1e-9], 4, "no step above"),  # as a step near a solution shrinks
        ([1.0, 8e-2, 4e-2, 8e-4, 7e-4], 5, "rounding"),  # slow, but too large for rounding
    ],
)
def test_small_steps_that_do_not_shrink_much_are_rounding(monkeypatch, sizes, iterations, why):
    found, stopped = ended(monkeypatch, sizes, MOST_AMPLIFIED=np.inf)
    assert found == iterations
    assert why in stopped


def test_steps_far_beyond_the_last_bits_of_the_states_are_none_of_rounding(monkeypatch):
    assert ended(monkeypatch, [1.0, 8e-4, 7e-4, 6e-4, 1e-9])[0] == 5


def test_rounding_is_not_estimated_where_it_cannot_matter(monkeypatch):
    """It costs two solutions; here the states have thirteen digits more than are known."""
    calls = []
    monkeypatch.setattr(gauss_newton, "_rounding", lambda chain, solver: calls.append(chain) or 0.0)
    for seed in range(8):
        problem, tracking = pz.load("b612-range", seed=seed)
        assert pz.FactorGraph().estimate(problem, tracking).success
    assert calls == []
