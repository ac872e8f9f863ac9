"""Other names, or text in their place, for names that equations use."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from piazzi.model.definitions import Definition


def renamed(equation: str, names: Mapping[str, str]) -> str:
    """The equation with other names for some of its own; an equation holds nothing but names, numbers and signs."""
    return re.sub(r"(?<![\w.])[A-Za-z]\w*", lambda found: names.get(found[0], found[0]), equation)


def with_names(d: Definition, names: Mapping[str, str]) -> Definition:
    """The definition with other names for some that its texts use."""
    inner = tuple(with_names(own, names) for own in d.inner)
    return replace(d, texts=tuple(renamed(text, names) for text in d.texts), inner=inner)
