"""Where an orbit passes an event: a step is cut there, and the equations of motion go over to its other side.

Up to there every stage of the step sees the side that it began on, so that the step is smooth.  Where the rates jump from f- to
f+, a displacement that reaches the event earlier has f+ in the place of f- for so much longer: the transition matrix has the
factor I + (f+ - f-) (dg/dx) / (dg/dt), dg/dt along the orbit before the event.  `p` is the bundle `Beside`.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def begin(t, dt, x, own):
    """The sides on which an orbit begins; on an event, that on which it goes on.

    Times that differ by 1e-12 of themselves, or by as many seconds, are one, as for manoeuvres: so a crossing at an epoch is
    counted once, in the interval that ends there.
    """
    for e in range(EVENTS):
        own.sides[e] = 0.0
    events_into(t, x, own, 0)
    for e in range(EVENTS):
        own.sides[e] = side_of(own.work[e])
    events_into(t, x, own, 0)
    for e in range(EVENTS):
        if fabs(own.work[e]) <= 1e-12 * maximum(fabs(t), 1.0) * fabs(own.work[EVENTS + e]):
            own.sides[e] = side_of(own.work[EVENTS + e] * dt)
            own.work[e] = 0.0


@inline
def side_of(g):
    """1 or -1, 0 at zero."""
    return 1.0 if g > 0.0 else -1.0 if g < 0.0 else 0.0


@inline
def lowest(a, b, c, d):
    """Where in (0, 1), and how low, the cubic with values a and c and slopes b < 0 and d > 0 at the ends is least."""
    second = 3.0 * (c - a) - 2.0 * b - d
    third = 2.0 * (a - c) + b + d
    s = -b / (second + sqrt(maximum(second * second - 3.0 * third * b, 1e-300)))
    return s, a + s * (b + s * (second + s * third))


@outlined
def passes(e, t, h, x, p):
    """A fraction of the step at which the orbit is beyond event e, 2 where it never is.

    It is beyond at the end, or at a least distance in between, which is looked for through the values and rates at both ends.
    """
    side, first, last, middle = p.sides[e], e, 2 * EVENTS + e, 4 * EVENTS + e
    a, b = side * p.work[first], side * h * p.work[first + EVENTS]
    c, d = side * p.work[last], side * h * p.work[last + EVENTS]
    slack = 1e-12 * maximum(fabs(t + h), 1.0) / fabs(h)
    if side == 0.0:
        return 2.0
    if c <= -slack * d:  # also on the edge, about to leave
        return 1.0
    low, high = 0.0, 1.0
    rounding = 1e-14 * maximum(a, c)
    for _ in range(6):
        if not b < 0.0 < d:
            return 2.0
        width = high - low
        s, least = lowest(a, width * b, c, width * d)
        if least > minimum(a, c) - least:
            return 2.0
        s = low + width * s
        events_into(t + s * h, substep(t, s * h, x, p), p, 4 * EVENTS)
        value, rate = side * p.work[middle], side * h * p.work[middle + EVENTS]
        if value <= -rounding:  # else it touches
            return s
        if rate < 0.0:
            low, a, b = s, value, rate
        else:
            high, c, d = s, value, rate
    return 2.0


@outlined
def is_clear(start, end, at, sides, clock):
    """1 where in no lane an event can lie between both ends of a step, by the first look of `passes`; else 0.

    Values and rates at the end lie in `end` from `at`; `clock` has the times at which the step begins, and its lengths.
    """
    clear = 1
    for lane in range(LANES):
        t, h = clock[lane], clock[LANES + lane]
        slack = 1e-12 * maximum(fabs(t + h), 1.0) / fabs(h)
        for e in range(EVENTS):
            i, rate = e * LANES + lane, (EVENTS + e) * LANES + lane
            a, b = sides[i] * start[i], sides[i] * h * start[rate]
            c, d = sides[i] * end[at + i], sides[i] * h * end[at + rate]
            if not c > slack * fabs(d):
                clear = 0
            elif b < 0.0 < d:
                _, least = lowest(a, b, c, d)
                if not least > minimum(a, c) - least:
                    clear = 0
    return clear


@inline
def cubic(e, h, p, high):
    """The value of event e at `high`, and the polynomial through values and rates there and at the start, in parts of it."""
    side, last = p.sides[e], (2 if high == 1.0 else 4) * EVENTS + e
    a, b = side * p.work[e], side * h * high * p.work[e + EVENTS]
    c, d = side * p.work[last], side * h * high * p.work[last + EVENTS]
    return c, a, b, 3.0 * (c - a) - 2.0 * b - d, 2.0 * (a - c) + b + d


@outlined
def foretold(e, h, p, high):
    """The fraction of the step at which that polynomial passes event e, before the one at which the orbit is beyond it."""
    c, a, b, second, third = cubic(e, h, p, high)
    if c > 0.0:  # as good as there
        return high
    low, top = 0.0, 1.0
    for _ in range(30):
        s = 0.5 * (low + top)
        if a + s * (b + s * (second + s * third)) > 0.0:
            low = s
        else:
            top = s
    return high * 0.5 * (low + top)


@outlined
def located(e, t, h, x, p, high):
    """The fraction at which the orbit passes it: by Newton's method, each time by a step from the start."""
    _, _, _, second, third = cubic(e, h, p, high)
    side, low, width = p.sides[e], 0.0, high
    s = foretold(e, h, p, high)
    if s == high:
        return high
    for _ in range(60):
        events_into(t + s * h, substep(t, s * h, x, p), p, 4 * EVENTS)
        value, rate = side * p.work[4 * EVENTS + e], side * h * p.work[5 * EVENTS + e]
        if value > 0.0:
            low = s
        else:
            high = s
        step = value / rate if rate < 0.0 else inf
        inside = low <= s - step <= high
        after = s - step if inside else 0.5 * (low + high)
        bend = (second + 3.0 * third * s / width) / (width * width)  # of the cubic: what Newton's method leaves
        if fabs(after - s) <= 1e-7 or (inside and fabs(bend) * step * step <= 1e-10 * fabs(rate)):
            return after
        s = after
    return s


