"""Covariances of all states given all measurements: what is known of each from before it and from after it.

Forward, the chain has the covariance of each state given the measurements up to it.  Back, the information matrix of the later
ones is a sum of congruences, and is taken in as that many more measurements (Fraser and Potter 1969, without their inverses).
Rauch, Tung and Striebel divide by the predicted covariance instead, which fails silently where a system without process noise
forgets its past: P_pred turns singular.
"""

from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def next_direction(rows, j):
    """Row r_j of A = sum of r_j^T r_j, by Cholesky, in its place, of `LANES` matrices; and 1 where its pivot is lost.

    Those before it are there already.
    """
    whole = load_packs(rows, (j * N + j) * LANES, 1, LANES)[0]
    row = load_packs(rows, j * N * LANES, N, LANES)
    for k in range(j):
        row = row - load_packs(rows, (k * N + j) * LANES, 1, LANES)[0] * load_packs(rows, k * N * LANES, N, LANES)
    store_packs(rows, j * N * LANES, row, LANES)
    pivot = load_packs(rows, (j * N + j) * LANES, 1, LANES)[0]
    h = choose(pivot, LOST * whole, 1.0 / sqrt(pivot), 0.0) * row
    store_packs(rows, j * N * LANES, h, LANES)
    return h, choose(LOST * whole, pivot, 1.0, 0.0)


@inline
def information_before(first, last, chain, Y):
    """Information about a state with that of its own measurements added."""
    for c in range(first, last):
        if not isnan(chain.nu[c]):
            h = load_vector(chain.H, c * N, N)
            Y = Y + outer(h, h)
    return Y


@inline
def marginalize_noise(Y, T, noise, amount, keep_cross):
    """Information about a state as information about the one it had been without its process noise; T collects the steps.

    One direction g of the noise at a time: (I - k g^T) Y (I - g k^T) + k k^T with k = Y g / (1 + g^T Y g).
    """
    for i in range(N):
        if noise[i * N + i] > 0.0:
            g = sqrt(amount) * load_vector(noise, i * N, N)
            u = g @ Y
            k = (1.0 / (1.0 + g @ u)) * u
            B = Y - outer(u, k)
            Y = B + outer(k, k - g @ B)
            if keep_cross:
                T = T - outer(T @ g, k)
    return Y, T


@inline
def updated_covariance(P, h):
    """Covariances after one measurement of unit noise, in Joseph form."""
    Ph = h @ P
    K = (1.0 / (h @ Ph + 1.0)) * Ph
    B = plus_outer(P, -Ph, K)
    return plus_outer(B, K, K - h @ B)


@inline
def add_information(at, stride, own, covariance, rows, lost):
    """Covariances of `LANES` states, at `at`, `at + stride`, ..., in the place of their information, in Joseph form.

    Each covariance given all measurements so far, in `own`, takes the information of later ones in as measurements of unit
    noise: its directions, one after the other as they become known.  States whose information lacks directions to rounding are
    done by themselves.
    """
    for i in range(N):
        store_packs(rows, i * N * LANES, load_lanes(covariance, at + i * N, N, stride, LANES), LANES)
    P = load_matrices(own, 0, N, N, stride, LANES)
    first = load_packs(rows, 0, 1, LANES)[0]
    missing = choose(first, first, 1.0, 0.0)  # zero in every lane
    for j in range(N):
        h, lacks = next_direction(rows, j)
        missing = missing + lacks
        P = updated_covariance(P, h)
    store_packs(lost, 0, vector(missing), LANES)
    lanes = LANES if stride > 0 else 1
    for lane in range(lanes):
        if lost[lane] > 0.0:
            store(rows, lane * NN, load_matrix(covariance, at + lane * stride, N, N))
    store_lanes(covariance, at, stride, symmetric(P))
    for lane in range(lanes):
        if lost[lane] > 0.0:
            add_information_pivoted(rows, lane * NN, own, lane * stride, covariance, at + lane * stride)


@inline
def add_information_pivoted(information, from_here, own, own_at, covariance, at):
    """As `add_information`, of one state, by factors with pivots."""
    rows = scratch(NN)
    root_of(load_matrix(information, from_here, N, N), rows, 0)
    P = load_matrix(own, own_at, N, N)
    for j in range(N):
        P = updated_covariance(P, load_vector(rows, j * N, N))
    store(covariance, at, symmetric(P))


@inline
def marginal_covariances(a, W, run, chain, P_last, keep_cross, covariance, cross):
    """Covariance of each state a ... a + W - 1 into its place; of state k with state k + 1 into `cross` where wanted.

    Information is carried back from state to state, and kept where the covariance will be; what it does to the covariance of
    each state depends on no other state, so `LANES` of them are worked on together.  A state's own measurements are no part
    of it: a rough one beside precise ones of later states would be lost in the sum.
    """
    first_row, base, Q = run.first_row, run.first_row[a], Q_matrix(run.Q)
    rows, own, g, lost = scratch(NN_LANES), scratch(NN_LANES), scratch(NN), scratch(LANES)
    Y = 0.0 * P_last
    root_of(Q, g, 0)
    for b in range(1, W):
        j = W - 1 - b
        k = a + j
        Y = information_before((first_row[k + 1] - base) * M, (first_row[k + 2] - base) * M, chain, Y)
        amount = run.scale[k + 1]
        if noise_varies():
            root_of(noise_at(j + 1, amount, Q, chain.Q_all), g, 0)
            amount = 1.0
        Y, T = marginalize_noise(Y, identity(N), g, amount, keep_cross)
        F = load_matrix(chain.Phi, j * N * N, N, N)
        Y = symmetric(F.T @ Y @ F)
        store(covariance, k * N * N, Y)
        if keep_cross:
            store(cross, k * N * N, T @ F)
    j = 0
    while j < W - 1:
        together = LANES if j + LANES < W else 1
        for lane in range(together):
            first, last = first_row[a + j + lane], first_row[a + j + lane + 1]
            P = load_matrix(chain.P_pred, (j + lane) * N * N, N, N)
            _, P, _ = update_deviation((first - base) * M, (last - base) * M, unit(-1, N), P, chain)
            store(own, lane * N * N, P)
        add_information((a + j) * N * N, N * N if together > 1 else 0, own, covariance, rows, lost)
        j += together
    store(covariance, (a + W - 1) * N * N, symmetric(P_last))
    if keep_cross:
        for k in range(a, a + W - 1):
            P = load_matrix(covariance, k * N * N, N, N)
            store(cross, k * N * N, P @ load_matrix(cross, k * N * N, N, N).T)
