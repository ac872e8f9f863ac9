"""Which definitions equations need, as text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from piazzi.model.definitions import Definitions
from piazzi.model.functions import AT, Signature

if TYPE_CHECKING:
    from piazzi.model.model import Model

_WORD = re.compile(r"[A-Za-z]\w*")


def used_definitions(definitions: Mapping[str, str], texts: Iterable[str]) -> dict[str, str]:
    """Those definitions whose values occur in the texts, or in a definition that does, in their order."""
    known = {name: left for left in definitions for name in _WORD.findall(left)}
    waiting = [word for text in texts for word in _WORD.findall(text)]
    found: set[str] = set()
    while waiting:
        left = known.get(waiting.pop())
        if left is not None and left not in found:
            found.add(left)
            waiting += _WORD.findall(definitions[left])
    return {left: text for left, text in definitions.items() if left in found}


def redefined(definitions: Mapping[str, str], own: Mapping[str, str]) -> dict[str, str]:
    """The definitions without those of which `own` gives a value anew, followed by `own`."""
    names = {name for left in own for name in _WORD.findall(left)}
    kept = {left: text for left, text in definitions.items() if names.isdisjoint(_WORD.findall(left))}
    return {**kept, **own}


def remaining(definitions: Definitions, own: Mapping[str, str], texts: Iterable[str]) -> list[Any]:
    """Definitions of a model that the texts or `own` need, without those that `own` gives a value anew; then `own`."""
    names = {name for left in own for name in _WORD.findall(left)}
    kept = {", ".join(d.provides): d for d in definitions if names.isdisjoint(d.provides)}
    used = used_definitions({left: " ".join(sorted(d.needs)) for left, d in kept.items()}, [*texts, *own.values()])
    return [*(d for left, d in kept.items() if left in used), *own.items()]


IDLE = Signature("idle", 0, 1, ())  # of a function that nothing calls, which keeps its place in the data


def motion_of(model: Model) -> Model:
    """The model without its sensors, and without what only they need."""
    users = (*model.dynamics, *(name for _, name in model.events))
    return _calling(replace(model, sensors=(), definitions=remaining(model.definitions, {}, users)))


def sensors_of(model: Model) -> Model:
    """The model with its sensors alone: at rest, unless one of them looks along the motion."""
    if any(AT in sensor.calls for sensor in model.sensors):
        return model
    users = [name for sensor in model.sensors for name in sorted(sensor.free_names)]
    still = ("0",) * len(model.states)
    return _calling(replace(model, dynamics=still, events=(), definitions=remaining(model.definitions, {}, users)))


def _calling(model: Model) -> Model:
    """The model that says nothing of functions that it does not call."""
    called = {call.function for d in model.definitions for call in d.calls}
    called |= {function for sensor in model.sensors for function in sensor.calls}
    places = model.slots
    idle = {name: replace(IDLE, shared=f"data {places[name]}") for name, _ in model.functions if name not in called}
    known = {name: idle.get(name) or replace(signature, shared=f"data {places[name]}") for name, signature in model.functions}
    return replace(model, functions=known)
