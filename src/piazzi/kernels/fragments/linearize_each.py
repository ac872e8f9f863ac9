"""Linearised dynamics of a stretch of states, one at a time; process noise is a multiple of one matrix."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_dynamics(a, W, t, count, scale, p, Q, x, f, Phi, Q_all):
    """f and Phi of states a ... a + W - 2 at their current values, stored from position 0."""
    for j in range(W - 1):
        k = a + j
        y, Phi_k = transition(t[k], t[k + 1] - t[k], count[k + 1], load_vector(x, k * N, N), p)
        store(f, j * N, y)
        store(Phi, j * N * N, Phi_k)
