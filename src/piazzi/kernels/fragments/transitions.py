"""The orbit of one first state, and the transition matrix of every interval, by a one-step method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(K="D+1", t="D+1", count="D+1", x="D+1 N", Phi="D N N")
def run_transitions(K: int, t: Array, count: Indices, p: Given, x: Array, Phi: Array) -> None:
    for k in range(1, K):
        y, R = transition(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p)
        store(x, k * N, y)
        store(Phi, (k - 1) * N * N, R)
