"""Motion over an interval in steps as long as the tolerance allows, the last of which ends where the interval does."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc(t, dt, count, x, p):
    """The state `dt` seconds later; NaN where `MAX_STEPS` do not get there or steps vanish."""
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, error = trial(t + at, h, x, p)
        if error <= 1.0:
            x = y
            at += h
            if last:
                return x
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x


@inline
def propagate_arc_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later and its derivative times the rows `R`, in steps that keep to the tolerance in both."""
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, R_next, error = trial_jacobian(t + at, h, x, R, p)
        if error <= 1.0:
            x, R = y, R_next
            at += h
            if last:
                return x, R
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * R
