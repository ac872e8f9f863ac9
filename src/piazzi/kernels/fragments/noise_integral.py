"""Process noise over an interval as the integral of Phi Q Phi^T, for white noise of spectral density Q in continuous time."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def add_noise(Q_step, h, x, middle, y, G, E, Q):
    """Process noise at the end of a substep from the one at its beginning.

    Simpson's rule in congruences, so that the result is semidefinite whatever the step: with G over the substep and E over
    its second half, Q' = G (Q' + h/6 Q) G^T + 4h/6 E Q E^T + h/6 Q, with Q in the axes of each of the three states.
    """
    begin = Q_step + (h / 6.0) * noise_in_axes(Q, x)
    return G @ begin @ G.T + (h / 1.5) * (E @ noise_in_axes(Q, middle) @ E.T) + (h / 6.0) * noise_in_axes(Q, y)


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval."""
    h = dt / count
    Phi = complete(R)
    Q_step = 0.0 * Q
    for i in range(count):
        at = t + i * h
        middle = substep(at, 0.5 * h, x, p)
        y, first = substep_jacobian(at, h, x, identity_rows(), p)
        G = complete(first)
        Phi = G @ Phi
        _, second = substep_jacobian(at + 0.5 * h, 0.5 * h, middle, identity_rows(), p)
        Q_step = add_noise(Q_step, h, x, middle, y, G, complete(second), Q)
        x = y
    return x, Phi, symmetric(Q_step)
