"""A smooth arc by Gauss-Jackson's method: equal steps with one evaluation each, begun by steps of order 8.

A rate is evaluated where the sums of the earlier ones predict the state.  What is told of an epoch is corrected with the
newest rate; one within a step is reached from the step's end along the polynomial through the rates, whose order is the
method's.  `F` holds the rates, newest first from `at`; `v1` and `q2` their first and second sums, capitals the same of rows.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def keep(F, at, f, K):
    """Write the rates of what is driven into a slot of the history."""
    store(F, at, driven(f))
    keep_rows(F, at, driven_rows(K))


@inline
def rates_at(F, at):
    """Rates of the state in a slot."""
    return load_vector(F, at, DRIVEN)


@entry
@sizes(K="K", t="K", x="K N", Phi="* N N", done="3", last_Phi="N N")
def run_multistep(K: int, t: Array, steps: int, p: Given, x: Array, Phi: Array, done: Array, last_Phi: Array) -> None:
    """Of a model with events up to the step in which one may be passed: steps and epochs that are `done`, and until when.

    The state there follows those of the epochs in `x`.
    """
    F, kept, own = scratch(HISTORY), scratch(NN), watching(p)
    begin_derivatives(kept)
    begin, h = t[0], (t[K - 1] - t[0]) / steps
    y, R = load_vector(x, 0, N), first_derivative()
    at = HISTORY
    k = 1
    watch_from(begin, h, y, own)
    for i in range(ORDER):
        here = begin + i * h
        if i > 0:
            z, Z = stepped(here - h, h, y, R, own)
            if may_pass(here - h, h, z, own):
                done[0], done[1], done[2] = i - 1, k - 1, begin + (i - 1) * h
                store(x, k * N, y)
                write_last(last_Phi, R, kept)
                return
            while k < K and t[k] <= here:
                w, W = stepped(here - h, t[k] - (here - h), y, R, own)
                store(x, k * N, w)
                write_derivative(Phi, k, W, kept)
                k += 1
            y, R = z, Z
        f, G = rates_of(here, y, R, own)
        at -= SLOT
        keep(F, at, f, G)
    sx, sv, SX, SV = corrected(F, at)
    v1, V1 = (1.0 / h) * driven(y) - sv, (1.0 / h) * driven_rows(R) - SV
    q2 = (1.0 / (h * h)) * positions(y) - doubled(sx) + doubled(v1)
    Q2 = (1.0 / (h * h)) * position_rows(R) - doubled_rows(SX) + doubled_rows(V1)
    for i in range(ORDER, steps + 1):
        if at == 0:
            for j in range(ORDER * SLOT):
                F[TOP + j] = F[j]
            at = TOP
        here = begin + i * h
        sx, sv, SX, SV = predicted(F, at)
        z = joined(y, (h * h) * (q2 + doubled(sx)), h * (v1 + sv))
        Z = joined_rows((h * h) * (Q2 + doubled_rows(SX)), h * (V1 + SV))
        if may_pass(here - h, h, z, own):
            done[0], done[1], done[2] = i - 1, k - 1, begin + (i - 1) * h
            sx, sv, SX, SV = corrected(F, at)
            store(x, k * N, joined(y, (h * h) * (q2 - doubled(v1) + doubled(sx)), h * (v1 + sv)))
            Z = joined_rows((h * h) * (Q2 - doubled_rows(V1) + doubled_rows(SX)), h * (V1 + SV))
            write_last(last_Phi, Z, kept)
            return
        f, G = rates_of(here, z, Z, own)
        at -= SLOT
        keep(F, at, f, G)
        new, NEW = v1 + driven(f), V1 + driven_rows(G)
        if k < K and (t[k] <= here or i == steps):
            sx, sv, SX, SV = corrected(F, at)
            q, v = (h * h) * (q2 + doubled(sx)), h * (new + sv)
            Q, V = (h * h) * (Q2 + doubled_rows(SX)), h * (NEW + SV)
            while k < K and (t[k] <= here or i == steps):
                s = (here - t[k]) / h
                sx, sv, SX, SV = between(F, at, s)
                store(x, k * N, joined(y, q - (s * h) * doubled(v) + (h * h) * doubled(sx), v - h * sv))
                Z = joined_rows(Q - (s * h) * doubled_rows(V) + (h * h) * doubled_rows(SX), V - h * SV)
                write_derivative(Phi, k, Z, kept)
                k += 1
        v1, V1 = new, NEW
        q2, Q2 = q2 + doubled(v1), Q2 + doubled_rows(V1)
