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
