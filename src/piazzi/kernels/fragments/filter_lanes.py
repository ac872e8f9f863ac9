"""The extended Kalman filter over `LANES` runs together, which share times, stations and what is missing (nothing)."""

from piazzi.kernels.fragments.score_lanes import nees_lanes, ones, squared_lanes, store_errors
from piazzi.kernels.fragments.step_lanes import transition_lanes
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def whiten_lanes(s, stations, nu, H):
    """Innovation and Jacobian of one row times the inverse W of the Cholesky factor of R, in place, the last row first."""
    at, W = s * M * M, stations.W
    for back in range(stations.width[s]):
        i = stations.width[s] - 1 - back
        e = W[at + i * M + i] * load_packs(nu, i * LANES, 1, LANES)
        row = W[at + i * M + i] * load_packs(H, i * N * LANES, N, LANES)
        for j in range(i):
            e = e + W[at + i * M + j] * load_packs(nu, j * LANES, 1, LANES)
            row = row + W[at + i * M + j] * load_packs(H, j * N * LANES, N, LANES)
        store_packs(nu, i * LANES, e, LANES)
        store_packs(H, i * N * LANES, row, LANES)


@inline
def update_lanes(d, P, s, stations, nu, H):
    """Correction `d` of the predicted states and covariances after one row of station s, by components, and its NIS.

    Joseph form for a scalar, as in `update_components`.
    """
    nis = 0.0 * d[0]
    for i in range(stations.width[s]):
        r = 1.0 if stations.correlated[s] else stations.R[(s * M + i) * M + i]
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
    run: Run, p: Given, stations: Stations, prior: Belief, samples: Samples, at_truth: int, ends: Ends, accuracy: Accuracy
) -> None:
    z, nu, H = scratch(M_LANES), scratch(M_LANES), scratch(MN_LANES)
    own = Errors(scratch(N_LANES), scratch(NN_LANES), scratch(N_LANES))
    one = ones()
    K, J = run.epochs, samples.rows
    Q = load_matrix(run.Q, 0, N, N)
    for group in range((samples.many + LANES - 1) // LANES):
        r = min(group * LANES, samples.many - LANES)
        x = load_lanes(prior.mean, 0, N, 0, LANES)
        P = one * load_matrix(prior.covariance, 0, N, N)
        least = one
        before = run.t_prior
        for k in range(K):
            if run.t[k] > before:
                x, Phi = transition_lanes(before, run.t[k] - before, run.count[k], x, p)
                P = mirrored(Phi @ P @ Phi.T + run.scale[k] * Q)
            before = run.t[k]
            if at_truth:
                x = load_lanes(samples.truth, (r * K + k) * N, N, K * N, LANES)
            d = 0.0 * x
            P_pred = P
            for row in range(run.first_row[k], run.first_row[k + 1]):
                s = stations.station[row]
                store_packs(z, 0, load_lanes(samples.z, (r * J + row) * M, M, J * M, LANES), LANES)
                innovate_lanes(stations.sensor[s], run.t[k], x, p, stations.numbers, s * NUMBERS, z, nu, H)
                if stations.correlated[s]:
                    whiten_lanes(s, stations, nu, H)
                d_row, P_row, nis = update_lanes(0.0 * x, P_pred, s, stations, nu, H)
                if row == run.first_row[k]:
                    d = d_row
                    P = P_row
                else:
                    d, P, _ = update_lanes(d, P, s, stations, nu, H)
                store_lanes(accuracy.nis, r * J + row, J, vector(nis))
            if at_truth == 0:
                x = x + d
            e = x - load_lanes(samples.truth, (r * K + k) * N, N, K * N, LANES)
            store_errors(e, P, own)
            squared_lanes(r * accuracy.groups * K + k, K, e, own, accuracy)
            nees, pivot = nees_lanes(one, own)
            least = minimum(least, pivot)
            store_lanes(accuracy.nees, r * K + k, K, vector(nees))
        store_lanes(ends.mean, r * N, N, x)
        store_lanes(ends.covariance, r * N * N, N * N, P)
        store_lanes(accuracy.lowest, r, 1, vector(least))
