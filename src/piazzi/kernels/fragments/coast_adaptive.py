"""Motion over an interval in steps as long as the tolerance allows, the last of which ends where the interval does."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def resized(h, error, widest):
    """Length of the next step from the error of this one in units of the tolerance, for a method of order 8."""
    factor = 0.1
    if error < 1e20:
        factor = minimum(0.9 / sqrt(sqrt(sqrt(maximum(error, 1e-8)))), 6.0)
        factor = maximum(factor, 0.2)
    h = h * factor
    return h if fabs(h) < fabs(widest) else widest


@inline
def coast(t, dt, count, x, p):
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
def coast_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later by the same steps, and the derivative of those steps times the rows `R`."""
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, error = trial(t + at, h, x, p)
        if error <= 1.0:
            _, R = substep_jacobian(t + at, h, x, R, p)
            x = y
            at += h
            if last:
                return x, R
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * R
