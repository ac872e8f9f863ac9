"""Motion over an interval in one step, for a method that is exact over any."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc(t, dt, count, x, p):
    """The state `dt` seconds later."""
    return substep(t, dt, x, p)


@inline
def propagate_arc_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later, and its derivative times the rows `R`."""
    return substep_jacobian(t, dt, x, R, p)
