"""The language of equations: its constants and limits, its one error, its tokens, and the tree that a text becomes."""

from __future__ import annotations

import keyword
import math
import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, TypeAlias, TypeVar

from piazzi.text import printable

CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": math.pi})

MAX_LENGTH = 10_000
MAX_NAME = 64
MAX_DEPTH = 50
#: Integers stay below 10**308, so that every number of an equation is also a finite double.
MAX_DIGITS = 308
#: SymPy compares the arguments of min and max pair by pair: 20 take seconds.
MAX_EXTREMES = 20
T = TypeVar("T")
EXCERPT = 60
QUOTE = 24
HINTS = {
    "^": "write ** for powers",
    "=": "an equation is written as its right-hand side alone",
    ".": "attributes are not allowed",
    "[": "subscripts are not allowed",
    "]": "subscripts are not allowed",
    "'": "strings are not allowed",
    '"': "strings are not allowed",
    "<": "comparisons are not allowed",
    ">": "comparisons are not allowed",
}
TOKEN = re.compile(
    r"(?P<space>[ \t\r\n]+)|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[^\W\d]\w*)|(?P<operator>\*\*|[-+*/(),])"
)


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


class ExpressionError(ValueError):
    """An equation was refused; its one-line message says where, in which text, and what was wrong.

    Parameters
    ----------
    problem : str
        What was wrong, on one line.
    text : str
        The whole equation.
    column : int
        Where in `text`, counted from 1.
    """

    def __init__(self, problem: str, text: str, column: int = 1) -> None:
        super().__init__(problem, text, column)  # these are also what pickle calls the class with
        self.problem = problem
        self.text = text
        self.column = column

    def __str__(self) -> str:
        """Return the message: one printable line, whatever the text holds."""
        return f"column {self.column} of '{_excerpt(self.text, self.column)}': {self.problem}"


def quote(text: str) -> str:
    """Return `text` in quotes, escaped and short enough to stand inside a message."""
    return f"'{printable(text if len(text) <= QUOTE else text[:QUOTE] + '...')}'"


def _excerpt(text: str, column: int) -> str:
    start = max(0, min(column - 1 - EXCERPT // 2, len(text) - EXCERPT))
    end = start + EXCERPT
    return ("..." if start else "") + printable(text[start:end]) + ("..." if end < len(text) else "")


class Token(NamedTuple):
    """A piece of the text: its kind ("number", "name", "operator" or "end"), the piece, its column from 1."""

    kind: str
    piece: str
    column: int


def tokenize(text: str) -> list[Token]:
    """Return the tokens of a text, an "end" behind them; `ExpressionError` for what cannot be part of one."""
    tokens, position = [], 0
    while position < len(text):
        match = TOKEN.match(text, position)
        if match is None:
            raise _bad_character(text, position)
        token = Token(match.lastgroup or "", match.group(), position + 1)
        if token.kind == "name":
            _check_name(text, token)
        if token.kind != "space":
            tokens.append(token)
        position = match.end()
    return [*tokens, Token("end", "", len(text) + 1)]


def _bad_character(text: str, position: int) -> ExpressionError:
    character = text[position]
    reason = HINTS.get(character, f"U+{ord(character):04X} is not part of the equation language")
    return ExpressionError(f"{quote(character)}: {reason}", text, position + 1)


def _check_name(text: str, token: Token) -> None:
    name, problem = token.piece, ""
    written_as = unicodedata.normalize("NFKC", name)
    if len(name) > MAX_NAME:
        problem = f"name {quote(name)} has {len(name)} characters; at most {MAX_NAME} are allowed"
    elif name.startswith("_") or "__" in name:
        problem = f"name {quote(name)}: a leading or double underscore is not allowed"
    elif written_as != name:  # Python would read two different spellings as one name
        problem = f"name {quote(name)} is a look-alike of {quote(written_as)}; write that"
    elif not all(c == "_" or c.isalpha() or (c.isascii() and c.isdigit()) for c in name):
        problem = f"name {quote(name)} may hold letters, digits 0-9 and underscores only"
    elif keyword.iskeyword(name):
        problem = f"{quote(name)} is a reserved word of Python"
    if problem:
        raise ExpressionError(problem, text, token.column)
