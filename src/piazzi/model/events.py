"""Events: definitions of a model whose zero ends a step of the integrator, such as the edge of a shadow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from piazzi.model.definitions import TIME, name_of, needed
from piazzi.text import nearest

if TYPE_CHECKING:
    import sympy as sp

LEAST = 1e-300  # of an event's value on its side: `sign` and `max` see that it is not zero


def events_of(given: Any) -> tuple[tuple[str, str], ...]:
    """Names of events with the definition of each, from a mapping, or from names of definitions alone."""
    if isinstance(given, str):
        given = [given]
    pairs = given.items() if isinstance(given, Mapping) else [p if isinstance(p, tuple) else (p, p) for p in given]
    out = []
    for name, definition in pairs:
        if not isinstance(definition, str) and not hasattr(definition, "free_symbols"):
            raise ValueError(f"event {str(name)!r} is {definition!r}; it must be the name of a definition")
        out.append((name_of(name, "event"), str(definition).strip()))
    return tuple(out)


def check_events(model: Any) -> None:
    """Raise ValueError unless every event is a definition of the model that passes through zero along an orbit."""
    defined = {name for d in model.definitions for name in d.provides}
    owners = {name: sensor.name for sensor in model.sensors for d in sensor.definitions for name in d.provides}
    seen: dict[str, str] = {}
    for event, name in model.events:
        if model.discrete:
            raise ValueError(f"event {event!r}: a model that is a step has no orbit between its epochs")
        if name in owners:
            raise ValueError(
                f"event {event!r} names {name!r}, which sensor {owners[name]!r} defines; it must be a definition of the model"
            )
        if name not in defined:
            raise ValueError(f"event {event!r} names {name!r}, which is no definition{nearest(name, sorted(defined))}")
        if name in seen:
            raise ValueError(f"events {seen[name]!r} and {event!r} both name {name!r}")
        seen[name] = event
        if not needed([name], model.definitions) & {*model.names, TIME}:
            raise ValueError(f"event {event!r}: {name!r} is constant: it depends on no state and no time")


def on_side(value: sp.Expr, side: sp.Symbol) -> sp.Expr:
    """The value of an event as equations of motion see it on one side of its zero, 1 or -1; as it is where `side` is 0.

    Stages of a step that reach beyond the zero see what is just before it, so that the step is smooth.
    """
    import sympy as sp

    return side * sp.Max(side * value, sp.Float(LEAST)) + (1 - side**2) * value
