"""The full factor graph, what depends on sizes only: solution of the linearised chain, covariances.

Python decides about steps in between.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def graph_solve(
    K: int,
    scale: Array,
    first_row: Indices,
    Q: Array,
    m: Array,
    P0: Array,
    x: Array,
    f: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    tether: Array,
    d_pred: Array,
    P_pred: Array,
    P_last: Array,
    gains: Array,
    multiplier: Array,
    dx: Array,
    report: Array,
    damping: float,
) -> None:
    m_now = load_vector(m, 0, N)
    P_first = load_matrix(P0, 0, N, N)
    _, P, fit = forward(
        0, K, x, scale, first_row, Q_matrix(Q), Q_all, f, Phi, nu, H, m_now, P_first, damping, tether, d_pred, P_pred
    )
    store(P_last, 0, P)
    report[5] = fit
    backward(0, K, first_row, Phi, nu, H, damping, tether, d_pred, P_pred, gains, multiplier, dx)
    report[4] = 0.0
    for k in range(K):
        for c in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[c]):
                change = load_vector(H, c * N, N) @ load_vector(dx, k * N, N)
                report[4] += change * change
    largest = 0.0
    for j in range(K):
        for i in range(N):
            sigma2 = P_pred[(j * N + i) * N + i]
            step = dx[j * N + i] * dx[j * N + i]
            if sigma2 > 0.0:
                largest = maximum(largest, step / sigma2)
            elif step > 0.0:
                largest = inf
            if isnan(step):
                largest = inf
    report[6] = sqrt(largest)


@entry
def graph_marginals(
    K: int,
    scale: Array,
    first_row: Indices,
    Q: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    P_pred: Array,
    P_last: Array,
    keep_cross: int,
    dx: Array,
    covariance: Array,
    cross: Array,
    report: Array,
) -> None:
    last = load_matrix(P_last, 0, N, N)
    marginal_covariances(0, K, scale, first_row, Q_matrix(Q), Q_all, Phi, nu, H, P_pred, last, keep_cross, covariance, cross)
    largest = 0.0
    for j in range(K):
        for i in range(N):
            sigma2 = covariance[(j * N + i) * N + i]
            if sigma2 > 0.0:
                largest = maximum(largest, dx[j * N + i] * dx[j * N + i] / sigma2)
    report[7] = sqrt(largest)


@entry
def graph_probe(K: int, first_row: Indices, nu: Array, H: Array, P_pred: Array, report: Array) -> None:
    widest = 0.0
    for k in range(K):
        P = load_matrix(P_pred, k * N * N, N, N)
        for i in range(first_row[k] * M, first_row[k + 1] * M):
            if not isnan(nu[i]):
                h = load_vector(H, i * N, N)
                S = h @ (h @ P)
                widest = inf if isnan(S) else maximum(widest, S)
    report[8] = widest
