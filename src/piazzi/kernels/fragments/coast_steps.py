"""Motion over an interval in equal substeps of a one-step method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def coast(t, dt, count, x, p):
    """The state `dt` seconds later, in `count` substeps."""
    h = dt / count
    for i in range(count):
        x = substep(t + i * h, h, x, p)
    return x


@inline
def coast_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later, and its derivative times the rows `R`."""
    h = dt / count
    for i in range(count):
        x, R = substep_jacobian(t + i * h, h, x, R, p)
    return x, R
