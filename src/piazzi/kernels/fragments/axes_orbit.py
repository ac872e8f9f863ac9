"""Axes of the process noise: radial, transverse and normal to the orbit of the state."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def noise_in_axes(Q, x):
    """Process noise at state `x`."""
    T = orbit_axes(x)
    return T @ Q @ T.T
