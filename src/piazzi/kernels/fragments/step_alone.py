"""Motion of states that do not move together: one at a time, by what is called with lanes."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_lanes(t, dt, count, x, p):
    """The state `dt` seconds later."""
    return propagate(t, dt, count, x, p)
