"""From one epoch to the next with process noise, through manoeuvres: at each, the state jumps and its covariance grows."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def advance(t, dt, count, x, p, Q, scale):
    """Next state, its transition matrix, and the noise of the interval: process noise, and what the manoeuvres were not."""
    x, Phi = remember(x), complete(first_rows())
    Q_step = 0.0 * Q
    done = 0.0
    for i in range(int(p.manoeuvres[0])):
        at = manoeuvre(i)
        if manoeuvre_within(p.manoeuvres[at], t, dt):
            part = minimum(p.manoeuvres[at] - t, dt) - done
            x, G, Q_part = propagate_arc_noise(t + done, part, substeps_for(count, part, dt), x, identity_rows(), p, Q, 0.0)
            x = x + load_vector(p.manoeuvres, at + 1, N)
            Phi = G @ Phi
            Q_step = G @ Q_step @ G.T + Q_part + load_matrix(p.manoeuvres, at + 1 + N, N, N)
            done += part
    x, G, Q_part = propagate_arc_noise(t + done, dt - done, substeps_for(count, dt - done, dt), x, identity_rows(), p, Q, scale)
    return x, G @ Phi, symmetric(G @ Q_step @ G.T + Q_part)
