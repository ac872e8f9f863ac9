"""Batch least squares: the graph without process noise, and the textbook's differential correction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.graphs import LinearCase
from tests.laws.problems import assert_same_estimate, b612, satellite
from tests.references import dense

CALM = (0.0, 0.0, 0.0, 0.0)


def founding():
    times = {"satellite": np.arange(300) * 15.0, "b612": np.arange(100) * 0.1}
    problems = {"satellite": satellite(process_noise=pz.ProcessNoise(CALM, "second", "scaled")), "b612": b612(CALM)}
    return [(problems[name], times[name], seed) for name in problems for seed in (0, 1)]


@pytest.mark.parametrize(("problem", "times", "seed"), founding(), ids=["satellite 0", "satellite 1", "b612 0", "b612 1"])
def test_batch_is_the_graph_without_process_noise(problem, times, seed):
    tracking = pz.simulate(problem, times, np.random.default_rng(seed))
    batch, graph = (e.estimate(problem, tracking) for e in (pz.BatchLeastSquares(), pz.FactorGraph(solver="chain")))
    assert batch.success, batch.message
    assert graph.success, graph.message
    assert batch.view == "delayed"
    assert_same_estimate(batch, graph, 1e-4)
    assert_allclose(batch.details["cost"], graph.details["cost"], rtol=1e-9)


@pytest.mark.usefixtures("uncompiled")
@given(st.integers(1, 6), st.lists(st.integers(1, 3), min_size=1, max_size=2), st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_batch_is_dense_least_squares(n, widths, seed):
    case = LinearCase(n, widths, seed, rank=0)
    estimate = pz.BatchLeastSquares().estimate(case.problem, case.tracking)
    oracle = dense.smooth(*case.chain)
    assert estimate.success, estimate.message
    assert_same_estimate(estimate, oracle, 1e-7)


def test_process_noise_is_left_out():
    calm = b612(CALM)
    tracking = pz.simulate(calm, np.arange(100) * 0.1, np.random.default_rng(3))
    with_noise = pz.BatchLeastSquares().estimate(b612((0.0, 0.0, 0.01, 0.01)), tracking)
    assert_same_estimate(with_noise, pz.BatchLeastSquares().estimate(calm, tracking), 1e-12)


def test_start_far_off_is_brought_home_by_the_graph():
    """Differential correction does not come home from the far side of the planet; the result says what helped."""
    problem = b612(CALM)
    for seed in range(3):
        tracking = pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(seed))
        far = pz.BatchLeastSquares(start=[0.0, -12.0, 9.0, 0.0]).estimate(problem, tracking)
        assert far.success, far.message
        assert far.details["start"] == "given, then graph"
        close = pz.BatchLeastSquares(start=[11.0, 0.0, 0.0, 10.0]).estimate(problem, tracking)
        assert close.success, close.message
        assert close.details["start"] == "given"
        assert close.iterations <= 8
        assert_same_estimate(far, close, 1e-3)


def test_prior_before_the_first_measurement():
    problem = replace(b612(CALM), prior_time=-0.5)
    tracking = pz.simulate(problem, np.arange(60) * 0.1, np.random.default_rng(0))
    batch, graph = (e.estimate(problem, tracking) for e in (pz.BatchLeastSquares(), pz.FactorGraph()))
    assert batch.success, batch.message
    assert batch.mean.shape == (60, 4)
    assert_same_estimate(batch, graph, 1e-4)


def test_bad_settings_and_starts():
    for settings_, told in (({"max_iterations": 0}, "max_iterations is 0"), ({"tolerance": -1.0}, "tolerance is -1.0")):
        with pytest.raises(ValueError, match=told):
            pz.BatchLeastSquares(**settings_)
    problem = b612(CALM)
    tracking = pz.simulate(problem, np.arange(5) * 0.1, np.random.default_rng(0))
    for start in ([1.0, 2.0], [1.0, 2.0, 3.0, np.nan]):
        with pytest.raises(ValueError, match=r"start has shape .* it must be \(4,\) \(x, y, vx, vy\), and finite"):
            pz.BatchLeastSquares(start=start).estimate(problem, tracking)
