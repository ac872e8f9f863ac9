"""Process noise along a chain: a matrix of its own for every step."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def noise_at(j, scale, Q, Q_all):
    """Process noise of the step that ends at state j of the stretch."""
    return load_matrix(Q_all, (j - 1) * N * N, N, N)


@inline
def noise_varies():
    """Whether the noise changes its shape from step to step."""
    return 1
