"""Whitening: what the graph divides its residuals by turns noise of any covariance into independent units."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from piazzi.kernels.fragments import decorrelate, graph_linearize, semidefinite
from tests.laws.problems import random_covariance

SEEDS = st.integers(0, 2**32 - 1)


@contextmanager
def sizes(n, m=1):
    """Fragments run uncompiled; the sizes that the generated module would give them are set here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(semidefinite, "LOST", 1e-15 * max(n, 4), raising=False)
        for module in (decorrelate, graph_linearize, semidefinite):
            patch.setattr(module, "N", n, raising=False)
            patch.setattr(module, "M", m, raising=False)
        yield


@given(n=st.integers(1, 9), rank=st.integers(0, 9), seed=SEEDS)
def test_process_noise(n, rank, seed):
    """Q = L D L^T: L^-1 makes it diagonal, and there are as many directions without noise as Q has too few."""
    rank = min(rank, n)
    Q = np.zeros((n, n)) if rank == 0 else random_covariance(np.random.default_rng(seed), n, rank if rank < n else None)
    # without pivoting, rank is seen where the states that come first are not almost determined by each other
    assume(rank == 0 or np.linalg.eigvalsh(Q[:rank, :rank])[0] > 1e-3)
    L, D = np.empty(n * n), np.empty(n)
    with sizes(n):
        graph_linearize.factor_noise(Q, SimpleNamespace(L=L, D=D))
    lower = np.tril(L.reshape(n, n), -1) + np.eye(n)
    assert_allclose(lower @ np.diag(D) @ lower.T, Q, rtol=0, atol=1e-12 * max(np.abs(Q).max(), 1e-300))
    assert np.count_nonzero(D) == rank
    W = np.linalg.inv(lower)
    some = D > 0
    white = (W @ Q @ W.T)[np.ix_(some, some)] / np.sqrt(np.outer(D[some], D[some]))
    assert_allclose(white, np.eye(rank), rtol=0, atol=1e-6 if rank < n else 1e-9)


@given(n=st.integers(1, 9), seed=SEEDS, scale=st.floats(1e-3, 1e3))
def test_cost_of_a_defect_is_the_square_of_its_whitened_length(n, seed, scale):
    rng = np.random.default_rng(seed)
    Q, defect = random_covariance(rng, n), rng.standard_normal(n)
    factor, broken, largest, total = SimpleNamespace(L=np.empty(n * n), D=np.empty(n)), np.ones(n), np.zeros(1), np.zeros(1)
    with sizes(n):
        graph_linearize.factor_noise(Q, factor)
        graph_linearize.weigh(defect, scale, factor, 0, np.eye(n).ravel(), broken, largest, total)
    white = np.linalg.solve(np.linalg.cholesky(scale * Q), defect)
    assert_allclose(total, white @ white, rtol=1e-8)
    assert largest == 0.0
    assert not broken.any()


@given(n=st.integers(1, 9), rank=st.integers(0, 9), seed=SEEDS)
def test_directions_of_an_information_matrix(n, rank, seed):
    """Rows whose squares add up to the matrix, also where it is singular: as measurements of unit noise they are it."""
    rank = min(rank, n)
    A = np.zeros((n, n)) if rank == 0 else random_covariance(np.random.default_rng(seed), n, rank if rank < n else None)
    rows = np.empty(n * n)
    with sizes(n), np.errstate(all="ignore"):  # as kernels run: a division by zero is made, and not chosen
        semidefinite.root_of(A, rows, 0)
    rows = rows.reshape(n, n)
    sigma = np.sqrt(np.diag(A))
    assert (np.abs(rows.T @ rows - A) <= 1e-13 * np.outer(sigma, sigma) + 1e-300).all()


@given(m=st.integers(1, 3), seed=SEEDS, missing=st.integers(0, 7))
def test_measurement_noise(m, seed, missing):
    """Rows of unit noise: with H = 1 the whitener itself comes out, and it takes the R of what is there to the identity."""
    rng = np.random.default_rng(seed)
    R, nu = random_covariance(rng, m), rng.standard_normal(m)
    gone = np.array([bool(missing >> i & 1) for i in range(m)])
    nu[gone] = np.nan
    given_nu, H = nu.copy(), np.eye(m).ravel()
    with sizes(m, m):
        decorrelate.decorrelate(nu, H, 0, R.ravel(), 0, np.empty(m * m))
    W, there = H.reshape(m, m), ~gone
    assert (np.isnan(nu) == gone).all()
    assert_allclose(W[there] @ R @ W[there].T, np.eye(there.sum()), rtol=0, atol=1e-12)
    assert not W[np.ix_(there, gone)].any()
    sizes_of_terms = np.abs(W[np.ix_(there, there)]) @ np.abs(given_nu[there])  # what is left of them may be small
    assert (np.abs(nu[there] - W[np.ix_(there, there)] @ given_nu[there]) <= 1e-12 * sizes_of_terms).all()
