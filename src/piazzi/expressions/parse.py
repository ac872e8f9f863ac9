"""The equation language: text to tokens to a small tree, with Python's meaning of every accepted text.

    sum     = product (("+" | "-") product)*
    product = signed (("*" | "/") signed)*
    signed  = ("+" | "-") signed | power
    power   = atom ("**" signed)?
    atom    = number | name | function "(" sum ("," sum)* ")" | "(" sum ")"

Nothing of Python's own machinery ever sees the text: no attribute, subscript, string, comparison or keyword has a rule
here that could let it in.  A chain such as a + b - c is one node however long it is, so only brackets, signs and
exponents nest, and what is accepted depends neither on the Python version nor on the caller's stack (`ast.parse` raises
RecursionError for sums of about 2900 terms).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from piazzi.expressions.functions import TABLE, arities
from piazzi.expressions.language import (
    CONSTANTS,
    MAX_DEPTH,
    MAX_DIGITS,
    MAX_EXTREMES,
    MAX_LENGTH,
    Call,
    ExpressionError,
    Name,
    Negative,
    Node,
    Number,
    Power,
    Product,
    Sum,
    Token,
    quote,
    tokenize,
)
from piazzi.text import suggest

ALIASES = {"ln": "log", "sgn": "sign", "fabs": "abs", "pow": "**"}


@dataclass(frozen=True, slots=True)
class Equation:
    """An equation as its text, its tree, and the column where each free name first stands: equal where the texts are."""

    text: str
    tree: Node = field(compare=False, repr=False)
    names: Mapping[str, int] = field(compare=False, repr=False)


def parse(text: str, outside: Collection[str] | None = ()) -> Equation:
    """Return the tree of an equation; `ExpressionError` says what is outside the language, and where.

    `outside` names further functions that it may call, with any number of arguments; None is for any name.
    """
    if not isinstance(text, str):
        raise ExpressionError(f"an equation must be text, not {type(text).__name__}", "")
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the equation has {len(text)} characters; at most {MAX_LENGTH} are allowed", text, MAX_LENGTH + 1
        )
    reader = _Reader(text, outside)
    try:
        tree = reader.sum()
    except RecursionError:  # only when the caller's own stack was all but used up
        raise ExpressionError("the equation is nested too deep", text) from None
    if reader.next.kind != "end":
        raise reader.unexpected()
    return Equation(text, tree, MappingProxyType(reader.names))


def is_name(text: str) -> bool:
    """Return whether `text`, to the letter, can name a state, parameter or input."""
    try:
        token = tokenize(text)[0]
    except (ExpressionError, TypeError):
        return False
    return token.kind == "name" and token.piece == text and text not in (*arities(), *CONSTANTS)


class _Reader:
    """One pass over the tokens by recursive descent; recursion is bounded by `MAX_DEPTH`, chains are loops."""

    def __init__(self, text: str, outside: Collection[str] | None) -> None:
        self.text = text
        self.outside = outside
        self.tokens = iter(tokenize(text))
        self.next = next(self.tokens)
        self.names: dict[str, int] = {}
        self.depth = 0
        self.extremes = 0

    def take(self) -> Token:
        token, self.next = self.next, next(self.tokens)
        return token

    def error(self, problem: str, token: Token) -> ExpressionError:
        return ExpressionError(problem, self.text, token.column)

    def unexpected(self) -> ExpressionError:
        token = self.next
        if token.kind == "end":
            return self.error("the equation ends where a number, name or bracket should follow", token)
        if token.kind in ("name", "number") or token.piece == "(":
            return self.error(f"an operator is missing before {quote(token.piece)}; write * to multiply", token)
        return self.error(f"{quote(token.piece)} is out of place", token)

    def enter(self, token: Token) -> None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.error(f"nested deeper than {MAX_DEPTH} brackets, signs and exponents", token)

    def sum(self) -> Node:
        column, terms = self.next.column, [(False, self.product())]
        while self.next.piece in ("+", "-"):
            terms.append((self.take().piece == "-", self.product()))
        return terms[0][1] if len(terms) == 1 else Sum(tuple(terms), column)

    def product(self) -> Node:
        column, factors = self.next.column, [(False, self.signed())]
        while self.next.piece in ("*", "/"):
            factors.append((self.take().piece == "/", self.signed()))
        return factors[0][1] if len(factors) == 1 else Product(tuple(factors), column)

    def signed(self) -> Node:
        if self.next.piece not in ("+", "-"):
            return self.power()
        sign = self.take()
        self.enter(sign)
        operand = self.signed()
        self.depth -= 1
        return Negative(operand, sign.column) if sign.piece == "-" else operand

    def power(self) -> Node:
        column, base = self.next.column, self.atom()
        if self.next.piece != "**":
            return base
        self.enter(self.take())
        exponent = self.signed()
        self.depth -= 1
        return Power(base, exponent, column)

    def atom(self) -> Node:
        if self.next.kind == "number":
            return self.number(self.take())
        if self.next.kind == "name":
            token = self.take()
            return self.call(token) if self.next.piece == "(" else self.name(token)
        if self.next.piece == "(":
            return self.bracket()[0]
        if self.next.kind == "operator":
            raise self.error(f"{quote(self.next.piece)} stands where a number, name or bracket should", self.next)
        raise self.unexpected()

    def bracket(self, *, many: bool = False) -> tuple[Node, ...]:
        opening = self.take()
        self.enter(opening)
        empty = many and self.next.piece == ")"
        inside = [] if empty else [self.sum()]
        while many and self.next.piece == ",":
            self.take()
            inside.append(self.sum())
        if self.next.kind == "end":
            raise self.error("this bracket is never closed", opening)
        if self.next.piece != ")":
            raise self.unexpected()
        self.take()
        self.depth -= 1
        return tuple(inside)

    def number(self, token: Token) -> Number:
        if self.next.kind in ("name", "number") and self.next.column == token.column + len(token.piece):
            hint = "write * to multiply; numbers are plain decimals such as 12, 0.5 or 1e-3"
            raise self.error(f"number {quote(token.piece)} runs into {quote(self.next.piece)}: {hint}", token)
        return Number(self.value(token), token.column)

    def value(self, token: Token) -> int | float:
        literal = token.piece
        if literal.isdigit():
            if len(literal) > MAX_DIGITS:
                raise self.error(f"integer of {len(literal)} digits; at most {MAX_DIGITS} are allowed", token)
            if literal[0] == "0" and literal.strip("0"):
                raise self.error(f"integer {quote(literal)} has a leading zero", token)
            return int(literal)
        value = float(literal)
        if not math.isfinite(value):
            raise self.error(f"number {quote(literal)} is too large for a double", token)
        if value == 0.0 and literal.lower().split("e")[0].strip("0."):
            raise self.error(f"number {quote(literal)} is too small for a double", token)
        return value

    def name(self, token: Token) -> Name:
        if token.piece in arities():
            raise self.error(f"{quote(token.piece)} is a function and needs its arguments in brackets", token)
        if token.piece not in CONSTANTS:
            self.names.setdefault(token.piece, token.column)
        return Name(token.piece, token.column)

    def call(self, token: Token) -> Call:
        function = token.piece
        if function not in arities() and function not in CONSTANTS and self.is_outside(function):
            return Call(function, self.bracket(many=True), token.column)
        if function not in arities():
            known = [*arities(), *(self.outside or ())]
            hint = f"; write {quote(ALIASES[function])}" if function in ALIASES else suggest(function, known)
            raise self.error(f"{quote(function)} is not a function{hint or '; write * to multiply'}", token)
        arguments = self.bracket(many=True)
        self.check_count(token, len(arguments))
        return Call(function, arguments, token.column)

    def is_outside(self, function: str) -> bool:
        """Whether a name may be that of a function from outside."""
        return function not in ALIASES if self.outside is None else function in self.outside

    def check_count(self, token: Token, got: int) -> None:
        function = TABLE[token.piece]
        if function.variadic:
            self.extremes += got
            if self.extremes > MAX_EXTREMES:
                raise self.error(f"min and max have more than {MAX_EXTREMES} arguments in all", token)
        if got < function.arity or (got > function.arity and not function.variadic):
            or_more = " or more" if function.variadic else ""
            plural = "" if function.arity == 1 else "s"
            raise self.error(f"{function.name} takes {function.arity}{or_more} argument{plural}, got {got}", token)
