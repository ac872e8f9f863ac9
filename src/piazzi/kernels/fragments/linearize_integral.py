"""Linearised dynamics of a stretch of states, with the process noise integrated along each step."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_dynamics(a, W, t, count, scale, p, Q, x, f, Phi, Q_all):
    """f, Phi and process noise of states a ... a + W - 2 at their current values, stored from position 0."""
    for j in range(W - 1):
        k = a + j
        y, Phi_k, Q_k = advance(t[k], t[k + 1] - t[k], count[k + 1], load_vector(x, k * N, N), p, Q, scale[k + 1])
        store(f, j * N, y)
        store(Phi, j * N * N, Phi_k)
        store(Q_all, j * N * N, Q_k)
