"""SymPy expressions to equations: one text for each expression, with every double written so that it reads back the same."""

from __future__ import annotations

import math
import numbers
from collections.abc import Collection, Iterable
from typing import Any

from piazzi.expressions.functions import arities, of_sympy
from piazzi.expressions.language import MAX_DIGITS, MAX_LENGTH, ExpressionError, quote
from piazzi.expressions.limits import read
from piazzi.expressions.parse import is_name, parse

# How tightly a piece of text holds together: a looser piece goes into brackets inside a tighter one.
SUM, PRODUCT, POWER, ATOM = range(4)


class _UnsupportedError(Exception):
    """A part of an expression has no place in an equation, for a reason."""

    def __init__(self, part: object, reason: str) -> None:
        super().__init__(part, reason)
        self.part, self.reason = part, reason


def write(expr: object, outside: Collection[str] | None = ()) -> str:
    """Return the canonical equation of a SymPy expression or Python number; `ExpressionError` names what has none.

    `outside` as in `parse`: SymPy's undefined functions of these names are calls of them.
    """
    try:
        _check_symbols(expr)
        text, _ = _write(expr)
        if len(text) > MAX_LENGTH:
            text = text.replace(" ", "")
        if outside is not None and not outside:
            read(text)
        else:
            parse(text, outside)
    except _UnsupportedError as error:
        whole, part = str(expr), str(error.part)
        raise ExpressionError(f"{quote(part)}: {error.reason}", whole, max(whole.find(part), 0) + 1) from None
    except RecursionError:
        raise ExpressionError("the expression is nested too deep", "...") from None
    return text


def _check_symbols(expr: object) -> None:
    seen: dict[str, object] = {}
    symbols: Iterable[Any] = getattr(expr, "free_symbols", ())
    for symbol in symbols:
        if not (is_name(str(symbol)) and symbol.is_commutative):
            raise _UnsupportedError(symbol, "a symbol must be commutative, with a name that an equation can hold")
        if seen.setdefault(str(symbol), symbol) != symbol:
            raise _UnsupportedError(symbol, "two different symbols have this name (their assumptions differ)")


def _write(expr: Any) -> tuple[str, int]:
    """Return the text of an expression and how tightly it holds together."""
    if isinstance(expr, numbers.Real) and not isinstance(expr, bool):
        negative, text = _number(expr)
        return _signed(negative, text, PRODUCT if "/" in text else ATOM)
    import sympy as sp

    if not isinstance(expr, sp.Expr):
        raise _unsupported(expr)
    if type(expr) is sp.Symbol:
        return expr.name, ATOM
    if expr is sp.pi:
        return "pi", ATOM
    if expr is sp.E:
        return "exp(1)", ATOM
    if isinstance(expr, sp.Add):
        return _sum(expr), SUM
    if isinstance(expr, sp.Mul) or _divides(expr):
        return _signed(*_product(expr), PRODUCT)
    if isinstance(expr, sp.Pow):
        return _power(expr.base, expr.exp)
    return _call(expr), ATOM


def _signed(negative: bool, text: str, level: int) -> tuple[str, int]:
    return (f"-{text}", SUM) if negative else (text, level)


def _bracketed(expr: Any, level: int) -> str:
    """Return the text of an expression, in brackets if it is looser than `level`."""
    text, own = _write(expr)
    return text if own >= level else f"({text})"


def _number(value: Any) -> tuple[bool, str]:
    """Return whether a number is negative, and the text of its magnitude: a fraction exactly, a double by its shortest repr."""
    if isinstance(value, numbers.Rational):
        top, bottom = abs(int(value.numerator)), int(value.denominator)
        if max(top, bottom) >= 10**MAX_DIGITS:
            raise _UnsupportedError("number", f"an integer has more than {MAX_DIGITS} digits")
        return bool(value < 0), str(top) if bottom == 1 else f"{top}/{bottom}"
    double = float(value)
    if not math.isfinite(double) or (double == 0.0) != (not value):
        raise _UnsupportedError(value, "this number does not fit a double")
    return double < 0, repr(abs(double))


def _sum(expr: Any) -> str:
    text = ""
    for term in _in_order(expr.args):
        negative, magnitude = _term(term)
        text += (" - " if negative else " + ") + magnitude
    return ("-" if text[1] == "-" else "") + text[3:]


def _term(term: Any) -> tuple[bool, str]:
    """Return whether a term is subtracted, and the text of what is then added or subtracted."""
    if term.is_Number and isinstance(term, numbers.Real):
        return _number(term)
    return _product(term) if term.is_Mul else (False, _bracketed(term, PRODUCT))


def _product(expr: Any) -> tuple[bool, str]:
    """Return whether a product is negative, and its magnitude: a/2/(b + c) where a/(2*(b + c)) would be expanded."""
    negative = False
    upper: list[str] = []
    lower: list[str] = []
    for factor in _in_order(expr.args if expr.is_Mul else (expr,)):
        if isinstance(factor, numbers.Real):
            minus, text = _number(factor)
            negative ^= minus
            top, _, bottom = text.partition("/")
            upper += [top] if top != "1" else []
            lower += [bottom] if bottom else []
        elif _divides(factor):
            lower.append(_bracketed(factor.base if factor.exp == -1 else factor.func(factor.base, -factor.exp), POWER))
        else:
            upper.append(_bracketed(factor, POWER))
    if len(lower) > 1 and not any(text.startswith("(") for text in lower):
        lower = [f"({'*'.join(lower)})"]
    return negative, "/".join(["*".join(upper) or "1", *lower])


def _divides(expr: Any) -> bool:
    return bool(expr.is_Pow and expr.exp.is_Number and expr.exp.is_negative)


def _power(base: Any, exponent: Any) -> tuple[str, int]:
    if exponent.is_Rational and (exponent.p, exponent.q) == (1, 2):
        return f"sqrt({_write(base)[0]})", ATOM
    return f"{_bracketed(base, ATOM)}**{_bracketed(exponent, POWER)}", POWER


def _call(expr: Any) -> str:
    import sympy as sp

    function = of_sympy(expr)
    if isinstance(expr, sp.core.function.AppliedUndef) and is_name(expr.func.__name__):
        return f"{expr.func.__name__}({', '.join(_write(argument)[0] for argument in expr.args)})"
    if function is None or function.derived:
        raise _unsupported(expr)
    arguments = _in_order(expr.args) if function.variadic else expr.args
    if function.growth == "exponential" and arguments[0].is_Add:
        arguments = [sp.Add(*map(_as_decimal, arguments[0].args), evaluate=False)]
    return f"{function.name}({', '.join(_write(argument)[0] for argument in arguments)})"


def _unsupported(expr: Any) -> _UnsupportedError:
    kinds = f"an equation has real numbers, symbols, pi, + - * / ** and {', '.join(arities())}"
    return _UnsupportedError(expr, f"{type(expr).__name__} is not supported; {kinds}")


def _as_decimal(term: Any) -> Any:
    """Return a fraction that is a double as that double: how `to_sympy` came by the constant term of an exponential."""
    import sympy as sp

    if term.is_Rational and term.q > 1 and sp.Rational(float(term)) == term:
        return sp.Float(float(term))
    return term


def _in_order(args: Any) -> list[Any]:
    """Return arguments in an order that does not depend on how SymPy came by them."""
    import sympy as sp

    return sorted(args, key=sp.default_sort_key)
