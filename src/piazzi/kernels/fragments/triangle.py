"""Roots of covariances: rows r_i with P = sum of r_i^T r_i."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def triangularize_rows(rows, many):
    """The same P from N rows, an upper triangle, by Householder's reflections; what is below is used up."""
    for j in range(N):
        size = 0.0
        for i in range(j, many):
            size += rows[i * N + j] * rows[i * N + j]
        if size != 0.0:  # NaN too, so that it shows
            first = rows[j * N + j]
            last = -sqrt(size) if first > 0.0 else sqrt(size)
            rows[j * N + j] = first - last
            total = unit(-1, N)
            for i in range(j, many):
                total = total + rows[i * N + j] * load_vector(rows, i * N, N)
            total = (1.0 / (last * (first - last))) * total
            for i in range(j, many):
                weight = rows[i * N + j]
                store(rows, i * N, load_vector(rows, i * N, N) + weight * total)
                rows[i * N + j] = 0.0
            rows[j * N + j] = last


@inline
def keep_root(rows, U):
    """The first N rows as the root `U`."""
    store(U, 0, load_matrix(rows, 0, N, N))


@inline
def covariance_of(U):
    """P of a root."""
    P = outer(load_vector(U, 0, N), load_vector(U, 0, N))
    for i in range(1, N):
        P = P + outer(load_vector(U, i * N, N), load_vector(U, i * N, N))
    return symmetric(P)
