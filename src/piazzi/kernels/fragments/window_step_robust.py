"""Sliding window with a loss: `settle` of `window_step`, with each row weighted by its residual at the current states.

When an epoch arrives its states are only predicted, so its rows are weighted by their innovation in units of its own spread.
Where Tukey's loss has disowned most of the window, Cauchy's with the same constant leads back.
"""

from piazzi.kernels.fragments.chain import follow_epoch
from piazzi.kernels.fragments.linearize_robust import weigh_row, whiten_row
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def weigh_new_rows(k, base, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work, innovation, spread):
    """Rows of the newest epoch, whitened, and weighted by nu^T S^-1 nu of their predictions."""
    state = load_vector(x, k * N, N)
    for row in range(first_row[k], first_row[k + 1]):
        out = (row - base) * M
        squared, present = surprise(row, innovation, spread, work)
        whiten_row(row, out, k, t, state, z, station, sensor, numbers, R, correlated, p, nu, H, work)
        weigh_row(row, out, squared, present, nu, H, work)


@inline
def disowned(first, last, work):
    """Whether most of the rows first ... last - 1 have hardly any weight: Tukey's loss would never take them back."""
    total = 0.0
    for row in range(first, last):
        total += work[M * (M + N) + 2 + M + row]
    return total < 0.5 * (last - first)


@inline
def settle(
    a,
    k,
    iterations,
    t,
    count,
    scale,
    first_row,
    z,
    station,
    sensor,
    numbers,
    R,
    correlated,
    p,
    Q,
    m,
    P,
    f,
    Phi,
    Q_all,
    nu,
    H,
    d_pred,
    P_pred,
    gains,
    multiplier,
    dx,
    nu_row,
    H_row,
    work,
    tether,
    x,
    oldest_covariance,
    innovation,
    innovation_covariance,
):
    """Gauss-Newton steps over the states a ... k; returns the newest state's covariance, stores the oldest's."""
    W = k - a + 1
    base = first_row[a]
    P_new = P
    for iteration in range(iterations):
        linearize_dynamics(a, W, t, count, scale, p, Q, x, f, Phi, Q_all)
        linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
        kind = work[M * (M + N)]
        if kind == 3.0 and disowned(first_row[a], first_row[k], work):
            work[M * (M + N)] = 2.0
            linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
        d = m - load_vector(x, a * N, N)
        P_new = P
        P_old = P
        C = P
        for j in range(W):
            if j > 0:
                F = load_matrix(Phi, (j - 1) * N * N, N, N)
                C = F @ C
                P_new = F @ P_new @ F.T + noise_at(j, scale[a + j], Q, Q_all)
                d = F @ d + (load_vector(f, (j - 1) * N, N) - load_vector(x, (a + j) * N, N))
            P_new = symmetric(P_new)
            store(d_pred, j * N, d)
            store(P_pred, j * N * N, P_new)
            if iteration == 0 and a + j == k:
                newest = load_vector(x, k * N, N)
                record_epoch(
                    k,
                    t,
                    first_row,
                    z,
                    station,
                    sensor,
                    numbers,
                    R,
                    p,
                    newest,
                    d,
                    P_new,
                    nu_row,
                    H_row,
                    innovation,
                    innovation_covariance,
                )
                weigh_new_rows(
                    k,
                    base,
                    t,
                    x,
                    first_row,
                    z,
                    station,
                    sensor,
                    numbers,
                    R,
                    correlated,
                    p,
                    nu,
                    H,
                    work,
                    innovation,
                    innovation_covariance,
                )
            first = (first_row[a + j] - base) * M
            d, P_new, P_old, C = follow_epoch(first, (first_row[a + j + 1] - base) * M, d, P_new, P_old, C, nu, H)
            if j == 0:  # as in `forward_following`
                C = P_new
                P_old = P_new
        work[M * (M + N)] = kind
        backward(a, W, first_row, Phi, nu, H, 0.0, tether, d_pred, P_pred, gains, multiplier, dx)
        for j in range(W):
            store(x, (a + j) * N, load_vector(x, (a + j) * N, N) + load_vector(dx, j * N, N))
        if cancelled(P_old, load_matrix(P_pred, 0, N, N)) == 1:
            marginal_covariances(a, W, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_new, 0, oldest_covariance, tether)
        else:
            store(oldest_covariance, a * N * N, symmetric(P_old))
    return symmetric(P_new)
