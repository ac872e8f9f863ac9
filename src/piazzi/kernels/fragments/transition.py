"""From one epoch to the next without events."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def travel(t, dt, count, x, p):
    """The state `dt` seconds later."""
    return coast(t, dt, count, remember(x), p)


@inline
def transition(t, dt, count, x, p):
    """The state `dt` seconds later, and its derivative with respect to the state now."""
    x, R = coast_jacobian(t, dt, count, remember(x), first_rows(), p)
    return x, complete(R)
