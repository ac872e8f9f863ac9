"""Equations to SymPy, node by node; SymPy itself is never given text."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from piazzi.expressions.functions import TABLE, Function, symbol
from piazzi.expressions.language import (
    MAX_DIGITS,
    Call,
    ExpressionError,
    Name,
    Negative,
    Node,
    Number,
    Power,
    Product,
    Sum,
    fold,
)
from piazzi.expressions.limits import MAX_EXPONENT, read
from piazzi.expressions.parse import Equation

if TYPE_CHECKING:
    import sympy as sp


def build(equation: Equation, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """Return the SymPy expression of a checked equation; `ExpressionError` where SymPy finds no finite real value."""
    import sympy as sp

    text = equation.text
    expr = fold(equation.tree, lambda node, parts: _build(node, parts, text, symbols))
    if expr.has(sp.I, sp.nan, sp.zoo, sp.oo, -sp.oo, sp.re, sp.im, sp.arg):
        raise ExpressionError("the equation has no finite real value", text)
    for number in expr.atoms(sp.Number):
        if not _fits_a_double(number):
            raise ExpressionError("a constant of the simplified equation does not fit a double", text)
    return expr


def _build(node: Node, parts: list[Any], text: str, symbols: Mapping[str, sp.Symbol]) -> Any:
    try:
        expr = _build_unchecked(node, parts, text, symbols)
        finite = _is_finite_real(expr, grows=isinstance(node, Power | Call))
    except ExpressionError:
        raise
    except Exception as error:  # SymPy raises anything from TypeError to AttributeError for values it cannot compare or place
        raise ExpressionError(f"SymPy cannot build this ({type(error).__name__})", text, node.column) from error
    if not finite:
        raise ExpressionError("this simplifies to a constant that is not finite and real", text, node.column)
    return expr


def _build_unchecked(node: Node, parts: list[Any], text: str, symbols: Mapping[str, sp.Symbol]) -> Any:
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
        case Negative():
            return -parts[0]
        case Sum(terms=terms):
            return sp.Add(*(-part if subtracted else part for (subtracted, _), part in zip(terms, parts, strict=True)))
        case Product(factors=factors):
            return _product([(d, part, child.column) for (d, child), part in zip(factors, parts, strict=True)], text)
        case Power():
            return _power(parts[0], parts[1], node, text)
        case Call(function=function):
            return _maker(TABLE[function])(*parts)


def _maker(function: Function) -> Any:
    """What makes SymPy's expression of a call: a function of its arguments, or a class."""
    import sympy as sp

    return function.build or (_class_of(function) if function.partials else getattr(sp, function.sympy))


@functools.cache
def _class_of(function: Function) -> Any:
    """A SymPy function that is real, differentiates by its partials, and has a value where its arguments do."""
    import sympy as sp

    symbols = {name: symbol(name) for name in "abcdefgh"[: function.arity]}

    def fdiff(self: Any, argindex: int = 1) -> Any:
        partial = build(read(function.partials[argindex - 1]), symbols)
        return partial.xreplace(dict(zip(symbols.values(), self.args, strict=True)))

    body = {
        "row": function,
        "nargs": function.arity,
        "fdiff": fdiff,
        "_eval_evalf": lambda self, precision: sp.Float(function.value(*map(float, self.args))),
        "_eval_is_extended_real": lambda self: True,
    }
    return type(function.name, (sp.Function,), body)


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
