"""One prediction of a belief, in place."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def predict_once(
    t: float,
    dt: float,
    count: int,
    scale: float,
    p: Array,
    Q: Array,
    mean: Array,
    covariance: Array,
    transition_out: Array,
    Q_out: Array,
) -> None:
    x, Phi, Q_step = advance(t, dt, count, load_vector(mean, 0, N), p, load_matrix(Q, 0, N, N), scale)
    store(mean, 0, x)
    store(covariance, 0, symmetric(Phi @ load_matrix(covariance, 0, N, N) @ Phi.T + Q_step))
    store(transition_out, 0, Phi)
    store(Q_out, 0, Q_step)
