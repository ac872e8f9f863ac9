"""An arc of a multi-step method that ends before a step in which an event may be passed."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def watching(p):
    """What the model is told, with the side of each event."""
    return Beside(p.parameters, p.manoeuvres, p.data, scratch(EVENTS), scratch(EVENTS_WORK))


@inline
def watch_from(t, h, x, own):
    """The sides on which the arc begins."""
    begin(t, h, x, own)


@inline
def may_pass(t, h, x, own):
    """Whether an event can lie in the step that ends in `x`; where none does, the next one begins there."""
    clock = scratch(2)
    clock[0] = t
    clock[1] = h
    events_into(t + h, x, own, 2 * EVENTS)
    clear = is_clear(own.work, own.work, 2 * EVENTS, own.sides, clock)
    arrive(own)
    return clear == 0
