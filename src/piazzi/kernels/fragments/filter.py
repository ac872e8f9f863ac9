"""The extended Kalman filter over a whole run (Jazwinski 1970, ch. 8; Joseph-form update)."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_filter(
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
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    x = load_vector(x0, 0, N)
    P = load_matrix(P0, 0, N, N)
    Q_unit = load_matrix(Q, 0, N, N)
    before = t_prior
    for k in range(K):
        if t[k] > before:
            x, Phi, Q_step = advance(before, t[k] - before, count[k], x, p, Q_unit, scale[k])
            P = Phi @ P @ Phi.T + Q_step
        before = t[k]
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
            nu,
            H,
            work,
            innovation,
            innovation_covariance,
        )
        store(mean, k * N, x)
        P = symmetric(P)
        store(covariance, k * N * N, P)
