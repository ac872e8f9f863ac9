"""Which drawn first states count as a truth: equations of states and parameters that must be above zero."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piazzi.expressions import check, evaluate_arrays
from piazzi.model.definitions import needed
from piazzi.model.values import with_arrays
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

MOST_DRAWS = 1000  # for one run: a rule that accepts less than that is a mistake


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
        known = {*self._names, *self._given} | {name for d in model.definitions for name in d.provides}
        used = needed(self._equations, model.definitions)
        self._definitions = [
            d for d in model.definitions if used & set(d.provides) and needed(d.needs, model.definitions) <= known
        ]
        self._functions, self._model = actual.functions, model
        for text in self._equations:
            check(text, [*self._names, *self._given, *(name for d in self._definitions for name in d.provides)])

    def __str__(self) -> str:
        return " and ".join(f"{text} > 0" for text in self._equations)

    def accepts(self, x: Array) -> Array:
        """For each of the states (M, n), whether all equations are above zero there, (M,); not where one has no value."""
        out = np.ones(len(x), dtype=bool)
        values = {**self._given, **dict(zip(self._names, x.T, strict=True))}
        wanted = {name for d in self._definitions for name in d.provides}
        values = with_arrays(values, wanted, tuple(self._definitions), functions=self._functions, model=self._model)
        for text in self._equations:
            out &= np.asarray(evaluate_arrays(text, values)) > 0
        return out
