"""Measurement update one component at a time; a full R is decorrelated first."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def update_row(d, P, s, measured, own):
    """Correction `d` of the predicted state and covariance after one row of station s, linearised where `own` was.

    Joseph form for a scalar: with B = P (I - K H)^T, P' = (I - K H) B + K r K^T = B + K (r K - H B)^T.
    """
    at, correlated = s * M * M, measured.correlated[s]
    nu, H = own.nu, own.H
    if correlated:
        decorrelate(nu, H, 0, measured.R, at, own.work)
    for i in range(M):
        if not isnan(nu[i]):
            r = 1.0 if correlated else measured.R[at + i * M + i]
            h = load_vector(H, i * N, N)
            Ph = h @ P
            S = h @ Ph + r
            K = (1.0 / S) * Ph
            d = d + (nu[i] - h @ d) * K
            B = P - outer(Ph, K)
            P = B + outer(K, r * K - h @ B)
    return d, P
