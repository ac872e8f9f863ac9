"""A check, on the tree alone, that no constant of an equation is undefined or has too many digits to work out.

SymPy works constants out while it builds an expression: 9**9**9, but also 2**(x - x + 10**9), exp(10**9*log(2)) and
2**(x + 10**9)*2**(-x).  So every node gets a bound on the digits of any number that *cancellation of its names* could
leave, found by treating each name as 1 and each sign as +.  Decimals count as names, because SymPy never turns a decimal
back into an integer: where a bound is too strict, 1000000.0 passes.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, TypeAlias

from piazzi.expressions.functions import TABLE, Function
from piazzi.expressions.language import (
    CONSTANTS,
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
from piazzi.expressions.parse import Equation, parse

MAX_EXPONENT = 64
MAX_POWER_DIGITS = 4000
LOG10_2 = math.log10(2.0)
REMEMBERED = 4096  # equations

Value: TypeAlias = Fraction | float


@dataclass(frozen=True, slots=True)
class Bound:
    """What a node can amount to.

    `value` of a constant, else None; digits before the decimal point (`size`), of a numerator and of a denominator that its
    names could cancel to leave; digits under its logarithms, which an exponential would set free; whether it holds an
    exponential, which a logarithm would set free; and the exponent its names carry.
    """

    value: Value | None = None
    size: float = 0.0
    numerator: float = 0.0
    denominator: float = 0.0
    under_log: float = 0.0
    exponential: bool = False
    degree: float = 1.0

    @property
    def digits(self) -> float:
        """Digits of the larger of numerator and denominator."""
        return max(self.numerator, self.denominator)


def read(text: str) -> Equation:
    """Return an equation whose every constant is real, finite and small enough; else raise `ExpressionError`.

    A text is parsed once: what is read again is the same object.
    """
    hashable: object = text
    return _read(text) if isinstance(hashable, str) else parse(text)  # which refuses what is no text


@contextmanager
def added(function: Function) -> Iterator[None]:
    """Within the block, the language has one function more: to try it before it joins the table."""
    if function.name in TABLE:
        raise ValueError(f"the language has a function {function.name!r} already")
    TABLE[function.name] = function
    try:
        yield
    finally:
        del TABLE[function.name]
        _read.cache_clear()


@lru_cache(maxsize=REMEMBERED)
def _read(text: str) -> Equation:
    equation = parse(text)
    try:
        fold(equation.tree, lambda node, parts: _bound(node, parts, text))
    except RecursionError:
        raise ExpressionError("the equation is nested too deep", text) from None
    return equation


def _bound(node: Node, parts: list[Bound], text: str) -> Bound:
    try:
        bound = _bound_of(node, parts, text)
    except ZeroDivisionError:
        raise ExpressionError("division by zero", text, node.column) from None
    except OverflowError:
        raise ExpressionError("this constant does not fit a double", text, node.column) from None
    except ValueError as error:
        if isinstance(error, ExpressionError):
            raise
        raise ExpressionError("this constant has no real value", text, node.column) from None
    _check_value(bound.value, node, text)
    return bound


def _bound_of(node: Node, parts: list[Bound], text: str) -> Bound:
    match node:
        case Number(value=int() as value):
            digits = math.log10(max(value, 1))
            return Bound(Fraction(value), digits, digits)
        case Number(value=value):
            return Bound(float(value))
        case Name(name=name):
            return Bound(CONSTANTS.get(name))
        case Negative():
            (bound,) = parts
            return bound if bound.value is None else replace(bound, value=-bound.value)
        case Sum(terms=terms):
            return _sum([(subtracted, child, part) for (subtracted, child), part in zip(terms, parts, strict=True)], text)
        case Product(factors=factors):
            return _product([(divides, child, part) for (divides, child), part in zip(factors, parts, strict=True)], text)
        case Power():
            return _power(parts[0], parts[1], node, text)
        case Call():
            return _call(node, parts, text)


def _check_value(value: Value | None, node: Node, text: str) -> None:
    problem = ""
    if isinstance(value, Fraction):
        if max(abs(value.numerator), value.denominator) >= 10**MAX_DIGITS:
            problem = f"this constant has more than {MAX_DIGITS} digits"
    elif isinstance(value, complex):
        problem = "this constant has no real value"
    elif value is not None and not math.isfinite(value):
        problem = "this constant does not fit a double"
    if problem:
        raise ExpressionError(problem, text, node.column)


def _sum(terms: list[tuple[bool, Node, Bound]], text: str) -> Bound:
    total = Bound(Fraction(0), -math.inf, -math.inf)
    for subtracted, node, term in terms:
        value = None
        if total.value is not None and term.value is not None:
            value = _exact_or_double(operator.sub if subtracted else operator.add, total.value, term.value)
            _check_value(value, node, text)
        total = Bound(
            value,
            _log10_of_sum(total.size, term.size),
            _log10_of_sum(total.numerator + term.denominator, term.numerator + total.denominator),
            total.denominator + term.denominator,
            total.under_log + term.under_log,
            total.exponential or term.exponential,
        )
    return total


def _product(factors: list[tuple[bool, Node, Bound]], text: str) -> Bound:
    total = Bound(Fraction(1))
    for divides, node, factor in factors:
        if divides and factor.value == 0:
            raise ExpressionError("division by zero", text, node.column)
        value = None
        if total.value is not None and factor.value is not None:
            value = _exact_or_double(operator.truediv if divides else operator.mul, total.value, factor.value)
            _check_value(value, node, text)
        size = factor.size
        if divides:  # a fraction is at least 1/denominator, unless it is known
            size = -math.log10(abs(factor.value)) if isinstance(factor.value, Fraction) else factor.denominator
        upper, lower = (factor.denominator, factor.numerator) if divides else (factor.numerator, factor.denominator)
        total = Bound(
            value,
            total.size + size,
            total.numerator + upper,
            total.denominator + lower,
            total.under_log + factor.under_log,
            total.exponential or factor.exponential,
            max(total.degree, factor.degree),
        )
    return total


def _power(base: Bound, exponent: Bound, node: Node, text: str) -> Bound:
    constant = exponent.value
    magnitude = abs(float(constant or 0.0))
    degree = base.degree if constant is None else base.degree * magnitude
    if constant is not None and max(degree, magnitude) > MAX_EXPONENT:
        problem = f"exponent {max(degree, magnitude):.6g} is beyond {MAX_EXPONENT}, the largest allowed"
        raise ExpressionError(problem, text, node.exponent.column if isinstance(node, Power) else node.column)
    size = magnitude if isinstance(constant, Fraction) else max(magnitude, _ten_to(exponent.size))
    if exponent.under_log:  # exp(a)**log(b) is b**a
        size *= _ten_to(base.digits)
    grown = _grown(size, max(base.digits, exponent.under_log), node, text)
    exponential = base.exponential or exponent.exponential
    if exponential:
        grown += base.digits + exponent.digits
    value = None
    if base.value is not None and constant is not None:
        value = _exact_or_double(operator.pow, base.value, constant)
    return Bound(value, grown, grown, grown, base.under_log + exponent.under_log, exponential, degree)


def _call(call: Call, arguments: list[Bound], text: str) -> Bound:
    function = TABLE[call.function]
    if function.growth == "root":
        return _power(arguments[0], Bound(Fraction(1, 2)), call, text)
    digits, under_log = sum(a.digits for a in arguments), sum(a.under_log for a in arguments)
    exponential = any(a.exponential for a in arguments)
    degree = max(a.degree for a in arguments) if function.growth == "magnitude" else 1.0
    value = None
    values = [a.value for a in arguments if a.value is not None]
    if len(values) == len(arguments):
        value = function.value(*values) if function.exact else float(function.value(*map(float, values)))
    if function.growth == "logarithm":  # log(exp(a)) is a; of any other argument a logarithm leaves no number
        unwrapped = digits if exponential else 0.0
        return Bound(value, unwrapped, unwrapped, unwrapped, under_log + digits, exponential)
    if function.growth == "exponential":  # exp(a*log(b)) is b**a
        if value == 0.0:
            raise OverflowError  # downwards
        grown = _grown(_ten_to(arguments[0].size), under_log, call, text)
        grown += digits
        return Bound(value, grown, grown, grown, under_log, True)
    if function.growth == "doubled":  # cos(asin(a)) is sqrt(1 - a**2)
        digits = 2 * digits + LOG10_2
    size = digits if function.size is None else function.size
    return Bound(value, size, digits, digits, under_log, exponential, degree)


def _grown(size: float, digits: float, node: Node, text: str) -> float:
    """Return the digits of a number of `digits` digits to the power `size`, if they are few enough to work out."""
    grown = size * digits if digits else 0.0
    if grown > MAX_POWER_DIGITS:
        hint = "write its large numbers as decimals, such as 1000.0"
        problem = f"integers in this power could grow to more than {MAX_POWER_DIGITS} digits; {hint}"
        raise ExpressionError(problem, text, node.column)
    return grown


def _exact_or_double(operation: Callable[[Any, Any], Any], left: Value, right: Value) -> Any:
    """Return the result exactly where both are exact and it is rational, else as a double (complex if it is not real)."""
    if isinstance(left, Fraction) and isinstance(right, Fraction):
        return operation(left, right)
    result = operation(float(left), float(right))
    if result == 0.0 and left and right and operation is not operator.add and operation is not operator.sub:
        raise OverflowError  # downwards
    return result


def _ten_to(digits: float) -> float:
    return float(10.0 ** min(digits, MAX_DIGITS))


def _log10_of_sum(a: float, b: float) -> float:
    return max(a, b) + math.log10(1.0 + 10.0 ** -abs(a - b))
