"""The constants of equations, the limits, and the tree a text becomes; the functions are in `functions`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias, TypeVar

CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})

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
T = TypeVar("T")


def fold(node: Node, combine: Callable[[Node, list[T]], T]) -> T:
    """The value of a tree from the bottom up: `combine` makes that of a node from those of its children, in their order.

    What is done with a tree differs in `combine` alone: numbers, arrays, bounds and SymPy expressions come of one walk.
    """
    match node:
        case Number() | Name():
            children: tuple[Node, ...] = ()
        case Call(arguments=arguments):
            children = arguments
        case Negative(operand=operand):
            children = (operand,)
        case Sum(terms=pairs) | Product(factors=pairs):
            children = tuple(child for _, child in pairs)
        case Power(base=base, exponent=exponent):
            children = (base, exponent)
    return combine(node, [fold(child, combine) for child in children])
