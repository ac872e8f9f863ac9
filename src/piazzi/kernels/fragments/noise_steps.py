"""Process noise over an interval along equal substeps of a method of order 5 and more."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval."""
    h = dt / count
    Q_step = 0.0 * Q
    for i in range(count):
        at = t + i * h
        Q_step, _ = propagate_noise(Q_step, at, h, x, Q, p)
        x, R = substep_jacobian(at, h, x, R, p)
    return x, complete(R), symmetric(Q_step)
