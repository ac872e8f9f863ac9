"""Sliding window with a loss: `solve_window` of `window_step`, with each row weighted by its residual at the current states.

When an epoch arrives its states are only predicted, so its rows are weighted by their innovation in units of its own spread.
Where Tukey's loss rejects most of the window, Cauchy's with the same constant leads back.
"""

from piazzi.kernels.fragments.chain import predict_deviation, update_fixed_point
from piazzi.kernels.fragments.linearize_robust import weigh_row, whiten_row
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def weigh_new_rows(k, base, run, x, p, measured, chain, innovations):
    """Rows of the newest epoch, whitened, and weighted by nu^T S^-1 nu of their predictions."""
    L = scratch(WORK)
    for row in range(run.first_row[k], run.first_row[k + 1]):
        out = (row - base) * M
        squared, present = squared_innovation(row, innovations, L)
        whiten_row(row, out, run.t[k], x, p, measured, chain)
        weigh_row(row, out, squared, present, chain)


@inline
def rejects_most(first, last, chain):
    """Whether most of the rows first ... last - 1 have hardly any weight: Tukey's loss would never take them back."""
    total = 0.0
    for row in range(first, last):
        total += chain.weights[row]
    return total < 0.5 * (last - first)


@inline
def solve_window(a, k, window, run, p, measured, chain, innovations):
    """Gauss-Newton steps over the states a ... k; returns the newest state's covariance, stores the oldest's."""
    W = k - a + 1
    base = run.first_row[a]
    m, P = load_vector(window.m, 0, N), load_matrix(window.P, 0, N, N)
    P_new = P
    for iteration in range(window.iterations):
        linearize_dynamics(a, W, run, chain, p)
        linearize_rows(a, W, run, chain, p, measured)
        kind = chain.loss[0]
        if kind == 3.0 and rejects_most(run.first_row[a], run.first_row[k], chain):
            chain.loss[0] = 2.0
            linearize_rows(a, W, run, chain, p, measured)
        d = m - load_vector(chain.x, a * N, N)
        P_new = P
        P_old = P
        C = P
        for j in range(W):
            if j > 0:
                C = load_matrix(chain.Phi, (j - 1) * N * N, N, N) @ C
                d, P_new = predict_deviation(j, a + j, d, P_new, run, chain)
            P_new = symmetric(P_new)
            store(chain.d_pred, j * N, d)
            store(chain.P_pred, j * N * N, P_new)
            if iteration == 0 and a + j == k:
                newest = load_vector(chain.x, k * N, N)
                record_epoch(k, run, p, measured, newest, d, P_new, innovations)
                weigh_new_rows(k, base, run, newest, p, measured, chain, innovations)
            first = (run.first_row[a + j] - base) * M
            d, P_new, P_old, C = update_fixed_point(first, (run.first_row[a + j + 1] - base) * M, d, P_new, P_old, C, chain)
            if j == 0:  # as in `forward_fixed_point`
                C = P_new
                P_old = P_new
        chain.loss[0] = kind
        backward(a, W, run, chain, 0.0)
        for j in range(W):
            store(chain.x, (a + j) * N, load_vector(chain.x, (a + j) * N, N) + load_vector(chain.dx, j * N, N))
        if cancelled(P_old, load_matrix(chain.P_pred, 0, N, N)) == 1:
            marginal_covariances(a, W, run, chain, P_new, 0, window.delayed, window.delayed)
        else:
            store(window.delayed, a * N * N, symmetric(P_old))
    return symmetric(P_new)
