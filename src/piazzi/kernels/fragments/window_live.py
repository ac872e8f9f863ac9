"""Sliding window one measurement at a time: the same pieces as over a whole run, on buffers that stay between calls.

`span` says which epochs a call is about: the oldest and the newest, or, of those that leave, the first and the one behind them.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def live_append(span: Indices, t: Array, count: Indices, p: Array, x: Array) -> None:
    k = span[1]
    store(x, k * N, travel(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p))


@entry
def live_retire(
    span: Indices,
    t: Array,
    count: Indices,
    scale: Array,
    first_row: Indices,
    p: Array,
    Q: Array,
    m: Array,
    P: Array,
    x: Array,
    nu: Array,
    H: Array,
    dx: Array,
) -> None:
    m_now, P_now = load_vector(m, 0, N), load_matrix(P, 0, N, N)
    for a in range(span[0], span[1]):
        m_now, P_now = retire(a, span[0], t, count, scale, first_row, p, Q_matrix(Q), x, nu, H, dx, m_now, P_now)
    store(m, 0, m_now)
    store(P, 0, P_now)


@entry
def live_settle(
    span: Indices,
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
    oldest_covariance: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
    widest: Array,
) -> None:
    a, k = span[0], span[1]
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
        oldest_covariance,
        innovation,
        innovation_covariance,
    )
    for row in range(first_row[k], first_row[k + 1]):
        note_width(row, R, station[row] * M * M, innovation_covariance, widest)
    store(covariance, 0, P_new)
