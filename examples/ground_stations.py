"""Orbit, gravity, drag and station positions from real tracking: python examples/ground_stations.py FILE.

FILE has a row for each measurement: time [s], station, range [m], range rate [m/s].  Prints what batch least squares and the
full graph make of it, and what filters do that start from the batch solution.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import piazzi as pz

SCENARIO = Path(__file__).with_name("ground_stations.toml")


def load(path) -> tuple[pz.Problem, pz.Tracking]:
    """The scenario's problem, and the measurements of a file."""
    problem, _ = pz.load(SCENARIO)
    rows = np.loadtxt(path)
    return problem, pz.Tracking(rows[:, 0], rows[:, 2:4], [str(int(station)) for station in rows[:, 1]])


def started_from(problem: pz.Problem, estimate: pz.Estimate, widened: float) -> pz.Problem:
    """The problem with a prior around the first state of an estimate, with so many times its standard deviations."""
    model, mean = problem.model, estimate.mean[0]
    sigma = widened * np.sqrt(np.diag(estimate.covariance[0]))
    constants = {name: pz.Gaussian(mean[i], sigma[i] ** 2) for i, name in enumerate(model.names) if name in model.constants}
    states = len(model.states)
    prior = pz.Gaussian.from_sigma(mean[:states], sigma[:states])
    return replace(problem, prior=prior, parameters={**problem.parameters, **constants})


def residual_rms(problem: pz.Problem, tracking: pz.Tracking, estimate: pz.Estimate) -> np.ndarray:
    """Root mean square of measurement minus prediction of the estimate, (m,)."""
    states = np.repeat(estimate.mean, np.diff(tracking.first_row), axis=0)
    rows = zip(tracking.row_times, tracking.row_stations, tracking.values, states, strict=True)
    return np.sqrt(np.mean([(z - problem.measure(str(s), x, t)) ** 2 for t, s, z, x in rows], axis=0))


def main(path: str) -> None:
    """Estimate and print."""
    problem, tracking = load(path)
    batch = pz.BatchLeastSquares().estimate(problem, tracking)
    graph = pz.FactorGraph().estimate(problem, tracking)
    for name, estimate in (("batch", batch), ("graph", graph)):
        rms = residual_rms(problem, tracking, estimate)
        told = estimate.message or f"converged in {estimate.iterations} iterations"
        print(f"{name}: {told}; post-fit RMS {rms[0]:.4f} m, {rms[1]:.5f} m/s; {estimate.seconds:.2f} s")
    sigma = np.sqrt(np.diag(batch.covariance[0]))
    for i, name in enumerate(problem.model.names):
        print(f"  {name:7} {batch.mean[0, i]:24.12g} +- {sigma[i]:.3g}")
    close = started_from(problem, batch, 10.0)
    for name, estimator in (("ekf", pz.ExtendedKalmanFilter()), ("window:100", pz.SlidingWindow(100))):
        estimate = estimator.estimate(close, tracking)
        off = np.abs(estimate.mean[-1] - batch.mean[-1]) / np.sqrt(np.diag(batch.covariance[-1]))
        worst = problem.model.names[int(np.argmax(off))]
        print(f"{name} from there with 10 sigma: {estimate.message or 'ends'} {off.max():.2f} sigma from batch ({worst})")
    cold = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    off = np.abs(cold.mean[-1] - batch.mean[-1]) / np.sqrt(np.diag(batch.covariance[-1]))
    verdict = "passes" if cold.success and (off <= 3).all() else f"fails, {cold.message or f'{off.max():.3g} sigma from batch'}"
    print(f"ekf from the cold prior: {verdict}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
