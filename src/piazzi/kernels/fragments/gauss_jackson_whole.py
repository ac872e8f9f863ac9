"""What is written of the rows of an arc: derivatives by its first state."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def begin_derivatives(kept):
    """Nothing is kept."""


@inline
def write_derivative(W, k, R, kept):
    """The derivative of epoch k."""
    store(W, k * N * N, complete(R))


@inline
def write_last(W, R, kept):
    """That of the state at which an arc ends early."""
    store(W, 0, complete(R))
