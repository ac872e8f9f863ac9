"""Process noise over an interval as the integral of Phi Q Phi^T, along the steps of an adaptive method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def add_noise(Q_step, t, h, x, y, G, Q, p):
    """Process noise at the end of a step from the one at its beginning: Simpson's rule on both halves of the step.

    With G over the step and E_i from its quarters to its end, the weights of Q are h/12 (1, 4, 2, 4, 1).
    """
    total = G @ (Q_step + (h / 12.0) * noise_in_axes(Q, x)) @ G.T + (h / 12.0) * noise_in_axes(Q, y)
    for i in range(1, 4):
        part = 0.25 * i * h
        inside = substep(t, part, x, p)
        _, rest = substep_jacobian(t + part, h - part, inside, identity_rows(), p)
        E = complete(rest)
        total = total + ((h / 6.0) if i == 2 else (h / 3.0)) * (E @ noise_in_axes(Q, inside) @ E.T)
    return total


@inline
def coast_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval, by the steps of `coast`."""
    Phi = complete(R)
    Q_step = 0.0 * Q
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, error = trial(t + at, h, x, p)
        if error <= 1.0:
            _, first = substep_jacobian(t + at, h, x, identity_rows(), p)
            G = complete(first)
            Phi = G @ Phi
            Q_step = add_noise(Q_step, t + at, h, x, y, G, Q, p)
            x = y
            at += h
            if last:
                return x, Phi, symmetric(Q_step)
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * Phi, nan * Q_step
