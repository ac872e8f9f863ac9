"""The extended Kalman filter one measurement at a time: arrays stay between calls, so that a call costs little."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def live_predict(
    clock: Array, count: Indices, p: Array, Q: Array, mean: Array, covariance: Array, x_pred: Array, P_pred: Array
) -> None:
    x, Phi, Q_step = advance(clock[0], clock[1], count[0], load_vector(mean, 0, N), p, load_matrix(Q, 0, N, N), clock[2])
    store(x_pred, 0, x)
    store(P_pred, 0, Phi @ load_matrix(covariance, 0, N, N) @ Phi.T + Q_step)


@entry
def live_update(
    clock: Array,
    which: Indices,
    z: Array,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    x_pred: Array,
    P_pred: Array,
    d: Array,
    P: Array,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
    widest: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    s = which[0]
    x = load_vector(x_pred, 0, N)
    innovate(sensor[s], clock[3], x, p, numbers, s * NUMBERS, z, 0, nu, H, 0)
    record(0, nu, H, load_matrix(P_pred, 0, N, N), R, s * M * M, innovation, innovation_covariance)
    note_width(0, R, s * M * M, innovation_covariance, widest)
    d_new, P_new = absorb(load_vector(d, 0, N), load_matrix(P, 0, N, N), nu, H, R, s * M * M, correlated[s], work)
    store(d, 0, d_new)
    store(P, 0, P_new)
    store(mean, 0, x + d_new)
    store(covariance, 0, symmetric(P_new))
