"""Linearised dynamics of a stretch of states, with the process noise integrated along each step."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_dynamics(a, W, run, chain, p):
    """f, Phi and process noise of states a ... a + W - 2 at their current values, stored from position 0."""
    Q = Q_matrix(run.Q)
    for j in range(W - 1):
        k = a + j
        x = load_vector(chain.x, k * N, N)
        y, Phi, Q_step = advance(run.t[k], run.t[k + 1] - run.t[k], run.count[k + 1], x, p, Q, run.scale[k + 1])
        store(chain.f, j * N, y)
        store(chain.Phi, j * N * N, Phi)
        store(chain.Q_all, j * N * N, Q_step)
