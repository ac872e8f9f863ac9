"""Measurement update with all components of a row at once."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def noise(nu, R, at, i, j):
    """Entry of R with the missing components made independent of the others."""
    if isnan(nu[i]) or isnan(nu[j]):
        return 1.0 if i == j else 0.0
    return R[at + i * M + j]


@inline
def update_row(d, P, s, measured, own):
    """Correction `d` of the predicted state and covariance after one row of station s, linearised where `own` was.

    Gain by a Cholesky solve, S = L L^T; `work` holds L, then the rows of K^T.  Joseph form, row by row:
    with B = P (I - K H)^T, P' = B + sum_i K_i (sum_j R_ij K_j - H_i B)^T.
    """
    at, R = s * M * M, measured.R
    nu, H, work = own.nu, own.H, own.work
    for i in range(M):
        if isnan(nu[i]):
            store(H, i * N, unit(-1, N))
    for i in range(M):
        Ph = load_vector(H, i * N, N) @ P
        for j in range(i + 1):
            S = Ph @ load_vector(H, j * N, N) + noise(nu, R, at, i, j)
            for k in range(j):
                S = S - work[i * M + k] * work[j * M + k]
            work[i * M + j] = sqrt(S) if i == j else S / work[j * M + j]
        for k in range(i):
            Ph = Ph - work[i * M + k] * load_vector(work, M * M + k * N, N)
        store(work, M * M + i * N, (1.0 / work[i * M + i]) * Ph)
    for b in range(M):
        i = M - 1 - b
        K = load_vector(work, M * M + i * N, N)
        for k in range(i + 1, M):
            K = K - work[k * M + i] * load_vector(work, M * M + k * N, N)
        store(work, M * M + i * N, (1.0 / work[i * M + i]) * K)
    B = P
    step = unit(-1, N)
    for i in range(M):
        K = load_vector(work, M * M + i * N, N)
        h = load_vector(H, i * N, N)
        if not isnan(nu[i]):
            step = step + (nu[i] - h @ d) * K
        B = B - outer(h @ P, K)
    P_new = B
    for i in range(M):
        K = load_vector(work, M * M + i * N, N)
        row = -(load_vector(H, i * N, N) @ B)
        for j in range(M):
            row = row + noise(nu, R, at, i, j) * load_vector(work, M * M + j * N, N)
        P_new = P_new + outer(K, row)
    return d + step, P_new
