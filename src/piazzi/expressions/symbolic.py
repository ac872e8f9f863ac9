"""Equations to SymPy, node by node; SymPy itself is never given text."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from piazzi.expressions.bounds import MAX_EXPONENT
from piazzi.expressions.errors import ExpressionError
from piazzi.expressions.language import MAX_DIGITS, Call, Name, Negative, Node, Number, Power, Product, Sum
from piazzi.expressions.parse import Parsed

if TYPE_CHECKING:
    import sympy as sp

SYMPY_NAMES = {"min": "Min", "max": "Max"}


@functools.cache
def symbol(name: str) -> sp.Symbol:
    """Return the real SymPy symbol that stands for `name` everywhere."""
    import sympy as sp

    return sp.Symbol(name, real=True)


def build(parsed: Parsed, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """Return the SymPy expression of a checked equation; `ExpressionError` where SymPy finds no finite real value."""
    import sympy as sp

    expr = _build(parsed.tree, parsed.text, symbols)
    if expr.has(sp.I, sp.nan, sp.zoo, sp.oo, -sp.oo, sp.re, sp.im, sp.arg):
        raise ExpressionError("the equation has no finite real value", parsed.text)
    for number in expr.atoms(sp.Number):
        if not _fits_a_double(number):
            raise ExpressionError("a constant of the simplified equation does not fit a double", parsed.text)
    return expr


def _build(node: Node, text: str, symbols: Mapping[str, sp.Symbol]) -> Any:
    try:
        expr = _build_unchecked(node, text, symbols)
        finite = _is_finite_real(expr, grows=isinstance(node, Power | Call))
    except ExpressionError:
        raise
    except Exception as error:  # SymPy raises anything from TypeError to AttributeError for values it cannot compare or place
        raise ExpressionError(f"SymPy cannot build this ({type(error).__name__})", text, node.column) from error
    if not finite:
        raise ExpressionError("this simplifies to a constant that is not finite and real", text, node.column)
    return expr


def _build_unchecked(node: Node, text: str, symbols: Mapping[str, sp.Symbol]) -> Any:
    import sympy as sp

    match node:
        case Number(value=int() as value):
            return sp.Integer(value)
        case Number(value=value):
            return sp.Float(value)  # 53 bits: the double itself, although SymPy prints 15 digits of it
        case Name(name="pi"):
            return sp.pi
        case Name(name=name):
            return symbols[name]
        case Negative(operand=operand):
            return -_build(operand, text, symbols)
        case Sum(terms=terms):
            built = [(subtracted, _build(term, text, symbols)) for subtracted, term in terms]
            return sp.Add(*(-term if subtracted else term for subtracted, term in built))
        case Product(factors=factors):
            return _product([(divides, _build(factor, text, symbols), factor.column) for divides, factor in factors], text)
        case Power(base=base, exponent=exponent):
            return _power(_build(base, text, symbols), _build(exponent, text, symbols), node, text)
        case Call(function="exp", arguments=(argument,)):
            return _exp(_build(argument, text, symbols))
        case Call(function="abs", arguments=(argument,)):
            return _abs(_build(argument, text, symbols))
        case Call(function="hypot", arguments=(a, b)):
            return sp.sqrt(_build(a, text, symbols) ** 2 + _build(b, text, symbols) ** 2)
        case Call(function=function, arguments=arguments):
            build_call = getattr(sp, SYMPY_NAMES.get(function, function))  # one of FUNCTIONS: the parser saw to it
            return build_call(*(_build(argument, text, symbols) for argument in arguments))


def _product(factors: list[tuple[bool, Any, int]], text: str) -> Any:
    """Return the product, its numbers multiplied and divided from left to right as Python would: 0.3/0.1 rounds once."""
    import sympy as sp

    coefficient: Any = sp.Integer(1)
    others = []
    for divides, factor, column in factors:
        if divides and factor.is_Number and not factor:
            raise ExpressionError("division by zero", text, column)
        if factor.is_Number:
            coefficient = coefficient / factor if divides else coefficient * factor
        else:
            others.append(1 / factor if divides else factor)
    return sp.Mul(coefficient, *others)


def _power(base: Any, exponent: Any, node: Node, text: str) -> Any:
    """Return the power; the bounds hold again for what SymPy has simplified, which they should never have to catch."""
    if exponent.is_number and abs(float(exponent)) > MAX_EXPONENT:
        raise ExpressionError(f"exponent simplifies to {float(exponent):.6g}, beyond {MAX_EXPONENT}", text, node.column)
    return base**exponent


def _exp(argument: Any) -> Any:
    """Return exp of a SymPy argument, whose Float term, if any, becomes the same double as a fraction.

    SymPy takes exp(x + 750.4) apart into exp(750.4)*exp(x), and exp(750.4) is no double: with a fraction it does not.
    """
    import sympy as sp

    if argument.is_Add:
        argument = sp.Add(*(sp.Rational(float(term)) if term.is_Float else term for term in argument.args))
    return sp.exp(argument)


def _abs(argument: Any) -> Any:
    """Return abs of a SymPy argument, as a root where SymPy cannot tell that x**1.5 is real and would take its real part."""
    import sympy as sp

    magnitude = sp.Abs(argument)
    return sp.sqrt(argument**2) if magnitude.has(sp.re, sp.im, sp.arg) else magnitude


def _is_finite_real(expr: Any, *, grows: bool) -> bool:
    """Return False for a constant, left by cancellation, that is no double: SymPy hangs when it compares exp(exp(exp(100)))."""
    if not (expr.is_Number or expr.is_NumberSymbol or (grows and expr.is_number)):
        return True
    try:
        return _fits_a_double(expr)
    except TypeError:  # complex, or complex infinity
        return False


def _fits_a_double(constant: Any) -> bool:
    if constant.is_Rational:
        return bool(max(abs(constant.p), constant.q) < 10**MAX_DIGITS)
    double = float(constant)
    return math.isfinite(double) and (double != 0.0 or not constant)
