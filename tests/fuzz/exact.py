"""Linear Gaussian estimation in many digits: the joint covariance of all states, less what each measurement says."""

import mpmath as mp
import numpy as np


def posterior(prior, A, Q, H, R, values, digits=120):
    """Means (K, K, n) and covariances (K, K, n, n): [j, k] of state k given the epochs 0 to j.

    `prior`, `Q` and `R` are diagonals of covariances, `A` (n, n) and `H` (m, n) those of every epoch, `values` (K, m); the
    prior mean is zero.  Nothing is inverted, so that any of them may be singular.
    """
    K, n = len(values), len(prior)
    with mp.workdps(digits):
        A, H = mp.matrix(A.tolist()), mp.matrix(H.tolist())
        P, x = mp.zeros(K * n), mp.zeros(K * n, 1)
        own = mp.diag([mp.mpf(float(v)) for v in prior])
        for k in range(K):
            if k:
                own = A * own * A.T + mp.diag([mp.mpf(float(v)) for v in Q])
            block = own
            for j in range(k, K):  # Cov(x_j, x_k) = A^(j - k) Cov(x_k)
                P[j * n : (j + 1) * n, k * n : (k + 1) * n] = block
                P[k * n : (k + 1) * n, j * n : (j + 1) * n] = block.T
                block = A * block
        means, covariances = np.empty((K, K, n)), np.empty((K, K, n, n))
        for j in range(K):
            for i in range(H.rows):
                if np.isnan(values[j, i]):
                    continue
                Ph = P[:, j * n : (j + 1) * n] * H[i, :].T
                S = (H[i, :] * Ph[j * n : (j + 1) * n, :])[0] + mp.mpf(float(R[i]))
                x += Ph * ((mp.mpf(float(values[j, i])) - (H[i, :] * x[j * n : (j + 1) * n, :])[0]) / S)
                P -= Ph * Ph.T / S
            for k in range(K):
                part = slice(k * n, (k + 1) * n)
                means[j, k] = [float(v) for v in x[part, :]]
                covariances[j, k] = np.array(P[part, part].tolist(), dtype=float)
    return means, covariances
