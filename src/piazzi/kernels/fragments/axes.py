"""Axes of the process noise: those of the states."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def noise_in_axes(Q, x):
    """Process noise at state `x`."""
    return Q
