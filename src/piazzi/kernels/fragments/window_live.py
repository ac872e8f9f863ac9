"""Sliding window one measurement at a time: the same pieces as over a whole run, on buffers that stay between calls."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def live_append(k: int, t: Array, count: Indices, p: Array, x: Array) -> None:
    store(x, k * N, travel(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p))


@entry
def live_retire(
    a: int,
    base: int,
    t: Array,
    count: Indices,
    scale: Array,
    first_row: Indices,
    p: Array,
    Q: Array,
    x: Array,
    nu: Array,
    H: Array,
    dx: Array,
    m: Array,
    P: Array,
) -> None:
    m_next, P_next = retire(
        a, base, t, count, scale, first_row, p, Q_matrix(Q), x, nu, H, dx, load_vector(m, 0, N), load_matrix(P, 0, N, N)
    )
    store(m, 0, m_next)
    store(P, 0, P_next)


@entry
def live_settle(
    a: int,
    k: int,
    iterations: int,
    t: Array,
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
    m: Array,
    P: Array,
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
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
    all_covariances: int,
) -> None:
    nu_row, H_row = scratch(M), scratch(MN)
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
        Q_matrix(Q),
        load_vector(m, 0, N),
        load_matrix(P, 0, N, N),
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
    store(covariance, 0, P_new)
    if all_covariances:
        marginal_covariances(
            a, k - a + 1, scale, first_row, Q_matrix(Q), Q_all, Phi, nu, H, P_pred, P_new, 0, delayed_covariance, L
        )
