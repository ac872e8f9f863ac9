"""Process noise over an interval along the steps of an adaptive method, each of which ends where it passes an event."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the noise of the interval, by the steps of the derivative."""
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    Q_step = 0.0 * Q
    widest = dt / count
    h = widest
    at = 0.0
    for _ in range(MAX_STEPS):
        last = fabs(h) >= 0.999 * fabs(dt - at)
        h = dt - at if last else h
        y, S, error = trial_jacobian(t + at, h, x, R, own)
        if error <= 1.0:
            e, s, many = crossing(t + at, h, x, y, own)
            if e >= 0 and s < 1.0:
                y, S, s = reach_jacobian(e, s, many, t + at, h, x, R, own)
            part = h if e < 0 else s * h
            Q_step, _ = propagate_noise(Q_step, t + at, part, x, Q, own)
            at += part
            if e < 0:
                arrive(own)
                x, R = y, S
            else:
                jump, row = cross(t + at, y, e, own)
                x, R = y, jumped(S, jump, row @ complete(S))
                G = complete(jumped(identity_rows(), jump, row))
                Q_step = G @ Q_step @ G.T
            if last and (e < 0 or fabs(dt - at) <= 1e-15 * fabs(dt)):
                return x, complete(R), symmetric(Q_step)
        h = resized(h, error, widest)
        if fabs(h) <= 1e-15 * fabs(dt):
            break
    return nan * x, nan * complete(R), nan * Q_step
