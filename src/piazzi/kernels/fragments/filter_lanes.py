"""The extended Kalman filter over `LANES` runs together, which share times, stations and what is missing (nothing)."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def whiten_lanes(width, W, at, nu, H):
    """Innovation and Jacobian of one row times the inverse `W` of the Cholesky factor of R, in place, the last row first."""
    for back in range(width):
        i = width - 1 - back
        e = W[at + i * M + i] * load_packs(nu, i * LANES, 1, LANES)
        row = W[at + i * M + i] * load_packs(H, i * N * LANES, N, LANES)
        for j in range(i):
            e = e + W[at + i * M + j] * load_packs(nu, j * LANES, 1, LANES)
            row = row + W[at + i * M + j] * load_packs(H, j * N * LANES, N, LANES)
        store_packs(nu, i * LANES, e, LANES)
        store_packs(H, i * N * LANES, row, LANES)


@inline
def absorb_lanes(d, P, width, R, at, correlated, nu, H):
    """Correction `d` of the predicted states and covariances after one row, component by component, and its NIS.

    Joseph form for a scalar, as in `update_components`.
    """
    nis = 0.0 * d[0]
    for i in range(width):
        r = 1.0 if correlated else R[at + i * M + i]
        h = load_packs(H, i * N * LANES, N, LANES)
        Ph = h @ P
        S = h @ Ph + r
        e = load_packs(nu, i * LANES, 1, LANES)[0] - h @ d
        inverse = 1.0 / S
        K = inverse * Ph
        nis = nis + e * e * inverse
        d = d + e * K
        B = P - outer(Ph, K)
        P = mirrored(B + outer(K, r * K - h @ B))
    return d, P, nis


@entry
def filter_lanes(
    runs: int,
    K: int,
    J: int,
    t: Array,
    t_prior: float,
    count: Indices,
    scale: Array,
    first_row: Indices,
    z: Array,
    station: Indices,
    sensor: Indices,
    width: Indices,
    numbers: Array,
    R: Array,
    W: Array,
    correlated: Indices,
    p: Array,
    Q: Array,
    x0: Array,
    P0: Array,
    one: Array,
    at_truth: int,
    scored: int,
    truth: Array,
    member: Indices,
    groups: int,
    work: Array,
    mean: Array,
    covariance: Array,
    squared: Array,
    spread: Array,
    nees: Array,
    nis: Array,
    lowest: Array,
) -> None:
    row_z, nu, H = scratch(M_LANES), scratch(M_LANES), scratch(MN_LANES)
    ones = load_lanes(one, 0, 1, 0, LANES)[0]
    Q_unit = load_matrix(Q, 0, N, N)
    for group in range((runs + LANES - 1) // LANES):
        run = min(group * LANES, runs - LANES)
        x = load_lanes(x0, run * N, N, N, LANES)
        P = ones * load_matrix(P0, 0, N, N)
        least = ones
        before = t_prior
        for k in range(K):
            if t[k] > before:
                x, Phi = transition_lanes(before, t[k] - before, count[k], x, p)
                P = mirrored(Phi @ P @ Phi.T + scale[k] * Q_unit)
            before = t[k]
            if at_truth:
                x = load_lanes(truth, (run * K + k) * N, N, K * N, LANES)
            d = 0.0 * x
            P_pred = P
            for row in range(first_row[k], first_row[k + 1]):
                s = station[row]
                store_packs(row_z, 0, load_lanes(z, (run * J + row) * M, M, J * M, LANES), LANES)
                innovate_lanes(sensor[s], t[k], x, p, numbers, s * NUMBERS, row_z, nu, H)
                if correlated[s]:
                    whiten_lanes(width[s], W, s * M * M, nu, H)
                d_row, P_row, surprise = absorb_lanes(0.0 * x, P_pred, width[s], R, s * M * M, correlated[s], nu, H)
                if row == first_row[k]:
                    d = d_row
                    P = P_row
                else:
                    d, P, _ = absorb_lanes(d, P, width[s], R, s * M * M, correlated[s], nu, H)
                if scored:
                    store_lanes(nis, run * J + row, J, vector(surprise))
            if at_truth == 0:
                x = x + d
            if scored:
                e = x - load_lanes(truth, (run * K + k) * N, N, K * N, LANES)
                squared_lanes(run * groups * K + k, K, member, groups, e, P, work, squared, spread)
                q, pivot = nees_lanes(e, P, ones, work)
                least = minimum(least, pivot)
                store_lanes(nees, run * K + k, K, vector(q))
        store_lanes(mean, run * N, N, x)
        store_lanes(covariance, run * N * N, N * N, P)
        store_lanes(lowest, run, 1, vector(least))
