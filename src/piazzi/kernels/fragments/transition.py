"""From one epoch to the next, in substeps."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def symmetric(P):
    """The symmetric part; rounding must not grow into an asymmetry."""
    return 0.5 * (P + P.T)


@inline
def travel(t, dt, count, x, p):
    """The state `dt` seconds later, in `count` substeps."""
    x = remember(x)
    h = dt / count
    for i in range(count):
        x = substep(t + i * h, h, x, p)
    return x


@inline
def transition(t, dt, count, x, p):
    """The state `dt` seconds later, and its derivative with respect to the state now."""
    x = remember(x)
    R = first_rows()
    h = dt / count
    for i in range(count):
        x, R = substep_jacobian(t + i * h, h, x, R, p)
    return x, complete(R)
