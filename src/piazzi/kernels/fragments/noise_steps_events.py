"""Process noise over an interval along equal substeps, each cut where it passes an event."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@outlined
def cut_step_noise(t, h, x, R, p, Q, Q_step):
    """The state `h` seconds later, its derivative times the rows `R`, and the process noise from the one before.

    What the noise before an event does to the state moves the event too.
    """
    done = 0.0
    for _ in range(64):
        left = h - done
        y, S = substep_jacobian(t + done, left, x, R, p)
        e, s, many = crossing(t + done, left, x, y, p)
        if e >= 0 and s < 1.0:
            y, S, s = reach_jacobian(e, s, many, t + done, left, x, R, p)
        Q_step, _ = propagate_noise(Q_step, t + done, left if e < 0 else s * left, x, Q, p)
        if e < 0:
            arrive(p)
            return y, S, Q_step
        done += s * left
        jump, row = cross(t + done, y, e, p)
        x, R = y, jumped(S, jump, row @ complete(S))
        G = complete(jumped(identity_rows(), jump, row))
        Q_step = G @ Q_step @ G.T
        if fabs(h - done) <= 1e-15 * fabs(h):
            return x, R, Q_step
    return nan * x, nan * R, nan * Q_step


@inline
def propagate_arc_noise(t, dt, count, x, R, p, Q, scale):
    """Next state, its derivative times the rows `R`, and the process noise of the interval."""
    h = dt / count
    own = Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))
    begin(t, dt, x, own)
    Q_step = 0.0 * Q
    for i in range(count):
        x, R, Q_step = cut_step_noise(t + i * h, h, x, R, own, Q, Q_step)
    return x, complete(R), symmetric(Q_step)
