"""Rates of a continuous model on many states at once, for users."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(K="K", t="K", x="K N", out="K N")
def evaluate_dynamics(K: int, t: Array, x: Array, p: Given, out: Array) -> None:
    for k in range(K):
        store(out, k * N, dynamics(t[k], load_vector(x, k * N, N), p))


@entry
@sizes(K="K", t="K", x="K N", out="K N N")
def evaluate_dynamics_jacobian(K: int, t: Array, x: Array, p: Given, out: Array) -> None:
    for k in range(K):
        _, F = rhs(t[k], load_vector(x, k * N, N), identity_rows(), p)
        store(out, k * N * N, F)
        for i in range(ND * N, N * N):
            out[k * N * N + i] = 0.0
