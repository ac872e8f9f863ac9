"""Two small helpers with matrices."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def symmetric(P):
    """The symmetric part; rounding must not grow into an asymmetry."""
    return 0.5 * (P + P.T)


@inline
def Q_matrix(Q):
    """The process noise that an entry is given."""
    return load_matrix(Q, 0, N, N)
