"""Linear-Gaussian problems of every size: the textbook Kalman filter, and what must not matter to it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import piazzi as pz
from tests.laws.problems import assert_same_estimate, linear, random_covariance, random_stable
from tests.references import textbook
from tests.references.van_loan import discretize

pytestmark = pytest.mark.usefixtures("uncompiled")

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 9)
WIDTHS = st.integers(1, 3)
UPDATES = st.sampled_from(["joint", "components"])


class Case:
    """A random linear problem, its matrices, and a tracking with several stations at irregular epochs."""

    def __init__(self, n, widths, seed, *, diagonal=False, missing=0.0, epochs=6):
        rng = np.random.default_rng(seed)
        self.A, self.Q = random_stable(rng, n), random_covariance(rng, n, rank=n // 2)
        self.H = [rng.standard_normal((m, n)) for m in widths]
        self.R = [np.diag(rng.uniform(0.1, 2, m)) if diagonal else random_covariance(rng, m) for m in widths]
        self.prior = pz.Gaussian(rng.standard_normal(n), random_covariance(rng, n))
        self.problem = linear(self.A, self.H, self.R, self.Q, self.prior)
        epoch = np.arange(epochs, dtype=float)
        present = [sorted(rng.choice(len(widths), rng.integers(1, len(widths) + 1), replace=False)) for _ in epoch]
        self.row_times = np.repeat(epoch, [len(p) for p in present])
        self.row_station = np.concatenate(present)
        self.values = rng.standard_normal((len(self.row_times), max(widths)))
        for row, s in zip(self.values, self.row_station, strict=True):
            row[widths[s] :] = np.nan
            row[: widths[s]][rng.random(widths[s]) < missing] = np.nan
        self.values[0, 0] = 1.0
        self.epoch = epoch

    def tracking(self, order=None, values=None):
        order = np.arange(len(self.row_times)) if order is None else order
        values = self.values if values is None else values
        return pz.Tracking(self.row_times[order], values[order], [f"station{s}" for s in self.row_station[order]])

    def estimate(self, update="auto", **kwargs):
        return pz.ExtendedKalmanFilter(update).estimate(self.problem, self.tracking(**kwargs))

    def textbook(self):
        rows = [
            [
                textbook.Row(z[: len(self.H[s])], lambda x, s=s: self.H[s] @ x, lambda x, s=s: self.H[s], self.R[s])
                for z, s in zip(self.values[self.row_times == t], self.row_station[self.row_times == t], strict=True)
            ]
            for t in self.epoch
        ]
        return textbook.extended_kalman_filter(
            self.prior.mean,
            self.prior.covariance,
            self.epoch,
            rows,
            lambda x, t, dt: (self.A @ x, self.A),
            lambda t, dt: self.Q,
        )


@given(SIZES, st.lists(WIDTHS, min_size=1, max_size=3), SEEDS, UPDATES)
@settings(max_examples=40)
def test_filter_is_the_textbook_kalman_filter(n, widths, seed, update):
    """Any number of states, several stations with sensors of different widths, full R, singular Q, missing components."""
    case = Case(n, widths, seed, missing=0.3)
    assert_same_estimate(case.estimate(update), case.textbook(), 1e-9)


@given(SIZES, st.integers(2, 3), SEEDS)
@settings(max_examples=30)
def test_components_equal_joint(n, m, seed):
    """With a full R and with some of the components missing."""
    case = Case(n, [m, 1], seed, missing=0.4)
    joint, components = case.estimate("joint"), case.estimate("components")
    assert_same_estimate(components, joint, 1e-9)
    assert_allclose(components.innovations, joint.innovations, rtol=1e-9, atol=1e-9)
    assert_allclose(components.innovation_covariances, joint.innovation_covariances, rtol=1e-9, atol=1e-9)


@given(SIZES, st.lists(WIDTHS, min_size=2, max_size=3), SEEDS, UPDATES)
@settings(max_examples=30)
def test_rows_of_one_epoch_commute(n, widths, seed, update):
    case = Case(n, widths, seed, missing=0.2)
    rng = np.random.default_rng(seed)
    order = np.concatenate([rng.permutation(np.flatnonzero(case.row_times == t)) for t in case.epoch])
    straight, permuted = case.estimate(update), case.estimate(update, order=order)
    assert_same_estimate(permuted, straight, 1e-9)
    assert_allclose(permuted.innovations, straight.innovations[order], rtol=1e-9, atol=1e-9)


@given(SIZES, WIDTHS, SEEDS, UPDATES)
@settings(max_examples=30)
def test_missing_measurement_is_the_limit_of_infinite_noise(n, m, seed, update):
    """A component without a value counts as one whose noise is beyond all bounds and independent of the others'."""
    case = Case(n, [m], seed, missing=0.4, diagonal=True)
    missing = case.estimate(update)
    gone = np.isnan(case.values)
    rows = []
    for k, t in enumerate(case.epoch):
        R = case.R[0].copy()
        R[gone[k], gone[k]] = 1e13
        z = np.where(gone[k], 0.0, case.values[k])
        rows.append([textbook.Row(z, lambda x: case.H[0] @ x, lambda x: case.H[0], R)])
        assert t == k
    run = textbook.extended_kalman_filter(
        case.prior.mean, case.prior.covariance, case.epoch, rows, lambda x, t, dt: (case.A @ x, case.A), lambda t, dt: case.Q
    )
    assert_same_estimate(missing, run, 1e-5)
    assert np.isnan(missing.innovations[gone]).all()
    assert np.isfinite(missing.innovations[~gone]).all()


