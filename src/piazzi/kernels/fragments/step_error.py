"""What the error of the steps does to a filter: a bias that every step adds to, and every measurement takes from."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_step_error(
    K: int,
    t: Array,
    t_prior: float,
    count: Indices,
    finer: Indices,
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
    bias_out: Array,
    covariance_out: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    x = load_vector(x0, 0, N)
    P = load_matrix(P0, 0, N, N)
    Q_unit = load_matrix(Q, 0, N, N)
    bias = unit(-1, N)
    before = t_prior
    for k in range(K):
        if t[k] > before:
            dt = t[k] - before
            exact = travel(before, dt, finer[k], x, p)
            x, Phi, Q_step = advance(before, dt, count[k], x, p, Q_unit, scale[k])
            bias = Phi @ bias + (x - exact)
            P = Phi @ P @ Phi.T + Q_step
        before = t[k]
        d = unit(-1, N)
        P_new = P
        for row in range(first_row[k], first_row[k + 1]):
            s = station[row]
            innovate(sensor[s], t[k], x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
            for i in range(M):
                nu[i] = nan if isnan(nu[i]) else 0.0
            bias, _ = absorb(bias, P_new, nu, H, R, s * M * M, correlated[s], work)
            innovate(sensor[s], t[k], x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
            d, P_new = absorb(d, P_new, nu, H, R, s * M * M, correlated[s], work)
        x = x + d
        P = symmetric(P_new)
        store(bias_out, k * N, bias)
        store(covariance_out, k * N * N, P)
