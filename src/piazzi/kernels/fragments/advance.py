"""From one epoch to the next with process noise, without events."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def advance(t, dt, count, x, p, Q, scale):
    """Next state, its transition matrix, and the process noise of the interval."""
    return propagate_arc_noise(t, dt, count, remember(x), first_rows(), p, Q, scale)
