"""Sliding window: at every epoch a Gauss-Newton step over the newest states; what left lives on in the prior of the oldest.

The measurements of a state that leaves keep the linearisation of its last step, its dynamics are linearised at its current
estimate: so a window of one state and one iteration is the extended Kalman filter, and a window of all states is the graph.
"""

# ruff: noqa: F821
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def retire(a, base, t, count, scale, first_row, p, Q, x, nu, H, dx, m, P):
    """Prior of state a + 1 from the prior of state a; `base` is the state where the last linearisation begins."""
    last_step = load_vector(dx, (a - base) * N, N)
    linearized_at = load_vector(x, a * N, N) - last_step
    first = (first_row[a] - first_row[base]) * M
    d, P, _ = absorb_epoch(first, (first_row[a + 1] - first_row[base]) * M, m - linearized_at, P, nu, H)
    y, F, Q_step = advance(t[a], t[a + 1] - t[a], count[a + 1], load_vector(x, a * N, N), p, Q, scale[a + 1])
    return y + F @ (d - last_step), symmetric(F @ P @ F.T + Q_step)


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
    nu_row: Array,
    H_row: Array,
    work: Array,
    L: Array,
    X: Array,
    x: Array,
    delayed_covariance: Array,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
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
        W = k - a + 1
        P_new = P
        for iteration in range(iterations):
            linearize_dynamics(a, W, t, count, scale, p, Q, x, f, Phi, Q_all)
            linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
            _, P_new, P_old = forward_following(a, W, x, scale, first_row, Q, Q_all, f, Phi, nu, H, m, P, d_pred, P_pred)
            if iteration == 0:
                j = W - 1
                record_epoch(k, t, first_row, z, station, sensor, numbers, R, p, load_vector(x, k * N, N), load_vector(d_pred, j * N, N),
                             load_matrix(P_pred, j * N * N, N, N), nu_row, H_row, innovation, innovation_covariance)  # fmt: skip
            backward(a, W, first_row, Phi, nu, H, 0.0, L, d_pred, P_pred, gains, multiplier, dx)
            for j in range(W):
                store(x, (a + j) * N, load_vector(x, (a + j) * N, N) + load_vector(dx, j * N, N))
            store(delayed_covariance, a * N * N, symmetric(P_old))
        store(mean, k * N, load_vector(x, k * N, N))
        store(covariance, k * N * N, symmetric(P_new))
        if k + 1 == K or begin[k + 1] > a + 1:
            marginal_covariances(a, W, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_new, L, X, 0, delayed_covariance, L)
