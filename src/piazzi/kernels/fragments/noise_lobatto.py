"""Process noise along a stretch of an orbit as the integral of Phi Q Phi^T, by Lobatto's rule."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_noise(Q_step, t, h, x, Q, p):
    """Process noise at the end of a stretch of `h` seconds from the one at its beginning, and the state there.

    Congruences from node to node, so that the result is semidefinite whatever the step: with G over a gap between two nodes,
    Q' = G Q' G^T + w h Q, with Q in the axes of each node's state.
    """
    total = Q_step + (WEIGHT[0] * h) * noise_in_axes(Q, x)
    for i in range(GAPS):
        x, R = substep_jacobian(t + NODE[i] * h, GAP[i] * h, x, identity_rows(), p)
        G = complete(R)
        total = G @ total @ G.T + (WEIGHT[i + 1] * h) * noise_in_axes(Q, x)
    return total, x
