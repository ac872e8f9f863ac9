"""Motion over an interval in equal substeps of a one-step method, each cut where it passes an event."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@outlined
def cut_step(t, h, x, p):
    """The state `h` seconds later."""
    done = 0.0
    for _ in range(64):
        left = h - done
        y = substep(t + done, left, x, p)
        e, s, many = crossing(t + done, left, x, y, p)
        if e < 0:
            arrive(p)
            return y
        if s < 1.0:
            y, s = reach(e, s, many, t + done, left, x, p)
        x = y
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
        e, s, many = crossing(t + done, left, x, y, p)
        if e < 0:
            arrive(p)
            return y, S
        if s < 1.0:
            y, S, s = reach_jacobian(e, s, many, t + done, left, x, R, p)
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


@inline
def is_clear_at(t, h, y, own, sides, end, clock):
    """The same of a step from what is at the start, `own.work`, to the states `y`, which the next one starts from."""
    store_packs(end, 0, events_of(t + h, y, own), LANES)
    store_packs(clock, 0, vector(t + 0.0 * y[0], h + 0.0 * y[0]), LANES)
    clear = is_clear(own.work, end, 0, sides, clock)
    for i in range(EVENTS_LANES):
        own.work[i] = end[i]
    return clear


@inline
def begin_lanes(t, dt, x, p, sides, start):
    """The sides on which `LANES` orbits begin; 0, on none, for one that begins on an event (see `begin`)."""
    for i in range(EVENTS_LANES):
        sides[i] = 0.0
    own = Beside(p.parameters, p.manoeuvres, p.data, load_packs(sides, 0, EVENTS, LANES), start)
    store_packs(start, 0, events_of(t, x, own), LANES)
    for i in range(EVENTS * LANES):
        sides[i] = side_of(start[i])
    own = Beside(p.parameters, p.manoeuvres, p.data, load_packs(sides, 0, EVENTS, LANES), start)
    store_packs(start, 0, events_of(t, x, own), LANES)
    times = scratch(LANES)
    store_packs(times, 0, vector(t + 0.0 * x[0]), LANES)
    for e in range(EVENTS):
        for lane in range(LANES):
            i = e * LANES + lane
            if fabs(start[i]) <= 1e-12 * maximum(fabs(times[lane]), 1.0) * fabs(start[EVENTS * LANES + i]):
                sides[i] = 0.0
    return own


@outlined
def one_by_one(t, dt, count, x, p):
    """The state of each lane by itself."""
    times, lengths, states = scratch(LANES), scratch(LANES), scratch(N_LANES)
    store_packs(times, 0, vector(t + 0.0 * x[0]), LANES)
    store_packs(lengths, 0, vector(dt + 0.0 * x[0]), LANES)
    store_lanes(states, 0, N, x)
    for lane in range(LANES):
        at = lane * N
        store(states, at, propagate_arc(times[lane], lengths[lane], count, load_vector(states, at, N), p))
    return load_lanes(states, 0, N, N, LANES)


@outlined
def one_by_one_jacobian(t, dt, count, x, R, p):
    """The state of each lane by itself, and its derivative times the rows `R`."""
    times, lengths, states, rows = scratch(LANES), scratch(LANES), scratch(N_LANES), scratch(NN_LANES)
    store_packs(times, 0, vector(t + 0.0 * x[0]), LANES)
    store_packs(lengths, 0, vector(dt + 0.0 * x[0]), LANES)
    store_lanes(states, 0, N, x)
    for lane in range(LANES):
        at = lane * N
        y, S = propagate_arc_jacobian(times[lane], lengths[lane], count, load_vector(states, at, N), R, p)
        store(states, at, y)
        store(rows, at * N, S)
    return load_lanes(states, 0, N, N, LANES), load_matrices(rows, 0, ND, N, NN, LANES)


@inline
def arc_lanes(t, dt, count, x, p):
    """`propagate_arc` of `LANES` states: together where none of them can pass an event, else one by one."""
    h = dt / count
    sides, start, end, clock = scratch(EVENTS_LANES), scratch(EVENTS_LANES), scratch(EVENTS_LANES), scratch(EVENTS_LANES)
    own = begin_lanes(t, dt, x, p, sides, start)
    y = substep(t, h, x, own)
    clear = is_clear_at(t, h, y, own, sides, end, clock)
    for i in range(1, count):
        if clear == 1:
            y = substep(t + i * h, h, y, own)
            clear = is_clear_at(t + i * h, h, y, own, sides, end, clock)
    return y if clear == 1 else one_by_one(t, dt, count, x, p)


@inline
def arc_lanes_jacobian(t, dt, count, x, R, p):
    """`propagate_arc_jacobian` of `LANES` states, likewise."""
    h, one = dt / count, 1.0 + 0.0 * x[0]
    sides, start, end, clock = scratch(EVENTS_LANES), scratch(EVENTS_LANES), scratch(EVENTS_LANES), scratch(EVENTS_LANES)
    own = begin_lanes(t, dt, x, p, sides, start)
    y, S = substep_jacobian(t, h, x, R, own)
    clear = is_clear_at(t, h, y, own, sides, end, clock)
    for i in range(1, count):
        if clear == 1:
            y, S = substep_jacobian(t + i * h, h, y, S, own)
            clear = is_clear_at(t + i * h, h, y, own, sides, end, clock)
    S = one * S  # in every lane: where nothing depends on the states, a derivative has a single one
    if clear == 0:
        y, S = one_by_one_jacobian(t, dt, count, x, R, p)
    return y, S
