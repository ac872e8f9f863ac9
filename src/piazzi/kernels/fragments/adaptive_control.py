"""Errors of adaptive steps in units of the tolerance, and how long the next one is."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def combined_error(h, fifth, third):
    """The error of a step from the sums of squares of its estimates of order 5 and 3, in units of the tolerance.

    As by Hairer, Norsett and Wanner (1993), II.10.
    """
    return fabs(h) * fifth / sqrt(ND * maximum(fifth + 0.01 * third, 1e-300))


@inline
def resized(h, error, widest):
    """Length of the next step from the error of this one in units of the tolerance, for a method of order 8."""
    factor = 0.1
    if error < 1e20:
        factor = minimum(0.9 / sqrt(sqrt(sqrt(maximum(error, 1e-8)))), 6.0)
        factor = maximum(factor, 0.2)
    h = h * factor
    return h if fabs(h) < fabs(widest) else widest


@outlined
def matrix_error(h, R, S, fifth, third):
    """Error of a step that takes the rows `R` to `S`, in units of the tolerance, from the two estimates: of the worst column.

    A column is a displacement of the state, and held to the state's own law: the states of a group are one vector.  Where
    that is less than a thousandth of the column, the column counts: what hardly matters beside it may be zero.
    """
    before, after, e5, e3 = scratch(NN), scratch(NN), scratch(NN), scratch(NN)
    store(before, 0, R)
    store(after, 0, S)
    store(e5, 0, fifth)
    store(e3, 0, third)
    old, new = scratch(ND), scratch(ND)
    worst = 0.0
    for j in range(N):
        old_column = 0.0
        new_column = 0.0
        for g in range(ND):
            old[g] = 0.0
            new[g] = 0.0
        for i in range(ND):
            a, b = before[i * N + j], after[i * N + j]
            old[GROUP[i]] += a * a
            new[GROUP[i]] += b * b
            old_column += a * a
            new_column += b * b
        least = 1e-6 * maximum(old_column, new_column)
        u = 0.0
        v = 0.0
        for i in range(ND):
            size = sqrt(maximum(maximum(old[GROUP[i]], new[GROUP[i]]), least))
            weight = 1.0 / maximum(ATOL + RTOL * size, 1e-300)
            u += (weight * e5[i * N + j]) * (weight * e5[i * N + j])
            v += (weight * e3[i * N + j]) * (weight * e3[i * N + j])
        error = combined_error(h, u, v)
        if not error <= 1e300:
            return inf
        worst = maximum(worst, error)
    return worst
