"""What is written of the rows of an arc: the transition matrix of each interval between epochs."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@outlined
def quotient(A, B):
    """X with X B = A, by elimination with the largest pivots."""
    left, right = scratch(NN), scratch(NN)
    store(left, 0, B.T)
    store(right, 0, A.T)
    for i in range(N):
        best = i
        for j in range(i + 1, N):
            if fabs(left[j * N + i]) > fabs(left[best * N + i]):
                best = j
        weight = 1.0 / left[best * N + i]
        a, b = weight * load_vector(left, best * N, N), weight * load_vector(right, best * N, N)
        store(left, best * N, load_vector(left, i * N, N))
        store(right, best * N, load_vector(right, i * N, N))
        store(left, i * N, a)
        store(right, i * N, b)
        for j in range(N):
            if j != i:
                factor = left[j * N + i]
                store(left, j * N, load_vector(left, j * N, N) - factor * a)
                store(right, j * N, load_vector(right, j * N, N) - factor * b)
    return load_matrix(right, 0, N, N).T


@inline
def begin_derivatives(kept):
    """The whole derivative at the start."""
    store(kept, 0, complete(identity_rows()))


@inline
def write_derivative(Phi, k, R, kept):
    """The transition matrix from epoch k - 1, whose derivative by the start was kept, to epoch k; that one is kept instead."""
    whole = complete(R)
    store(Phi, (k - 1) * N * N, quotient(whole, load_matrix(kept, 0, N, N)))
    store(kept, 0, whole)


@inline
def write_last(Phi, R, kept):
    """The transition matrix from the last epoch that was written."""
    store(Phi, 0, quotient(complete(R), load_matrix(kept, 0, N, N)))
