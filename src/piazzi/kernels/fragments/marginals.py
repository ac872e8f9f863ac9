"""Covariances of all states given all measurements, as sums of congruences (Rauch, Tung and Striebel, in Joseph form)."""

# ruff: noqa: F821
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def solve_semidefinite(A, B, L, X):
    """A^-1 B for symmetric A, row by row by L D L^T; a direction in which A is zero to rounding contributes nothing."""
    store(L, 0, A)
    store(X, 0, B)
    for j in range(N):
        pivot = L[j * N + j]
        for k in range(j):
            pivot = pivot - L[j * N + k] * L[j * N + k] * L[k * N + k]
        inverse = 1.0 / pivot if pivot > 1e-15 * L[j * N + j] else 0.0
        row = load_vector(X, j * N, N)
        for k in range(j):
            row = row - L[j * N + k] * load_vector(X, k * N, N)
        store(X, j * N, row)
        for i in range(j + 1, N):
            s = L[i * N + j]
            for k in range(j):
                s = s - L[i * N + k] * L[j * N + k] * L[k * N + k]
            L[i * N + j] = s * inverse
        L[j * N + j] = pivot if pivot > 1e-15 * L[j * N + j] else 0.0
    for b in range(N):
        i = N - 1 - b
        row = (1.0 / L[i * N + i] if L[i * N + i] > 0.0 else 0.0) * load_vector(X, i * N, N)
        for k in range(i + 1, N):
            row = row - L[k * N + i] * load_vector(X, k * N, N)
        store(X, i * N, row)
    return load_matrix(X, 0, N, N)


@inline
def marginal_covariances(a, W, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_last, L, X, keep_cross, covariance, cross):
    """Covariance of each state a ... a + W - 1 into its place; of state k with state k + 1 into `cross` where wanted."""
    base = first_row[a]
    P_s = P_last
    store(covariance, (a + W - 1) * N * N, symmetric(P_s))
    for b in range(1, W):
        j = W - 1 - b
        k = a + j
        P = load_matrix(P_pred, j * N * N, N, N)
        _, P, _ = absorb_epoch((first_row[k] - base) * M, (first_row[k + 1] - base) * M, unit(-1, N), P, nu, H)
        F = load_matrix(Phi, j * N * N, N, N)
        G = solve_semidefinite(load_matrix(P_pred, (j + 1) * N * N, N, N), F @ P, L, X).T
        A = identity(N) - G @ F
        if keep_cross:
            store(cross, k * N * N, G @ P_s)
        P_s = symmetric(A @ P @ A.T + G @ (noise_at(j + 1, scale[k + 1], Q, Q_all) + P_s) @ G.T)
        store(covariance, k * N * N, P_s)
