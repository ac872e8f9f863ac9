"""The fixed-interval smoother: the extended Kalman filter forward, then once back along its own linearisation.

Back run the multipliers of Bryson and Frazier (1963) for the means, x_k - P_k lambda_k with x and P filtered and lambda from
later measurements, and their information for the covariances (see `marginals`).  On the linearised problem this is the
smoother of Rauch, Tung and Striebel (1965) without its division by the predicted covariance, which need not have an inverse.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def run_smoother(
    run: Run, p: Given, measured: Measured, prior: Belief, chain: Chain, smoothed: Smoothed, innovations: Innovations
) -> None:
    K, mean, covariance = run.epochs, smoothed.mean, smoothed.covariance
    x = load_vector(prior.mean, 0, N)
    P = load_matrix(prior.covariance, 0, N, N)
    Q = Q_matrix(run.Q)
    before = run.t_prior
    for k in range(K):
        if run.t[k] > before:
            x, F, Q_step = advance(before, run.t[k] - before, run.count[k], x, p, Q, run.scale[k])
            P = F @ P @ F.T + Q_step
            if k > 0:
                store(chain.Phi, (k - 1) * N * N, F)
                if noise_varies():
                    store(chain.Q_all, (k - 1) * N * N, Q_step)
        before = run.t[k]
        store(chain.x, k * N, x)
        store(chain.P_pred, k * N * N, symmetric(P))
        x, P = update_epoch(run, k, x, P, p, measured, innovations)
        P = symmetric(P)
        store(mean, k * N, x)
        store(covariance, k * N * N, P)
    linearize_rows(0, K, run, chain, p, measured)
    lam = unit(-1, N)
    for b in range(1, K):
        j = K - b
        P_j = load_matrix(chain.P_pred, j * N * N, N, N)
        lam = back_through_epoch(run.first_row[j] * M, run.first_row[j + 1] * M, lam, unit(-1, N), P_j, chain, 0.0)
        lam = lam @ load_matrix(chain.Phi, (j - 1) * N * N, N, N)
        filtered = load_vector(mean, (j - 1) * N, N)
        store(mean, (j - 1) * N, filtered - lam @ load_matrix(covariance, (j - 1) * N * N, N, N))
    marginal_covariances(0, K, run, chain, P, smoothed.keep_cross, covariance, smoothed.cross)
