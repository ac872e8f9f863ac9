"""Calls of functions from outside, taken out of equations: what is left is an equation of the language."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from functools import lru_cache

from piazzi.expressions import check
from piazzi.expressions.functions import TABLE
from piazzi.expressions.language import Call, ExpressionError, Name, Negative, Node, Number, Power, Product, Sum, fold
from piazzi.expressions.limits import REMEMBERED, read
from piazzi.expressions.parse import parse

_ORDER = re.compile(r",\s*order\s*=\s*(\d+)\s*\)")  # at(offset, order=2): the one argument that is written with its name


def split(text: str, outside: Collection[str] | None, stand_in: Callable[[str, tuple[str, ...]], str]) -> str:
    """The equation with a name in place of every call of a function from outside.

    Parameters
    ----------
    outside : names of those functions; None if any name that the language does not have may be one
    stand_in : takes a function and the texts of its arguments, and gives the name; inner calls come first

    Raises
    ------
    ExpressionError
        For text outside the language.
    """
    text = _ORDER.sub(r", \1)", text)
    tree, calls = _tree(text, outside), 0

    def combine(node: Node, parts: list[str]) -> str:
        nonlocal calls
        if not isinstance(node, Call) or node.function in TABLE:
            return _written(node, parts)
        calls += 1
        return stand_in(node.function, tuple(map(_bare, parts)))

    rest = fold(tree, combine)
    return _bare(rest) if calls else text


def whole_call(text: str, outside: Collection[str] | None) -> bool:
    """Whether an equation is nothing but one call of a function from outside."""
    tree = _tree(_ORDER.sub(r", \1)", text), outside)
    return isinstance(tree, Call) and tree.function not in TABLE


def _tree(text: str, outside: Collection[str] | None) -> Node:
    """The tree of an equation; that of one which is all of the language is shared with its other readers."""
    hashable: object = text
    known = None if outside is None else tuple(outside)
    return _read(text, known, tuple(TABLE)) if isinstance(hashable, str) else read(text).tree


@lru_cache(maxsize=REMEMBERED)
def _read(text: str, outside: tuple[str, ...] | None, language: tuple[str, ...]) -> Node:
    """The same, once of a text, where functions of the `language` and from outside have these names."""
    if not any(f"{name}(" in text for name in outside or ()):
        try:
            return read(text).tree
        except ExpressionError:
            if outside is not None and not outside:
                raise
    return parse(text, outside).tree


def _bare(text: str) -> str:
    """Without brackets around the whole, which only combinations have."""
    return text[1:-1] if text.startswith("(") else text


def _written(node: Node, parts: list[str]) -> str:
    """A node whose parts are written; a combination is in brackets."""
    match node:
        case Number(value=value):
            return repr(value)
        case Name(name=name):
            return name
        case Call(function=function):
            return f"{function}({', '.join(map(_bare, parts))})"
        case Negative():
            return f"(-{parts[0]})"
        case Sum(terms=terms):
            text = "".join(f" {'-' if minus else '+'} {part}" for (minus, _), part in zip(terms, parts, strict=True))
            return f"({text[3:] if not terms[0][0] else text[1:]})"
        case Product(factors=factors):
            text = "".join(f"{'/' if over else '*'}{part}" for (over, _), part in zip(factors, parts, strict=True))
            return f"({text[1:]})"
        case Power():
            return f"({parts[0]}**{parts[1]})"


def check_calls(text: str, allowed: Collection[str], outside: Collection[str]) -> None:
    """Raise `ExpressionError` unless every name of an equation is allowed, within calls of functions from outside too."""
    parts: list[str] = []
    made: list[str] = []

    def stand_in(function: str, arguments: tuple[str, ...]) -> str:
        parts.extend(arguments)
        made.append(f"{function}_{len(made)}_value")
        return made[-1]

    parts.append(split(text, outside, stand_in))
    for part in parts:
        check(part, [*allowed, *made])
