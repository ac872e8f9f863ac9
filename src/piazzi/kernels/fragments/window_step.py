"""Sliding window: at every epoch a Gauss-Newton step over the newest states; what left lives on in the prior of the oldest.

The measurements of a state that leaves keep the linearisation of its last step, its dynamics are linearised at its current
estimate: so a window of one state and one iteration is the extended Kalman filter, and a window of all states is the graph.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def solve_window(a, k, window, run, p, measured, chain, innovations):
    """Gauss-Newton steps over the states a ... k; returns the newest state's covariance, stores the oldest's."""
    W = k - a + 1
    m, P = load_vector(window.m, 0, N), load_matrix(window.P, 0, N, N)
    P_new = P
    for iteration in range(window.iterations):
        linearize_dynamics(a, W, run, chain, p)
        linearize_rows(a, W, run, chain, p, measured)
        _, P_new, P_old = forward_fixed_point(a, W, run, chain, m, P)
        if iteration == 0:
            x, d = load_vector(chain.x, k * N, N), load_vector(chain.d_pred, (W - 1) * N, N)
            record_epoch(k, run, p, measured, x, d, load_matrix(chain.P_pred, (W - 1) * N * N, N, N), innovations)
        backward(a, W, run, chain, 0.0)
        for j in range(W):
            store(chain.x, (a + j) * N, load_vector(chain.x, (a + j) * N, N) + load_vector(chain.dx, j * N, N))
        if cancelled(P_old, load_matrix(chain.P_pred, 0, N, N)) == 1:
            marginal_covariances(a, W, run, chain, P_new, 0, window.delayed, window.delayed)
        else:
            store(window.delayed, a * N * N, symmetric(P_old))
    return symmetric(P_new)
