"""Motion over an interval in equal substeps of a one-step method."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc(t, dt, count, x, p):
    """The state `dt` seconds later, in `count` substeps."""
    h = dt / count
    y = scattered(x)  # the next substep waits for this one's position, entry by entry
    for i in range(count):
        y = substep(t + i * h, h, y, p)
    return gathered(y)


@inline
def propagate_arc_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later, and its derivative times the rows `R`."""
    h = dt / count
    y = scattered(x)
    for i in range(count):
        y, R = substep_jacobian(t + i * h, h, y, R, p)
    return gathered(y), R


@inline
def arc_lanes(t, dt, count, x, p):
    """`propagate_arc` of `LANES` states."""
    h = dt / count
    y = substep(t, h, x, p)
    for i in range(1, count):
        y = substep(t + i * h, h, y, p)
    return y


@inline
def arc_lanes_jacobian(t, dt, count, x, R, p):
    """`propagate_arc_jacobian` of `LANES` states."""
    h = dt / count
    y, S = substep_jacobian(t, h, x, R, p)
    for i in range(1, count):
        y, S = substep_jacobian(t + i * h, h, y, S, p)
    return y, S
