"""Process noise along a chain: a multiple of one matrix."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def noise_at(j, scale, Q, Q_all):
    """Process noise of the step that ends at state j of the stretch, whose scale is given."""
    return scale * Q


@inline
def noise_varies():
    """Whether the noise changes its shape from step to step."""
    return 0
