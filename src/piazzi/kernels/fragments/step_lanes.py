"""Motion of `LANES` runs together, in equal substeps of a one-step method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_lanes(t, dt, count, x, p):
    """The states `dt` seconds later."""
    return arc_lanes(t, dt, count, remember(x), p)


@inline
def transition_lanes(t, dt, count, x, p):
    """The states `dt` seconds later, and their derivatives with respect to the states now."""
    y, R = arc_lanes_jacobian(t, dt, count, remember(x), first_rows(), p)
    return y, complete(R)


@inline
def transition_each(t, dt, count, x, p):
    """The same from a time of its own in every lane, over an interval of its own."""
    return transition_lanes(t, dt, count, x, p)
