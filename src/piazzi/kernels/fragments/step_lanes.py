"""Motion of `LANES` runs together, in equal substeps of a one-step method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_lanes(t, dt, count, x, p):
    """The states `dt` seconds later."""
    h = dt / count
    y = substep(t, h, remember(x), p)
    for i in range(1, count):
        y = substep(t + i * h, h, y, p)
    return y


@inline
def transition_lanes(t, dt, count, x, p):
    """The states `dt` seconds later, and their derivatives with respect to the states now."""
    h = dt / count
    y, R = substep_jacobian(t, h, remember(x), first_rows(), p)
    for i in range(1, count):
        y, R = substep_jacobian(t + i * h, h, y, R, p)
    return y, complete(R)


@inline
def transition_each(t, dt, count, x, p):
    """The same from a time of its own in every lane, over an interval of its own."""
    return transition_lanes(t, dt, count, x, p)
