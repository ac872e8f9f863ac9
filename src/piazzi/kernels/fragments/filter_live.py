"""The extended Kalman filter one measurement at a time: arrays stay between calls, so that a call costs little."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(clock="4", count="1", Q="N N")
def live_predict(clock: Array, count: Indices, p: Given, Q: Array, base: Belief, predicted: Belief) -> None:
    x = load_vector(base.mean, 0, N)
    x, Phi, Q_step = advance(clock[0], clock[1], count[0], x, p, load_matrix(Q, 0, N, N), clock[2])
    store(predicted.mean, 0, x)
    store(predicted.covariance, 0, Phi @ load_matrix(base.covariance, 0, N, N) @ Phi.T + Q_step)


@entry
@sizes(clock="4", widest="1")
def live_update(
    clock: Array,
    p: Given,
    measured: Measured,
    predicted: Belief,
    correction: Belief,
    now: Belief,
    innovations: Innovations,
    widest: Array,
) -> None:
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    x = load_vector(predicted.mean, 0, N)
    innovate_row(measured, 0, clock[3], x, p, own.nu, own.H, 0)
    record(0, load_matrix(predicted.covariance, 0, N, N), measured, own, innovations)
    record_variance_ratio(0, measured, innovations, widest)
    d, P = load_vector(correction.mean, 0, N), load_matrix(correction.covariance, 0, N, N)
    d, P = update_row(d, P, measured.station[0], measured, own)
    store(correction.mean, 0, d)
    store(correction.covariance, 0, P)
    store(now.mean, 0, x + d)
    store(now.covariance, 0, symmetric(P))
