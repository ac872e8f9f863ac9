"""Equations as text, safely: `names` and `check` read them without SymPy, `to_sympy` and `from_sympy` convert.

The language is what a formula needs and no more (`parse.py` has the grammar): numbers, names, ``pi``, ``+ - * / **``
and `FUNCTIONS`, with Python's precedence.  Text is never given to Python's or SymPy's own parsers, which execute it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from piazzi.expressions.functions import Function, arities, symbol
from piazzi.expressions.language import CONSTANTS, ExpressionError, quote
from piazzi.expressions.limits import added, read
from piazzi.expressions.numeric import evaluate, evaluate_arrays
from piazzi.expressions.parse import Equation, is_name
from piazzi.text import suggest

if TYPE_CHECKING:
    import sympy as sp

__all__ = [
    "CONSTANTS", "FUNCTIONS", "Equation", "ExpressionError", "Function", "added", "check", "evaluate", "evaluate_arrays",
    "from_sympy", "is_name", "names", "symbol", "to_sympy",
]  # fmt: skip

#: The functions that an equation may call, and how many arguments each takes; `min` and `max` take that many or more.
FUNCTIONS: Mapping[str, int] = MappingProxyType(arities())


def names(text: str) -> frozenset[str]:
    """Return the free names of an equation.

    Raises
    ------
    ExpressionError
        If the text is outside the language, or one of its constants is undefined or too large.
    """
    return frozenset(read(text).names)


def check(text: str, allowed: Collection[str]) -> frozenset[str]:
    """Return the free names of an equation, each of them one of `allowed`.

    Raises
    ------
    ExpressionError
        As `names` does, and at the first name that is not allowed, with the nearest that is.
    """
    return frozenset(_read_with(text, allowed).names)


def to_sympy(text: str, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """Return the SymPy expression of an equation over `symbols` (see `symbol`).

    Integers and their quotients are exact rationals; a decimal is the double that was written, exactly.
    SymPy simplifies as it always does, so 2*(x + y) comes back expanded and x - x as zero.

    Raises
    ------
    ExpressionError
        As `check` does, where SymPy finds that a part has no finite real value, and where that takes it more than 5 s.
    """
    from piazzi.expressions.symbolic import build
    from piazzi.expressions.time_limit import TooSlowError, with_time_limit

    parsed = _read_with(text, symbols)
    try:
        return with_time_limit(lambda: build(parsed, symbols))
    except TooSlowError as error:
        raise ExpressionError(f"{error}: write it in a simpler way", text) from None


def from_sympy(expr: object, outside: Collection[str] | None = ()) -> str:
    """Return the canonical equation of a SymPy expression or a Python number, such that `to_sympy` gives it back.

    Equal expressions give equal text in every process, and doubles survive bit for bit.  `outside` names functions that the
    expression may call beside those of the language, as SymPy's undefined functions; None is for any name.

    Raises
    ------
    ExpressionError
        If a part has no place in an equation (Piecewise, Derivative, a function of time, complex or infinite values, a
        matrix ...), or the text would exceed the limits of the language.
    """
    from piazzi.expressions.writing import write

    return write(expr, outside)


def _read_with(text: str, allowed: Collection[str] | Mapping[str, object]) -> Equation:
    equation = read(text)
    for name, column in equation.names.items():
        if name not in allowed:
            raise ExpressionError(f"unknown name {quote(name)}{suggest(name, [*allowed, *CONSTANTS])}", text, column)
    return equation
