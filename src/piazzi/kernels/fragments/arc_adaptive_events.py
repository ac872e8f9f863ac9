"""Motion over an interval in steps as long as the tolerance allows, each of which ends where it passes an event."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc(t, dt, count, x, p):
    """The state `dt` seconds later; NaN where `MAX_STEPS` do not get there or steps vanish."""
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, error = trial(t + at, h, x, own)
        if error <= 1.0:
            e, s, many = crossing(t + at, h, x, y, own)
            if e < 0:
                arrive(own)
                x = y
                at += h
            else:
                if s < 1.0:
                    y, s = reach(e, s, many, t + at, h, x, own)
                x = y
                at += s * h
                cross(t + at, x, e, own)
            if last and (e < 0 or fabs(dt - at) <= 1e-15 * fabs(dt)):
                return x
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x


@inline
def propagate_arc_jacobian(t, dt, count, x, R, p):
    """The state `dt` seconds later and its derivative times the rows `R`, in steps that keep to the tolerance in both."""
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, S, error = trial_jacobian(t + at, h, x, R, own)
        if error <= 1.0:
            e, s, many = crossing(t + at, h, x, y, own)
            if e < 0:
                arrive(own)
                x, R = y, S
                at += h
            else:
                if s < 1.0:
                    y, S, s = reach_jacobian(e, s, many, t + at, h, x, R, own)
                at += s * h
                jump, row = cross(t + at, y, e, own)
                x, R = y, jumped(S, jump, row @ complete(S))
            if last and (e < 0 or fabs(dt - at) <= 1e-15 * fabs(dt)):
                return x, R
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * R
