"""Text to tokens: the only characters, names and numbers that an equation may hold."""

from __future__ import annotations

import keyword
import re
import unicodedata
from typing import NamedTuple

from piazzi.expressions.errors import ExpressionError, quote
from piazzi.expressions.language import MAX_NAME

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
