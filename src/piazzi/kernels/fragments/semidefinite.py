"""Rows r_i of a semidefinite A = sum of r_i^T r_i, whatever the order of the states and whatever its rank.

Cholesky's factors are as good as A itself while every pivot stands above rounding (Higham, Accuracy and Stability of Numerical
Algorithms, 2002, theorem 10.3).  Where one does not, its row is no longer small: of the size of the root of rounding.  Then the
rows are made anew, each time of the direction of which the largest share is left, so that what remains in the end is rounding.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def pivoted(rows, at):
    """Rows of the matrix at position `at`, in its place; directions that are rounding give rows of zeros."""
    whole, taken = scratch(N), scratch(N)
    for i in range(N):
        whole[i] = rows[at + i * N + i]
        taken[i] = 0.0
    for _ in range(N):
        most = LOST
        best = -1
        for i in range(N):
            if taken[i] == 0.0 and whole[i] > 0.0:
                left = rows[at + i * N + i] / whole[i]
                if left > most:
                    most = left
                    best = i
        if best >= 0:
            scale = 1.0 / sqrt(rows[at + best * N + best])
            for i in range(N):
                rows[at + best * N + i] = scale * rows[at + best * N + i] if taken[i] == 0.0 else 0.0
            taken[best] = 1.0
            row = load_vector(rows, at + best * N, N)
            for i in range(N):
                if taken[i] == 0.0:
                    store(rows, at + i * N, load_vector(rows, at + i * N, N) - rows[at + best * N + i] * row)
    for i in range(N):
        if taken[i] == 0.0:
            store(rows, at + i * N, 0.0 * load_vector(rows, at + i * N, N))  # what is not finite stays so


@inline
def root_of(A, rows, at):
    """N rows for a semidefinite A from position `at`."""
    store(rows, at, A)
    lost = 0.0
    for j in range(N):
        whole = rows[at + j * N + j]
        row = load_vector(rows, at + j * N, N)
        for k in range(j):
            row = row - rows[at + k * N + j] * load_vector(rows, at + k * N, N)
        store(rows, at + j * N, row)
        pivot = rows[at + j * N + j]
        lost = choose(LOST * whole, pivot, 1.0, lost)
        store(rows, at + j * N, (0.0 if pivot <= LOST * whole else 1.0 / sqrt(pivot)) * row)
        for k in range(j):
            rows[at + j * N + k] = 0.0
    if lost > 0.0:
        store(rows, at, A)
        pivoted(rows, at)
