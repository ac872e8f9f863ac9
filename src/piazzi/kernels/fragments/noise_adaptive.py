"""Process noise over an interval along the steps of an adaptive method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the noise of the interval, by the steps of the derivative."""
    Q_step = 0.0 * Q
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, R_next, error = trial_jacobian(t + at, h, x, R, p)
        if error <= 1.0:
            Q_step, _ = propagate_noise(Q_step, t + at, h, x, Q, p)
            x, R = y, R_next
            at += h
            if last:
                return x, complete(R), symmetric(Q_step)
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * complete(R), nan * Q_step
