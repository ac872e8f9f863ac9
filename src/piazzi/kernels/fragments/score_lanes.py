"""Errors of `LANES` estimates, and whether their covariances admit them."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def ones():
    """1.0 in every lane."""
    one = scratch(1)
    one[0] = 1.0
    return load_lanes(one, 0, 1, 0, LANES)[0]


@inline
def store_errors(e, P, own):
    """Errors, covariances and variances into work space, entry by entry."""
    store_packs(own.e, 0, e, LANES)
    store_packs(own.P, 0, P, LANES)
    for i in range(N):
        store_packs(own.variance, i * LANES, load_packs(own.P, (i * N + i) * LANES, 1, LANES), LANES)


@inline
def nees_lanes(one, own):
    """e^T P^-1 e by elimination, and the smallest pivot over its variance: small where P is nearly singular.

    Not a number where P is not definite.  Errors and covariances are used up.
    """
    total = 0.0 * one
    lowest = one
    for j in range(N):
        pivot = load_packs(own.P, (j * N + j) * LANES, 1, LANES)[0]
        variance = load_packs(own.variance, j * LANES, 1, LANES)[0]
        error = load_packs(own.e, j * LANES, 1, LANES)[0]
        inverse = 1.0 / pivot
        row = load_packs(own.P, j * N * LANES, N, LANES)
        lowest = minimum(lowest, pivot * (1.0 / variance))
        total = total + error * error * inverse
        for i in range(j + 1, N):
            factor = load_packs(own.P, (i * N + j) * LANES, 1, LANES)[0] * inverse
            store_packs(own.P, i * N * LANES, load_packs(own.P, i * N * LANES, N, LANES) - factor * row, LANES)
            left = load_packs(own.e, i * LANES, 1, LANES)[0] - factor * error
            store_packs(own.e, i * LANES, vector(left), LANES)
    return total, lowest


@inline
def squared_lanes(at, epochs, e, own, accuracy):
    """Squared length of the error in each group of states, and the variance that the covariance gives it."""
    groups = accuracy.groups
    for g in range(groups):
        length = 0.0 * e[0]
        variance = 0.0 * e[0]
        for i in range(N):
            if accuracy.member[g * N + i]:
                error = load_packs(own.e, i * LANES, 1, LANES)[0]
                length = fused(error, error, length)
                variance = variance + load_packs(own.variance, i * LANES, 1, LANES)[0]
        store_lanes(accuracy.squared, at + g * epochs, groups * epochs, vector(length))
        store_lanes(accuracy.spread, at + g * epochs, groups * epochs, vector(variance))
