"""A filter that knows the truth's statistics is as wrong as it says: NEES = n and NIS = m over many matched linear runs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.problems import linear, random_covariance, random_stable
from tests.references.chi_square import mean_bounds

pytestmark = pytest.mark.usefixtures("uncompiled")

RUNS, EPOCHS = 400, 6
ONE_IN_A_MILLION = 1e-6  # a fixed seed and bounds this wide: a failure is a fault


def mahalanobis(errors, covariances):
    return np.einsum("...i,...i", errors, np.linalg.solve(covariances, errors[..., None])[..., 0])


def problem_of(rng, n, m, rank):
    H, R = [rng.standard_normal((m, n))], [random_covariance(rng, m)]
    prior = pz.Gaussian(rng.standard_normal(n), random_covariance(rng, n))
    return linear(random_stable(rng, n), H, R, random_covariance(rng, n, rank), prior, prior_time=-1.0)


@pytest.mark.parametrize(("n", "m", "rank"), [(1, 1, 1), (3, 2, 3), (4, 3, 2), (2, 1, 0)])
def test_errors_and_innovations_are_as_large_as_the_filter_says(n, m, rank):
    rng = np.random.default_rng(1000 * n + m)
    problem, nees, nis = problem_of(rng, n, m, rank), [], []
    for _ in range(RUNS):
        tracking = pz.simulate(problem, np.arange(float(EPOCHS)), rng)
        estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
        nees.append(mahalanobis(estimate.mean - tracking.truth, estimate.covariance))
        nis.append(mahalanobis(estimate.innovations, estimate.innovation_covariances))
    for values, degrees in ((np.mean(nees, axis=0), n), (np.mean(nis, axis=0), m)):
        low, high = mean_bounds(degrees, RUNS, ONE_IN_A_MILLION)
        assert values.shape == (EPOCHS,)
        assert (low < values).all()
        assert (values < high).all()
    # innovations are white: those of one epoch say nothing about those of the next
    low, high = mean_bounds(m, RUNS * EPOCHS, ONE_IN_A_MILLION)
    assert low < np.mean(nis) < high


def test_overconfidence_would_be_seen():
    """The same bounds refuse a filter that believes in half the noise."""
    rng = np.random.default_rng(4)
    problem = problem_of(rng, 2, 1, 2)
    believed = pz.Problem(
        problem.model, problem.prior, problem.process_noise,
        [pz.Station("station0", "sensor0", problem.stations[0].noise / 4, problem.stations[0].numbers)],
        problem.parameters, prior_time=-1.0,
    )  # fmt: skip
    nis = []
    for _ in range(RUNS):
        estimate = pz.ExtendedKalmanFilter().estimate(believed, pz.simulate(problem, np.arange(float(EPOCHS)), rng))
        nis.append(mahalanobis(estimate.innovations, estimate.innovation_covariances))
    assert np.mean(nis) > mean_bounds(1, RUNS * EPOCHS, ONE_IN_A_MILLION)[1]


def test_chi_square_bounds_hold_for_chi_squares():
    """The oracle itself, by Monte Carlo."""
    rng = np.random.default_rng(0)
    for degrees in (1, 3):
        means = rng.chisquare(degrees, (4000, RUNS)).mean(axis=1)
        low, high = mean_bounds(degrees, RUNS, 0.1)
        assert_allclose(((means < low) | (means > high)).mean(), 0.1, atol=0.02)
