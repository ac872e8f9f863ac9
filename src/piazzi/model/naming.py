"""Names and equations as they are given: SymPy or text, in; canonical text, out."""

from __future__ import annotations

from typing import Any

from piazzi.expressions import from_sympy, is_name, names

TIME = "t"
STEP = "dt"


def text_of(equation: Any) -> str:
    """Canonical text of an equation given as text, number or SymPy expression; raises `ExpressionError`."""
    if isinstance(equation, str):
        names(equation)
        return equation.strip()
    return from_sympy(equation)


def name_of(symbol: Any, what: str) -> str:
    """Name of a SymPy symbol, or the text itself; raises ValueError unless it can name a variable in an equation."""
    name = str(symbol)
    if not is_name(name):
        raise ValueError(
            f"{what} {name!r} cannot be used as a name: write a letter followed by letters, digits and single underscores"
        )
    return name
