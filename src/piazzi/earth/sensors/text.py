"""Vectors as text of the language: three names each, `NAME_x`, `NAME_y` and `NAME_z`."""

from __future__ import annotations

import re
from collections.abc import Mapping

AXES = "xyz"
_WORD = re.compile(r"(?<![\w.])[A-Za-z]\w*")


def names(vector: str, velocity: bool = False) -> str:
    """The left side of a definition: the three components, with `velocity` its six."""
    parts = [f"{vector}_{a}" for a in AXES] + ([f"{vector}_v{a}" for a in AXES] if velocity else [])
    return ", ".join(parts)


def difference(vector: str, end: str, start: str) -> dict[str, str]:
    """The vector from one place to another."""
    return {f"{vector}_{a}": f"{end}_{a} - {start}_{a}" for a in AXES}


def distance(end: str, start: str) -> str:
    """How far two places are apart."""
    return "sqrt(" + " + ".join(f"({end}_{a} - {start}_{a})**2" for a in AXES) + ")"


def length(vector: str) -> str:
    """The length of a vector."""
    return "sqrt(" + " + ".join(f"{vector}_{a}**2" for a in AXES) + ")"


def dot(one: str, other: str) -> str:
    """The scalar product; a name with a ``v`` at its end, such as ``sat_v``, is that of a velocity."""
    return " + ".join(f"{component(one, a)}*{component(other, a)}" for a in AXES)


def component(vector: str, axis: str) -> str:
    """The name of a component: of ``sat`` it is ``sat_x``, of ``sat_v`` it is ``sat_vx``."""
    return f"{vector}{axis}" if vector.endswith("_v") else f"{vector}_{axis}"


def renamed(definitions: Mapping[str, str], prefix: str, given: Mapping[str, str]) -> dict[str, str]:
    """Definitions of a formula with a prefix to their names, and with other text for some of the arguments."""
    new = {name: f"{prefix}_{name}" for name in definitions} | {name: f"({text})" for name, text in given.items()}
    return {new[name]: _WORD.sub(lambda found: new.get(found[0], found[0]), text) for name, text in definitions.items()}
