"""Sliding window over a whole run."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_window(
    K: int,
    begin: Indices,
    iterations: int,
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
    Q_flat: Array,
    m0: Array,
    P0: Array,
    f: Array,
    Phi: Array,
    Q_all: Array,
    nu: Array,
    H: Array,
    d_pred: Array,
    P_pred: Array,
    gains: Array,
    multiplier: Array,
    dx: Array,
    work: Array,
    L: Array,
    x: Array,
    delayed_covariance: Array,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu_row, H_row = scratch(M), scratch(MN)
    Q = Q_matrix(Q_flat)
    m = load_vector(m0, 0, N)
    P = load_matrix(P0, 0, N, N)
    if t[0] > t_prior:
        m, F, Q_step = advance(t_prior, t[0] - t_prior, count[0], m, p, Q, scale[0])
        P = symmetric(F @ P @ F.T + Q_step)
    store(x, 0, m)
    a = 0
    for k in range(K):
        if k > 0:
            store(x, k * N, travel(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p))
            base = a
            while a < begin[k]:
                m, P = retire(a, base, t, count, scale, first_row, p, Q, x, nu, H, dx, m, P)
                a += 1
        P_new = settle(
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
            L,
            x,
            delayed_covariance,
            innovation,
            innovation_covariance,
        )
        store(mean, k * N, load_vector(x, k * N, N))
        store(covariance, k * N * N, P_new)
        if k + 1 == K or begin[k + 1] > a + 1:
            marginal_covariances(a, k - a + 1, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_new, 0, delayed_covariance, L)
