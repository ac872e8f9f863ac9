"""Motion over an interval in equal substeps of a one-step method, each cut where it passes an event."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@outlined
def cut_step(t, h, x, p):
    """The state `h` seconds later."""
    done = 0.0
    for _ in range(64):
        left = h - done
        y = substep(t + done, left, x, p)
        e, s = crossing(t + done, left, x, y, p)
        if e < 0:
            arrive(p)
            return y
        x = y if s == 1.0 else substep(t + done, s * left, x, p)
        done += s * left
        cross(t + done, x, e, p)
        if fabs(h - done) <= 1e-15 * fabs(h):
            return x
    return nan * x


@outlined
def cut_step_jacobian(t, h, x, R, p):
    """The state `h` seconds later, and its derivative times the rows `R`."""
    done = 0.0
    for _ in range(64):
        left = h - done
        y, S = substep_jacobian(t + done, left, x, R, p)
        e, s = crossing(t + done, left, x, y, p)
        if e < 0:
            arrive(p)
            return y, S
        if s < 1.0:
            y, S = substep_jacobian(t + done, s * left, x, R, p)
        done += s * left
        jump, row = cross(t + done, y, e, p)
        x, R = y, jumped(S, jump, row @ complete(S))
        if fabs(h - done) <= 1e-15 * fabs(h):
            return x, R
    return nan * x, nan * R


@inline
def propagate_arc(t, dt, count, x, p):
    """The state `dt` seconds later, in `count` substeps."""
    h = dt / count
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    for i in range(count):
        x = cut_step(t + i * h, h, x, own)
    return x


@inline
def propagate_arc_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later, and its derivative times the rows `R`."""
    h = dt / count
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    for i in range(count):
        x, R = cut_step_jacobian(t + i * h, h, x, R, own)
    return x, R
