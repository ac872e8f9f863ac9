"""One prediction of a belief, in place; `clock` holds its time, the seconds that it goes on, and the scale of the noise."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(clock="3", count="1", Q="N N", Phi_out="N N", Q_out="N N")
def predict_once(clock: Array, count: Indices, p: Given, Q: Array, belief: Belief, Phi_out: Array, Q_out: Array) -> None:
    x, Q_unit = load_vector(belief.mean, 0, N), load_matrix(Q, 0, N, N)
    x, Phi, Q_step = advance(clock[0], clock[1], count[0], x, p, Q_unit, clock[2])
    store(belief.mean, 0, x)
    store(belief.covariance, 0, symmetric(Phi @ load_matrix(belief.covariance, 0, N, N) @ Phi.T + Q_step))
    store(Phi_out, 0, Phi)
    store(Q_out, 0, Q_step)
