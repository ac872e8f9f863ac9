"""A closed formula as text of the language: a model takes its definitions, Python its values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from piazzi.arrays import Array
from piazzi.expressions.numeric import evaluate_arrays
from piazzi.text import brief


@dataclass(frozen=True)
class Formula:
    """Values by name, each worked out from those before it.

    ``formula(**numbers)`` gives its outputs at numbers or arrays that go together, in SI units; ``formula.definitions`` is what
    a `Model` or a `Sensor` takes, whose arguments are then names of theirs.

    Parameters
    ----------
    arguments : names that it is a function of
    definitions : name to text, in the order in which they are worked out
    outputs : names of the results
    source : where it is from
    """

    arguments: tuple[str, ...]
    definitions: Mapping[str, str]
    outputs: tuple[str, ...]
    source: str

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "definitions", MappingProxyType(dict(self.definitions)))

    def __call__(self, *values: float | Array, **named: float | Array) -> Any:
        """The output, or a tuple of several; raises TypeError where arguments are missing or not known."""
        given = dict(zip(self.arguments, values, strict=False))
        twice = given.keys() & named.keys()
        numbers: dict[str, Any] = {**given, **named}
        if len(values) > len(self.arguments) or twice or numbers.keys() != set(self.arguments):
            raise TypeError(f"arguments are {', '.join(self.arguments)}; {', '.join(map(str, numbers)) or 'none'} were given")
        for name, text in self.definitions.items():
            numbers[name] = evaluate_arrays(text, numbers)
        results = tuple(numbers[name] for name in self.outputs)
        return results[0] if len(results) == 1 else results

    def __reduce__(self) -> tuple[Any, ...]:
        return Formula, (self.arguments, dict(self.definitions), self.outputs, self.source)
