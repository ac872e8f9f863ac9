"""Vector lanes change rounding and nothing else: the laws' problems by every estimator that uses lanes, and runs of studies.

With PIAZZI_LANES=1 the same is asked of every estimate that any of the laws makes (`conftest.py`).  The extended and the
square-root Kalman filter and `simulate` have no kernels in lanes.  Nor has uncompiled code.
"""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.study.ensemble import Layout, filter_runs, simulate_runs
from tests.laws.graphs import LinearCase, passes, spacecraft
from tests.laws.lanes import (
    assert_rounding,
    compared,
    kernels_used,
    lanes,
    products,
    sigmas,
    wide,
    work_in_lanes,
    worst,
)
from tests.laws.problems import b612, network, satellite

SCALED = pz.ProcessNoise([0.0, 0.0, 1e-4, 1e-4], "second", "scaled")


def bearings():
    problem = satellite(pz.Taylor(max_step=1.0))
    return problem, pz.simulate(problem, np.arange(61) * 15.0, np.random.default_rng(5))


def mixed_substeps():
    """States next to each other with different numbers of substeps do not go together."""
    problem = satellite(pz.Taylor(max_step=1.0))
    gaps = np.random.default_rng(0).choice([15.0, 15.0, 15.0, 8.0], 61)
    return problem, pz.simulate(problem, np.cumsum(gaps), np.random.default_rng(5))


def ranges():
    problem = b612()
    return problem, pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(7))


def ranges_without_noise():
    problem = b612((0.0, 0.0, 0.0, 0.0))
    return problem, pz.simulate(problem, np.arange(100) * 0.1, np.random.default_rng(7))


def stations():
    problem = network(np.random.default_rng(3), process_noise=SCALED)
    return problem, pz.simulate(problem, np.arange(42) * 0.2, np.random.default_rng(3))


def passes_with_a_bias():
    """Time-dependent thrust, an estimated constant, missing components."""
    problem = spacecraft(process_noise=SCALED, integrator=pz.RungeKutta4(3))
    return problem, passes(problem)


def matrices():
    """A transition matrix that depends on no state."""
    case = LinearCase(3, (2, 1), seed=5, epochs=40)
    return case.problem, case.tracking


SATELLITE = [bearings, mixed_substeps]
PLANET = [ranges, ranges_without_noise]
CASES = [*SATELLITE, *PLANET, stations, passes_with_a_bias, matrices]
ESTIMATORS = {
    "graph": (pz.FactorGraph(cross_covariances=True), CASES),
    "bank": (pz.FactorGraph(pz.Bank(4)), CASES),
    "graph, huber": (pz.FactorGraph(loss="huber"), CASES),
    # each of these has a kernel of its own for every model
    "window": (pz.SlidingWindow(20), [*SATELLITE, *PLANET, stations, passes_with_a_bias]),
    "window of 7, thrice": (pz.SlidingWindow(7, 3), [*SATELLITE, *PLANET, stations, passes_with_a_bias]),
    "window, huber": (pz.SlidingWindow(10, loss="huber"), SATELLITE),
    "batch": (pz.BatchLeastSquares(), [bearings, *PLANET, passes_with_a_bias]),
    "smoother": (pz.Smoother(cross_covariances=True), [bearings, ranges_without_noise]),
    "ukf": (pz.UnscentedKalmanFilter(), SATELLITE),
}
FAST = {(case, name) for case in SATELLITE for name in ("graph", "window")}


@pytest.mark.parametrize(
    ("case", "name"),
    [
        pytest.param(case, name, id=f"{case.__name__}, {name}", marks=() if (case, name) in FAST else pytest.mark.slow)
        for name, (_, cases) in ESTIMATORS.items()
        for case in cases
    ],
)
def test_estimates(case, name):
    estimator, _ = ESTIMATORS[name]
    assert compared(estimator.estimate, *case()).in_lanes


def lived(problem, tracking):
    """A live window's estimates after each row, of which every ninth comes five rows late."""
    window = pz.SlidingWindow(12).start(problem)
    order = np.argsort(np.arange(len(tracking.values)) + 5.5 * (np.arange(len(tracking.values)) % 9 == 4), kind="stable")
    mean, covariance, nu, S = [], [], [], []
    for row in order:
        assert window.update(problem.stations[0].name, tracking.values[row], tracking.row_times[row])
        mean.append(window.mean)
        covariance.append(window.covariance)
        nu.append(window.innovation)
        S.append(window.innovation_covariance)
    return pz.Estimate(problem, tracking, *map(np.array, (mean, covariance, nu, S)), len(order), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("case", SATELLITE)
def test_a_live_window(case):
    assert compared(lived, *case()).in_lanes


# ---- runs of a study -------------------------------------------------------------------------------------------------

RUNS = 11  # which no number of lanes divides


def drawn(problem, times):
    """First states and unit draws of process and measurement noise."""
    rng = np.random.default_rng(0)
    rows = len(times) * len(problem.stations)
    first = problem.mean + 0.1 * rng.standard_normal((RUNS, problem.model.n)) @ np.linalg.cholesky(problem.covariance).T
    return (
        first,
        rng.standard_normal((RUNS, len(times), problem.model.n)),
        rng.standard_normal((RUNS, rows, problem.model.width)),
    )


def apart_in_truth(a, b):
    """How far true states and measurements of runs are from those of others, as a part of the largest value of a run."""
    (truth, z), (truth_b, z_b) = a, b
    seen = np.abs(z_b).max(axis=1, where=~np.isnan(z_b), initial=0.0)
    return {"truth": worst(truth, truth_b, np.abs(truth_b).max(axis=1)[:, None]), "measurements": worst(z, z_b, seen[:, None])}


def apart_in_estimate(a, b):
    (mean, P, scores), (mean_b, P_b, scores_b) = a, b
    s = sigmas(P_b)
    units = {
        "squared": scores_b.spread,
        "spread": scores_b.spread,
        "nees": np.maximum(scores_b.nees, mean.shape[1]),
        "nis": np.maximum(scores_b.nis, 1.0),
        "lowest": 1.0,  # a pivot of correlations
    }
    found = {"mean": worst(mean, mean_b, np.maximum(np.abs(mean_b), s)), "covariance": worst(P, P_b, products(s))}
    return found | {what: worst(getattr(scores, what), getattr(scores_b, what), unit) for what, unit in units.items()}


@pytest.mark.slow
@pytest.mark.parametrize(("case", "at_truth"), [(bearings, False), (bearings, True), (ranges, False), (stations, False)])
def test_runs_of_a_study(case, at_truth):
    problem, tracking = case()
    problem, times = replace(problem, truth=None), tracking.times[:40]
    draws = drawn(problem, times)

    def simulated(p, first, w, v):
        return simulate_runs(Layout(p, times), p, first, w, v)

    def filtered(p, truth, z):
        return filter_runs(Layout(p, times), z, truth, at_truth=at_truth)

    with lanes(1):
        runs = simulated(problem, *draws)
        estimates = filtered(problem, *runs)
    with lanes(wide()), kernels_used() as specs:
        runs_in_ensemble = simulated(problem, *draws)
        estimates_in_lanes = filtered(problem, *runs)
    assert work_in_lanes(specs)

    assert_rounding(apart_in_truth(runs_in_ensemble, runs))
    assert_rounding(apart_in_estimate(estimates_in_lanes, estimates))
