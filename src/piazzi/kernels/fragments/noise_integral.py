"""Process noise over a step as the integral of Phi Q Phi^T, for white noise of spectral density Q in continuous time."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def advance(t, dt, count, x, p, Q, scale):
    """Next state, its transition matrix, and the process noise of the step.

    Simpson's rule over each substep, in congruences, so that the result is semidefinite whatever the step: with G over the
    substep and E over its second half, Q' = G (Q' + h/6 Q) G^T + 4h/6 E Q E^T + h/6 Q.
    """
    h = dt / count
    x = remember(x)
    Phi = complete(first_rows())
    Q_step = 0.0 * Q
    for i in range(count):
        at = t + i * h
        middle = substep(at, 0.5 * h, x, p)
        _, second = substep_jacobian(at + 0.5 * h, 0.5 * h, middle, identity_rows(), p)
        x, first = substep_jacobian(at, h, x, identity_rows(), p)
        G = complete(first)
        E = complete(second)
        Phi = G @ Phi
        Q_step = G @ (Q_step + (h / 6.0) * Q) @ G.T + (h / 1.5) * (E @ Q @ E.T) + (h / 6.0) * Q
    return x, Phi, symmetric(Q_step)
