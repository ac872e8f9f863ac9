"""From one epoch to the next through manoeuvres: at each, the state jumps.

`p.manoeuvres` says how many there are, then for each its time, the jump (N) and its covariance (N, N).
One at the time of an epoch belongs to the interval that ends there.  Times that differ by 1e-12 of themselves, or by as many
seconds, are one: sums of intervals are rounded.  What decides is a property of the manoeuvre alone, so that the intervals on
both sides of an epoch agree whose it is.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def manoeuvre(i):
    """Where manoeuvre `i` begins."""
    return 1 + i * (1 + N + N * N)


@inline
def manoeuvre_within(when, t, dt):
    """Whether `when` is in (t, t + dt], whichever way the sum was rounded."""
    slack = 1e-12 * maximum(fabs(when), 1.0)
    return when - t > slack and when - (t + dt) <= slack


@inline
def substeps_for(count, part, dt):
    """Substeps for a part of an interval, at least one."""
    return count if part == dt else 1 + int(count * (part / dt) * (1.0 - 1e-9))


@inline
def propagate(t, dt, count, x, p):
    """The state `dt` seconds later."""
    x = remember(x)
    done = 0.0
    for i in range(int(p.manoeuvres[0])):
        at = manoeuvre(i)
        if manoeuvre_within(p.manoeuvres[at], t, dt):
            part = minimum(p.manoeuvres[at] - t, dt) - done
            x = propagate_arc(t + done, part, substeps_for(count, part, dt), x, p) + load_vector(p.manoeuvres, at + 1, N)
            done += part
    return propagate_arc(t + done, dt - done, substeps_for(count, dt - done, dt), x, p)


@inline
def transition(t, dt, count, x, p):
    """The state `dt` seconds later, and its derivative with respect to the state now."""
    x, R = remember(x), first_rows()
    done = 0.0
    for i in range(int(p.manoeuvres[0])):
        at = manoeuvre(i)
        if manoeuvre_within(p.manoeuvres[at], t, dt):
            part = minimum(p.manoeuvres[at] - t, dt) - done
            x, R = propagate_arc_jacobian(t + done, part, substeps_for(count, part, dt), x, R, p)
            x = x + load_vector(p.manoeuvres, at + 1, N)
            done += part
    x, R = propagate_arc_jacobian(t + done, dt - done, substeps_for(count, dt - done, dt), x, R, p)
    return x, complete(R)
