"""The value of an equation at given numbers, or arrays of them, without SymPy: for checks at the door, not for kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from piazzi.expressions.functions import TABLE, Function
from piazzi.expressions.language import CONSTANTS, Call, Name, Negative, Node, Number, Power, Product, Sum, fold
from piazzi.expressions.limits import read


class _Arithmetic(NamedTuple):
    """What differs between one number and arrays of them."""

    number: Callable[[Any], Any]
    total: Callable[[list[Any]], Any]
    power: Callable[[Any, Any], Any]
    call: Callable[[Function, list[Any]], Any]


def evaluate(text: str, values: Mapping[str, float]) -> float:
    """Return the value of the equation, NaN where it has none there (0/0, a root or logarithm of a negative, overflow).

    Raises
    ------
    ExpressionError
        For text outside the language.
    KeyError
        For a name without a value.
    """
    one = _Arithmetic(float, math.fsum, lambda base, exponent: float(base**exponent), lambda f, parts: float(f.value(*parts)))
    try:
        return float(_value(text, values, one))
    except (ArithmeticError, ValueError, TypeError):  # TypeError: a negative base to a fraction is complex
        return math.nan


def evaluate_arrays(text: str, values: Mapping[str, Any]) -> Any:
    """Return the values of the equation at arrays of numbers that go together, NaN or infinite where it has none.

    Raises
    ------
    ExpressionError, KeyError
        As `evaluate` does.
    """
    import numpy as np

    with np.errstate(all="ignore"):
        return _value(text, values, _Arithmetic(np.float64, sum, np.power, lambda f, parts: f.on_arrays(*parts)))


def _value(text: str, values: Mapping[str, Any], on: _Arithmetic) -> Any:
    def combine(node: Node, parts: list[Any]) -> Any:
        match node:
            case Number(value=value):
                return on.number(value)
            case Name(name=name):
                return on.number(CONSTANTS[name] if name in CONSTANTS else values[name])
            case Negative():
                return -parts[0]
            case Sum(terms=terms):
                return on.total([-part if subtracted else part for (subtracted, _), part in zip(terms, parts, strict=True)])
            case Product(factors=factors):
                product = on.number(1.0)
                for (divides, _), part in zip(factors, parts, strict=True):
                    product = product / part if divides else product * part
                return product
            case Power():
                return on.power(*parts)
            case Call(function=function):
                return on.call(TABLE[function], parts)

    return fold(read(text).tree, combine)
