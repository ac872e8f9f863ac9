"""The fixed-interval smoother: the extended Kalman filter forward, then once back along its own linearisation.

Back run the multipliers of Bryson and Frazier (1963) for the means, x_k - P_k lambda_k with x and P filtered and lambda from
later measurements, and their information for the covariances (see `marginals`).  On the linearised problem this is the
smoother of Rauch, Tung and Striebel (1965) without its division by the predicted covariance, which need not have an inverse.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_smoother(
    K: int,
    t: Array,
    t_prior: float,
    count: Indices,
    scale: Array,
    first_row: Indices,
    z: Array,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    Q: Array,
    x0: Array,
    P0: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    x_pred: Array,
    P_pred: Array,
    gains: Array,
    rows: Array,
    keep_cross: int,
    mean: Array,
    covariance: Array,
    cross: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu_row, H_row, work = scratch(M), scratch(MN), scratch(WORK)
    x = load_vector(x0, 0, N)
    P = load_matrix(P0, 0, N, N)
    Q_unit = Q_matrix(Q)
    before = t_prior
    for k in range(K):
        if t[k] > before:
            x, F, Q_step = advance(before, t[k] - before, count[k], x, p, Q_unit, scale[k])
            P = F @ P @ F.T + Q_step
            if k > 0:
                store(Phi, (k - 1) * N * N, F)
                if noise_varies():
                    store(Q_all, (k - 1) * N * N, Q_step)
        before = t[k]
        store(x_pred, k * N, x)
        store(P_pred, k * N * N, symmetric(P))
        x, P = update_epoch(
            first_row[k],
            first_row[k + 1],
            t[k],
            x,
            P,
            p,
            z,
            station,
            sensor,
            numbers,
            R,
            correlated,
            nu_row,
            H_row,
            work,
            innovation,
            innovation_covariance,
        )
        P = symmetric(P)
        store(mean, k * N, x)
        store(covariance, k * N * N, P)
    linearize_rows(0, K, t, x_pred, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
    lam = unit(-1, N)
    for b in range(1, K):
        j = K - b
        P_j = load_matrix(P_pred, j * N * N, N, N)
        lam = back_through_epoch(first_row[j] * M, first_row[j + 1] * M, lam, unit(-1, N), P_j, nu, H, 0.0, rows, gains)
        lam = lam @ load_matrix(Phi, (j - 1) * N * N, N, N)
        filtered = load_vector(mean, (j - 1) * N, N)
        store(mean, (j - 1) * N, filtered - lam @ load_matrix(covariance, (j - 1) * N * N, N, N))
    marginal_covariances(0, K, scale, first_row, Q_unit, Q_all, Phi, nu, H, P_pred, P, keep_cross, covariance, cross)
