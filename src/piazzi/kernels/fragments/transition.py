"""From one epoch to the next without events."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate(t, dt, count, x, p):
    """The state `dt` seconds later."""
    return propagate_arc(t, dt, count, remember(x), p)


@inline
def transition(t, dt, count, x, p):
    """The state `dt` seconds later, and its derivative with respect to the state now."""
    x, R = propagate_arc_jacobian(t, dt, count, remember(x), first_rows(), p)
    return x, complete(R)
