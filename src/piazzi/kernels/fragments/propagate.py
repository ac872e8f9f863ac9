"""The orbit of one first state, without process noise."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(K="K", t="K", count="K", x="K N")
def run_propagation(K: int, t: Array, count: Indices, p: Given, x: Array) -> None:
    for k in range(1, K):
        store(x, k * N, propagate(t[k - 1], t[k] - t[k - 1], count[k], load_vector(x, (k - 1) * N, N), p))
