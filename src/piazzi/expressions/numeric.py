"""The value of an equation at given numbers, without SymPy: for checks at the door, not for kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from piazzi.expressions.language import Call, Name, Negative, Node, Number, Power, Product, Sum
from piazzi.expressions.parse import parse

CALLS: Mapping[str, Callable[..., float]] = MappingProxyType(
    {
        **{
            name: getattr(math, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")
        },
        **{name: getattr(math, name) for name in ("exp", "log", "sqrt", "hypot")},
        "abs": abs,
        "sign": lambda x: float(x > 0) - float(x < 0),
        "min": min,
        "max": max,
    }
)


def evaluate(text: str, values: Mapping[str, float]) -> float:
    """Return the value of the equation, NaN where it has none there (0/0, a root or logarithm of a negative, overflow).

    Raises
    ------
    ExpressionError
        For text outside the language.
    KeyError
        For a name without a value.
    """
    try:
        return float(_value(parse(text).tree, values))
    except (ArithmeticError, ValueError, TypeError):  # TypeError: a negative base to a fraction is complex
        return math.nan


def _value(node: Node, values: Mapping[str, float]) -> float:
    match node:
        case Number(value=value):
            return float(value)
        case Name(name=name):
            return float(values[name]) if name in values or name != "pi" else math.pi
        case Negative(operand=operand):
            return -_value(operand, values)
        case Sum(terms=terms):
            return math.fsum(-_value(term, values) if subtracted else _value(term, values) for subtracted, term in terms)
        case Product(factors=factors):
            total = 1.0
            for divides, factor in factors:
                total = total / _value(factor, values) if divides else total * _value(factor, values)
            return total
        case Power(base=base, exponent=exponent):
            return float(_value(base, values) ** _value(exponent, values))  # TypeError if complex
        case Call(function=function, arguments=arguments):
            return float(CALLS[function](*(_value(a, values) for a in arguments)))