@outlined
def crossing(t, h, x, y, p):
    """The first event on the way from x to y, -1 where there is none, at which fraction of the step, and how many there are.

    Of one alone as it is foretold, which `reach` mends.
    """
    events_into(t + h, y, p, 2 * EVENTS)
    event, first, many = -1, 2.0, 0
    for e in range(EVENTS):
        s = passes(e, t, h, x, p)
        if s <= 1.0:
            event, first = e, foretold(e, h, p, s)
            many += 1
    if many > 1:
        first = 2.0
        for e in range(EVENTS):
            s = passes(e, t, h, x, p)
            if s <= 1.0:
                s = located(e, t, h, x, p, s)
                if s < first:
                    event, first = e, s
    return event, first, many


@inline
def offset(e, t, h, moved, x, p):
    """Seconds from a state near event e to the event; not a number where that is not near enough to where it was looked for."""
    events_into(t, x, p, 4 * EVENTS)
    value, rate = p.work[4 * EVENTS + e], p.work[5 * EVENTS + e]
    step = -value / rate if fabs(rate) > 0.0 else inf
    return step if fabs(moved + step) <= 1e-4 * fabs(h) else nan


@outlined
def nudged(e, t, h, x, p):
    """The state on event e, by short steps of the midpoint rule from one near it, and how many seconds that took."""
    moved = 0.0
    for _ in range(4):
        step = offset(e, t + moved, h, moved, x, p)
        middle = x + (0.5 * step) * dynamics_beside(t + moved, x, p)
        x = x + step * dynamics_beside(t + moved + 0.5 * step, middle, p)
        moved += step
        if not fabs(step) > 1e-7 * fabs(h):  # what Newton's method leaves is its square
            return x, moved
    return x, nan


@outlined
def nudged_jacobian(e, t, h, x, R, p):
    """The same with the derivative times the rows `R`."""
    moved = 0.0
    for _ in range(4):
        step = offset(e, t + moved, h, moved, x, p)
        f, F = rhs_beside(t + moved, x, R, p)
        f, F = rhs_beside(t + moved + 0.5 * step, x + (0.5 * step) * f, R + (0.5 * step) * F, p)
        x, R = x + step * f, R + step * F
        moved += step
        if not fabs(step) > 1e-7 * fabs(h):
            return x, R, moved
    return x, R, nan


@outlined
def reach(e, s, many, t, h, x, p):
    """The state where the step from x passes event e, about at the fraction s before its end, and that fraction.

    A step that reaches beyond the event sees a bend there, so this one ends a little before.
    """
    before = maximum(s - 0.5e-4, 0.5 * s) if many == 1 else s
    z = substep(t, before * h, x, p)
    if many == 1:
        z, moved = nudged(e, t + before * h, h, z, p)
        after = before + moved / h
        if 0.0 <= after <= 1.0:
            return z, after
        s = located(e, t, h, x, p, passes(e, t, h, x, p))
        z = substep(t, s * h, x, p)
    return z, s


@outlined
def reach_jacobian(e, s, many, t, h, x, R, p):
    """The same with the derivative times the rows `R`."""
    before = maximum(s - 0.5e-4, 0.5 * s) if many == 1 else s
    z, Z = substep_jacobian(t, before * h, x, R, p)
    if many == 1:
        z, Z, moved = nudged_jacobian(e, t + before * h, h, z, Z, p)
        after = before + moved / h
        if 0.0 <= after <= 1.0:
            return z, Z, after
        s = located(e, t, h, x, p, passes(e, t, h, x, p))
        z, Z = substep_jacobian(t, s * h, x, R, p)
    return z, Z, s


@inline
def arrive(p):
    """The end of a step becomes the start of the next."""
    for e in range(EVENTS):
        p.work[e] = p.work[2 * EVENTS + e]
        p.work[EVENTS + e] = p.work[3 * EVENTS + e]
        if p.sides[e] == 0.0:
            p.sides[e] = side_of(p.work[e])


@outlined
def cross(t, x, e, p):
    """Go over to the other side of event e: what the rates jump by, over the rate of the event, and its derivative by x."""
    events_into(t, x, p, 0)
    rate, before = p.work[EVENTS + e], dynamics_beside(t, x, p)
    p.sides[e] = -p.sides[e]
    events_into(t, x, p, 0)
    after = dynamics_beside(t, x, p)
    p.work[e] = 0.0
    return (1.0 / rate if fabs(rate) > 0.0 else 0.0) * (after - before), event_row(t, x, p, e)
