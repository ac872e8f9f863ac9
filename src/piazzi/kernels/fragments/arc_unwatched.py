"""An arc of a multi-step method that has no events to look for."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def watching(p):
    """What the model is told."""
    return p


@inline
def watch_from(t, h, x, p):
    """Nothing to look for."""


@inline
def may_pass(t, h, x, p):
    """Never."""
    return False
