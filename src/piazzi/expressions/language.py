"""The vocabulary of equations: the allowed functions and constants, the limits, and the tree a text becomes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

#: Allowed functions and how many arguments each takes; `min` and `max` take that many or more.
FUNCTIONS: Mapping[str, int] = MappingProxyType(
    dict.fromkeys(("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs", "sign"), 1)
    | dict.fromkeys(("atan2", "hypot", "min", "max"), 2)
)
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})
VARIADIC = frozenset({"min", "max"})

MAX_LENGTH = 10_000
MAX_NAME = 64
MAX_DEPTH = 50
#: Integers stay below 10**308, so that every number of an equation is also a finite double.
MAX_DIGITS = 308
#: SymPy compares the arguments of min and max pair by pair: 20 take seconds.
MAX_EXTREMES = 20


@dataclass(frozen=True, slots=True)
class Number:
    """A literal: an integer is exact, a float is the double that was written."""

    value: int | float
    column: int


@dataclass(frozen=True, slots=True)
class Name:
    """A free name, or one of `CONSTANTS`."""

    name: str
    column: int


@dataclass(frozen=True, slots=True)
class Call:
    """An allowed function with the right number of arguments."""

    function: str
    arguments: tuple[Node, ...]
    column: int


@dataclass(frozen=True, slots=True)
class Negative:
    """The operand with its sign changed."""

    operand: Node
    column: int


@dataclass(frozen=True, slots=True)
class Sum:
    """A chain of terms, each with True where it is subtracted."""

    terms: tuple[tuple[bool, Node], ...]
    column: int


@dataclass(frozen=True, slots=True)
class Product:
    """A chain of factors, each with True where it divides."""

    factors: tuple[tuple[bool, Node], ...]
    column: int


@dataclass(frozen=True, slots=True)
class Power:
    """A base to an exponent."""

    base: Node
    exponent: Node
    column: int


Node: TypeAlias = Number | Name | Call | Negative | Sum | Product | Power
