"""Which drawn first states count as a truth: equations of states and parameters that must be above zero."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.expressions import CONSTANTS, check
from piazzi.expressions.language import Call, Name, Negative, Node, Number, Power, Product, Sum
from piazzi.expressions.parse import parse
from piazzi.model.definitions import needed
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

MOST_DRAWS = 1000  # for one run: a rule that accepts less than that is a mistake
_CALLS: Mapping[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs", "sign")},
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "hypot": np.hypot,
    "min": lambda *values: np.minimum.reduce(np.broadcast_arrays(*values)),
    "max": lambda *values: np.maximum.reduce(np.broadcast_arrays(*values)),
}


class NoTruthError(ValueError):
    """A rule that accepts nothing."""

    def __init__(self, rule: Rule) -> None:
        super().__init__(f"none of {MOST_DRAWS} truths drawn for a run is accepted: {rule}")


class Rule:
    """The rule of a problem as it really is.

    Raises
    ------
    ExpressionError
        (a ValueError) for an equation outside the language, or a name that is neither a state nor a parameter.
    """

    def __init__(self, equations: Sequence[str], actual: Problem) -> None:
        model = actual.model
        self._equations = tuple(equations)
        self._names = model.names
        values = {name: actual.parameters[name] for name in model.given}
        self._given = {name: float(v.mean[0]) if isinstance(v, Gaussian) else float(v) for name, v in values.items()}
        known = {*self._names, *self._given}
        timeless = [
            (name, text)
            for name, text in model.definitions
            if needed([text], model.definitions) <= known | {n for n, _ in model.definitions}
        ]
        self._definitions = [(name, parse(text).tree) for name, text in timeless]
        for text in self._equations:
            check(text, [*self._names, *self._given, *(name for name, _ in timeless)])
        self._trees = [parse(text).tree for text in self._equations]

    def __str__(self) -> str:
        return " and ".join(f"{text} > 0" for text in self._equations)

    def accepts(self, x: Array) -> Array:
        """For each of the states (M, n), whether all equations are above zero there, (M,); not where one has no value."""
        out = np.ones(len(x), dtype=bool)
        values = {**CONSTANTS, **self._given, **dict(zip(self._names, x.T, strict=True))}
        with np.errstate(all="ignore"):
            for name, tree in self._definitions:
                values[name] = _value(tree, values)
            for tree in self._trees:
                out &= np.asarray(_value(tree, values)) > 0
        return out


def _value(node: Node, values: Mapping[str, Any]) -> Any:
    match node:
        case Number(value=value):
            return np.float64(value)
        case Name(name=name):
            return values[name]
        case Negative(operand=operand):
            return -_value(operand, values)
        case Sum(terms=terms):
            return sum(-_value(term, values) if subtracted else _value(term, values) for subtracted, term in terms)
        case Product(factors=factors):
            total = np.float64(1.0)
            for divides, factor in factors:
                total = total / _value(factor, values) if divides else total * _value(factor, values)
            return total
        case Power(base=base, exponent=exponent):
            return np.power(_value(base, values), _value(exponent, values))
        case Call(function=function, arguments=arguments):
            return _CALLS[function](*(_value(a, values) for a in arguments))
