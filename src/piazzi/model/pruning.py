"""Which definitions equations need, as text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from piazzi.model.definitions import Definitions

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
