"""What a multi-step method carries beside the state: the rows of its derivative, in the same sums."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def first_derivative():
    """The derivative at the start of an arc."""
    return identity_rows()


@inline
def rates_of(t, x, R, p):
    """Rates of the state and of the rows."""
    return rate_jacobian(t, x, R, p)


@inline
def stepped(t, h, x, R, p):
    """State and rows `h` seconds later, by one step of order 8."""
    return substep_jacobian(t, h, x, R, p)


@inline
def rows_at(F, at):
    """Rates of the rows in a slot of the history."""
    return load_matrix(F, at + DRIVEN, DRIVEN, N)


@inline
def keep_rows(F, at, G):
    """Write them there."""
    store(F, at + DRIVEN, G)


@inline
def driven_rows(K):
    """Rows of what the rates drive."""
    return driven_of(K)


@inline
def position_rows(R):
    """Rows of the positions."""
    return positions_of(R)


@inline
def doubled_rows(V):
    """For each position, the row that drives it."""
    return doubled_of(V)


@inline
def joined_rows(Q, V):
    """All rows."""
    return joined_of(Q, V)


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
