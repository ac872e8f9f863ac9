"""Covariances of all states given all measurements: what is known of each from before it and from after it.

Forward, the chain has the covariance of each state given the measurements up to it.  Back, the information matrix of the later
ones is a sum of congruences, and is taken in as that many more measurements (Fraser and Potter 1969, without their inverses).
Rauch, Tung and Striebel divide by the predicted covariance instead, which fails silently where a system without process noise
forgets its past: P_pred turns singular.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def directions(A, rows):
    """Rows r_j with A = sum of r_j^T r_j, by Cholesky; a direction in which A is zero to rounding gives a row of zeros."""
    store(rows, 0, A)
    for j in range(N):
        whole = rows[j * N + j]
        row = load_vector(rows, j * N, N)
        for k in range(j):
            row = row - rows[k * N + j] * load_vector(rows, k * N, N)
        store(rows, j * N, row)
        pivot = rows[j * N + j]
        store(rows, j * N, (1.0 / sqrt(pivot) if pivot > 1e-15 * whole else 0.0) * row)


@inline
def information_before(first, last, nu, H, Y):
    """Information about a state with that of its own measurements added."""
    for c in range(first, last):
        if not isnan(nu[c]):
            h = load_vector(H, c * N, N)
            Y = Y + outer(h, h)
    return Y


@inline
def forget(Y, T, noise, amount):
    """Information about a state as information about the one it had been without its process noise; T collects the steps.

    One direction g of the noise at a time: (I - k g^T) Y (I - g k^T) + k k^T with k = Y g / (1 + g^T Y g).
    """
    for i in range(N):
        if noise[i * N + i] > 0.0:
            g = sqrt(amount) * load_vector(noise, i * N, N)
            u = g @ Y
            k = (1.0 / (1.0 + g @ u)) * u
            B = Y - outer(u, k)
            Y = B + outer(k, k - g @ B)
            T = T - outer(T @ g, k)
    return Y, T


@inline
def marginal_covariances(a, W, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_last, rows, g, keep_cross, covariance, cross):
    """Covariance of each state a ... a + W - 1 into its place; of state k with state k + 1 into `cross` where wanted."""
    base = first_row[a]
    store(covariance, (a + W - 1) * N * N, symmetric(P_last))
    Y = 0.0 * P_last
    directions(Q, g)
    for b in range(1, W):
        j = W - 1 - b
        k = a + j
        Y = information_before((first_row[k + 1] - base) * M, (first_row[k + 2] - base) * M, nu, H, Y)
        amount = scale[k + 1]
        if noise_varies():
            directions(noise_at(j + 1, amount, Q, Q_all), g)
            amount = 1.0
        Y, T = forget(Y, identity(N), g, amount)
        F = load_matrix(Phi, j * N * N, N, N)
        Y = symmetric(F.T @ Y @ F)
        P = load_matrix(P_pred, j * N * N, N, N)
        _, P, _ = absorb_epoch((first_row[k] - base) * M, (first_row[k + 1] - base) * M, unit(-1, N), P, nu, H)
        directions(Y, rows)
        for i in range(N):
            if rows[i * N + i] > 0.0:
                _, P, _, _, _ = update_scalar(unit(-1, N), P, load_vector(rows, i * N, N), 0.0)
        P = symmetric(P)
        store(covariance, k * N * N, P)
        if keep_cross:
            store(cross, k * N * N, P @ (T @ F).T)
