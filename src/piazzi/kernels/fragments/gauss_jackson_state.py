"""What a multi-step method carries beside the state where no derivative is wanted: zeros, which cost nothing."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def first_derivative():
    """Nothing."""
    return 0.0


@inline
def rates_of(t, x, R, p):
    """Rates of the state."""
    return rate(t, x, p), 0.0


@inline
def stepped(t, h, x, R, p):
    """The state `h` seconds later, by one step of order 8."""
    return substep(t, h, x, p), 0.0


@inline
def rows_at(F, at):
    """Nothing."""
    return 0.0


@inline
def keep_rows(F, at, G):
    """Nothing is kept."""


@inline
def driven_rows(K):
    """Nothing."""
    return 0.0


@inline
def position_rows(R):
    """Nothing."""
    return 0.0


@inline
def doubled_rows(V):
    """Nothing."""
    return 0.0


@inline
def joined_rows(Q, V):
    """Nothing."""
    return 0.0


@inline
def begin_derivatives(kept):
    """Nothing is kept."""


@inline
def write_derivative(Phi, k, R, kept):
    """Nothing is written."""


@inline
def write_last(Phi, R, kept):
    """Nothing is written."""
