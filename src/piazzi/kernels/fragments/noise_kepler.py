"""Process noise over an interval of two-body motion, along panels that are short beside the time in which the orbit turns."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval; NaN beyond `MAX_PANELS`."""
    y, R = substep_jacobian(t, dt, x, R, p)
    Q_step = 0.0 * Q
    widest = dt / count
    at = 0.0
    for _ in range(MAX_PANELS):
        h = minimum(panel(x, p), widest)
        last = h >= 0.999 * (dt - at)
        h = dt - at if last else h
        Q_step, x = propagate_noise(Q_step, t + at, h, x, Q, p)
        at += h
        if last:
            return y, complete(R), symmetric(Q_step)
    return y, complete(R), nan * Q_step
