"""Measurements with unit noise."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def decorrelate(nu, H, out, R, at, L):
    """Divide innovation and Jacobian of one row by the Cholesky factor of R, in place; missing components are left out."""
    for i in range(M):
        if isnan(nu[out + i]):
            for j in range(i):
                L[i * M + j] = 0.0
            L[i * M + i] = 1.0
        else:
            for j in range(i + 1):
                s = 0.0 if isnan(nu[out + j]) else R[at + i * M + j]
                for k in range(j):
                    s = s - L[i * M + k] * L[j * M + k]
                L[i * M + j] = sqrt(s) if i == j else s / L[j * M + j]
            h = load_vector(H, (out + i) * N, N)
            for j in range(i):
                if not isnan(nu[out + j]):
                    nu[out + i] = nu[out + i] - L[i * M + j] * nu[out + j]
                    h = h - L[i * M + j] * load_vector(H, (out + j) * N, N)
            nu[out + i] = nu[out + i] / L[i * M + i]
            store(H, (out + i) * N, (1.0 / L[i * M + i]) * h)
