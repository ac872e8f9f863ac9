"""Errors of `LANES` estimates, and whether their covariances admit them."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def nees_lanes(e, P, one, work):
    """e^T P^-1 e by elimination, and the smallest pivot over its variance: small where P is nearly singular.

    Not a number where P is not definite.
    """
    store_packs(work, 0, P, LANES)
    store_packs(work, N * N * LANES, e, LANES)
    total = 0.0 * one
    lowest = one
    for j in range(N):
        pivot = load_packs(work, (j * N + j) * LANES, 1, LANES)[0]
        variance = load_packs(work, (N * N + N + j) * LANES, 1, LANES)[0]
        error = load_packs(work, (N * N + j) * LANES, 1, LANES)[0]
        inverse = 1.0 / pivot
        row = load_packs(work, j * N * LANES, N, LANES)
        lowest = minimum(lowest, pivot * (1.0 / variance))
        total = total + error * error * inverse
        for i in range(j + 1, N):
            factor = load_packs(work, (i * N + j) * LANES, 1, LANES)[0] * inverse
            store_packs(work, i * N * LANES, load_packs(work, i * N * LANES, N, LANES) - factor * row, LANES)
            left = load_packs(work, (N * N + i) * LANES, 1, LANES)[0] - factor * error
            store_packs(work, (N * N + i) * LANES, vector(left), LANES)
    return total, lowest


@inline
def squared_lanes(at, step, member, groups, e, P, work, squared, spread):
    """Squared length of the error in each group of states, and the variance that the covariance gives it."""
    store_packs(work, 0, P, LANES)
    store_packs(work, N * N * LANES, e, LANES)
    for g in range(groups):
        length = 0.0 * e[0]
        variance = 0.0 * e[0]
        for i in range(N):
            if member[g * N + i]:
                error = load_packs(work, (N * N + i) * LANES, 1, LANES)[0]
                length = length + error * error
                variance = variance + load_packs(work, (i * N + i) * LANES, 1, LANES)[0]
        store_lanes(squared, at + g * step, groups * step, vector(length))
        store_lanes(spread, at + g * step, groups * step, vector(variance))
    for i in range(N):
        store_packs(work, (N * N + N + i) * LANES, load_packs(work, (i * N + i) * LANES, 1, LANES), LANES)
