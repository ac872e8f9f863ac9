"""Process noise over an interval as a multiple of one matrix: Q per step (scale 1), or Q dt (scale dt)."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval, which enters at its end."""
    x, R = propagate_arc_jacobian(t, dt, count, x, R, p)
    return x, complete(R), scale * noise_in_axes(Q, x)
