"""No result depends on what memory held before: work space and results are filled with signalling NaN, which would show."""

import numpy as np
import pytest

import piazzi as pz
from tests.laws.problems import assert_same_estimate, network

ESTIMATORS = {
    "ekf": pz.ExtendedKalmanFilter(),
    "ekf, gated": pz.ExtendedKalmanFilter(iterations=2, gate=0.999),
    "ukf": pz.UnscentedKalmanFilter(),
    "smoother": pz.Smoother(cross_covariances=True),
    "graph": pz.FactorGraph(cross_covariances=True),
    "graph, bordered": pz.FactorGraph(solver="bordered"),
    "graph, huber": pz.FactorGraph(loss="huber"),
    "window": pz.SlidingWindow(4, 2),
    "window, huber": pz.SlidingWindow(4, loss="huber"),
    "batch": pz.BatchLeastSquares(),
}


def poisoned(empty):
    """`np.empty` of which every number that is not written raises a warning, and warnings are errors."""

    def make(*args, **kwargs):
        a = empty(*args, **kwargs)
        if a.dtype == np.float64 and a.size:
            a.view(np.int64)[...] = 0x7FF4000000000001
        return a

    return make


@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimates(name, monkeypatch):
    """Stations of one, two and three components, so that rows are not full."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    noise = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4], "second", "scaled")
    problem = network(np.random.default_rng(3), process_noise=None if name == "batch" else noise)
    tracking = pz.simulate(problem, np.arange(12) * 0.2, np.random.default_rng(3))
    clean = ESTIMATORS[name].estimate(problem, tracking)
    monkeypatch.setattr(np, "empty", poisoned(np.empty))
    assert_same_estimate(ESTIMATORS[name].estimate(problem, tracking), clean, 0.0)
