"""Process noise over a step as a multiple of one matrix: Q per step (scale 1), or Q dt (scale dt)."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def advance(t, dt, count, x, p, Q, scale):
    """Next state, its transition matrix, and the process noise of the step."""
    x, Phi = transition(t, dt, count, x, p)
    return x, Phi, scale * Q