@given(SIZES, SEEDS, UPDATES)
@settings(max_examples=15)
def test_an_epoch_without_any_value_is_a_prediction(n, seed, update):
    case = Case(n, [2], seed)
    values = case.values.copy()
    values[3] = np.nan
    estimate = case.estimate(update, values=values)
    unit = np.sqrt(np.diag(estimate.covariance[3]))
    assert_allclose(estimate.mean[3] / unit, case.A @ estimate.mean[2] / unit, rtol=1e-12, atol=1e-12)
    assert_allclose(estimate.covariance[3], case.A @ estimate.covariance[2] @ case.A.T + case.Q, rtol=1e-12, atol=1e-12)


@given(SIZES, st.lists(WIDTHS, min_size=1, max_size=2), SEEDS, UPDATES)
@settings(max_examples=20)
def test_covariances_are_symmetric_and_semidefinite(n, widths, seed, update):
    P = Case(n, widths, seed, missing=0.1).estimate(update).covariance
    assert (P.transpose(0, 2, 1) == P).all()
    assert np.linalg.eigvalsh(P).min() >= -1e-14 * np.abs(P).max()


@given(st.integers(1, 4), SEEDS, UPDATES)
@settings(max_examples=15)
def test_known_states_stay_known(n, seed, update):
    """A prior without doubt and no process noise: measurements change nothing."""
    rng = np.random.default_rng(seed)
    A, x = random_stable(rng, n), rng.standard_normal(n)
    problem = linear(A, [rng.standard_normal((2, n))], [np.eye(2)], np.zeros((n, n)), pz.Gaussian(x, np.zeros((n, n))))
    estimate = pz.ExtendedKalmanFilter(update).estimate(problem, pz.Tracking(np.arange(3.0), rng.standard_normal((3, 2))))
    assert estimate.success, estimate.message
    assert_allclose(estimate.mean, [x, A @ x, A @ A @ x], rtol=1e-12, atol=1e-13)
    assert not estimate.covariance.any()


@given(st.integers(1, 5), SEEDS)
@settings(max_examples=8)
def test_continuous_linear_problem_at_irregular_times(n, seed):
    """RK4 in small steps and the integrated process noise, from a prior before the first epoch: exact discretisation."""
    rng = np.random.default_rng(seed)
    A, Q, H = 2 * random_stable(rng, n) - np.eye(n), random_covariance(rng, n, rank=1), rng.standard_normal((2, n))
    R, prior = random_covariance(rng, 2), pz.Gaussian(rng.standard_normal(n), random_covariance(rng, n))
    problem = linear(
        A, [H], [R], Q, prior, discrete=False, per="second", integrator=pz.RungeKutta4(max_step=0.02), prior_time=-0.25
    )
    times, z = np.cumsum(rng.uniform(0.02, 0.4, 5)), rng.standard_normal((5, 2))
    rows = [[textbook.Row(v, lambda x: H @ x, lambda x: H, R)] for v in z]

    def step(x, t, dt):
        Phi, _ = discretize(A, Q, dt)
        return Phi @ x, Phi

    run = textbook.extended_kalman_filter(
        prior.mean, prior.covariance, times, rows, step, lambda t, dt: discretize(A, Q, dt)[1], start=-0.25
    )
    assert_same_estimate(pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking(times, z)), run, 1e-6)
