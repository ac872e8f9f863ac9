"""Linearised dynamics of a stretch of states, one at a time; process noise is a multiple of one matrix."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_dynamics(a, W, run, chain, p):
    """f and Phi of states a ... a + W - 2 at their current values, stored from position 0."""
    for j in range(W - 1):
        k = a + j
        x = load_vector(chain.x, k * N, N)
        y, Phi = transition(run.t[k], run.t[k + 1] - run.t[k], run.count[k + 1], x, p)
        store(chain.f, j * N, y)
        store(chain.Phi, j * N * N, Phi)
