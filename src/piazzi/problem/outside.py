"""Functions from outside as a problem has them: their recipes, checked, and the block of data that kernels read.

The block begins with the position of each function's own data, by the number that the model gives the function; behind the
functions come the tables of stations.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor
from typing import Any, Protocol

import numpy as np

from piazzi.kernels.bundle import Given
from piazzi.model import Model
from piazzi.model.definitions import TIME, Definitions
from piazzi.model.functions import STATION_TABLE, Signature, signature_of
from piazzi.outside.evaluation import aligned, whole_registers
from piazzi.problem.checks import Array, frozen
from piazzi.text import nearest

DAY = 86400.0
MARGIN = 3600.0  # seconds that a block reaches beyond what is asked for
NO_DATA = frozen([0.0])


class Recipe(Protocol):
    """What makes the data of a function from outside."""

    @property
    def signature(self) -> Signature: ...
    @property
    def checksum(self) -> str: ...
    @property
    def span(self) -> tuple[float, float] | None: ...
    def block(self, first: float, last: float) -> Array: ...
    def value(self, *arguments: float) -> Sequence[float]: ...


def checked_functions(given: Mapping[str, Any], model: Model) -> dict[str, Recipe]:
    """The functions by name, in the model's order; raises ValueError where they are not those of the model."""
    known = dict(model.functions)
    for name in given:
        if name not in known:
            raise ValueError(f"function {name!r} is not one of the model's{nearest(name, known)}")
    out = {}
    for name, signature in known.items():
        if name not in given:
            raise ValueError(f"function {name!r} of the model has no data: give functions = {{{name!r}: ...}}")
        if signature_of(given[name], name) != signature:
            raise ValueError(
                f"function {name!r} is {given[name].signature.function} with {given[name].signature.arguments} arguments, but "
                f"the model was made for {signature.function} with {signature.arguments}"
            )
        if not hasattr(given[name], "block"):
            raise ValueError(f"function {name!r} is a signature only: the problem needs its data")
        out[name] = given[name]
    _check_shared(out)
    return out


def _check_shared(functions: Mapping[str, Recipe]) -> None:
    """Raise ValueError where functions that read one table were made for different ones."""
    first: dict[str, str] = {}
    for name, recipe in functions.items():
        shared = recipe.signature.shared
        other = first.setdefault(shared, name) if shared else name
        if functions[other].checksum != recipe.checksum:
            raise ValueError(f"functions {other!r} and {name!r} read one table, {shared}, but differ in their data or epoch")


def recipes_of(model: Model, functions: Mapping[str, Recipe], places: Sequence[Any]) -> tuple[Recipe, ...]:
    """One recipe for each number: of the functions, then of the stations that have a place."""
    first: dict[int, Recipe] = {}
    for name, slot in model.slots.items():
        first.setdefault(slot, functions[name])
    return (*first.values(), *(place for place in places if place is not None))


def station_numbers(model: Model, places: Sequence[Any]) -> list[dict[str, float]]:
    """For each station the number that says which table is its own, where it has a place."""
    number, out = len(set(model.slots.values())), []
    for place in places:
        out.append({} if place is None else {STATION_TABLE: float(number)})
        number += place is not None
    return out


def exact(recipe: Any) -> Any:
    """The recipe whose derivatives are those of its values: itself, unless it has another for that."""
    return getattr(recipe, "exact", recipe)


def days(first: float, last: float) -> tuple[float, float]:
    """The span that a block is made for."""
    return floor((first - MARGIN) / DAY) * DAY, ceil((last + MARGIN) / DAY) * DAY


def spans_of(model: Model, functions: Mapping[str, Any]) -> tuple[tuple[str, tuple[float, float]], ...]:
    """Functions that have values for some times only, with the first and the last of these."""
    found = [(name, recipe.span) for name, recipe in functions.items() if recipe.span is not None]
    layers: list[Definitions] = [model.definitions, *(sensor.definitions for sensor in model.sensors)]
    for call in (call for layer in layers for d in layer for call in d.calls):
        spans = getattr(functions.get(call.function), "spans", ())
        found += [(call.function, s) for s, text in zip(spans, call.texts, strict=False) if s is not None and text == TIME]
    return tuple(dict.fromkeys(found))


def check_span(spans: Iterable[tuple[str, tuple[float, float]]], first: float, last: float) -> None:
    """Raise ValueError where a function has no values at some of these times."""
    for name, span in spans:
        if not span[0] <= first <= last <= span[1]:
            when = first if first < span[0] else last
            raise ValueError(f"{name!r} has values from t = {span[0]:g} to {span[1]:g} s, and t = {when:g} s is outside")


def block_of(recipes: Sequence[Recipe], first: float, last: float) -> Array:
    """The block for a span of times."""
    if not recipes:
        return NO_DATA
    parts = [np.asarray(recipe.block(first, last), dtype=float) for recipe in recipes]
    ends = np.cumsum([whole_registers(count) for count in (len(recipes), *map(len, parts))])
    block = aligned(max(int(ends[-1]), 1))
    for i, (at, part) in enumerate(zip(ends, parts, strict=False)):
        block[i], block[at : at + len(part)] = at, part
    block.setflags(write=False)
    return block


class Told:
    """What kernels are told of a problem's model: numbers, and data of functions for the times that were asked for so far.

    These are `start` alone where the bundle is wanted before any.
    """

    def __init__(
        self, given: Array, manoeuvres: Array, recipes: Sequence[Recipe], spans: Sequence[tuple[str, Any]], start: float
    ) -> None:
        self._given, self._manoeuvres, self._recipes, self._spans = given, manoeuvres, recipes, spans
        self._start = start
        self._state: tuple[Given, float, float, float, float] | None = None

    @property
    def bundle(self) -> Given:
        """Numbers and data; another one whenever more times are asked for."""
        if self._state is None:
            self._state = self._made(self._start, self._start)
        return self._state[0]

    def cover(self, first: float, last: float) -> bool:
        """Have data for these times (s); True where the bundle is another one.  Raises ValueError where there are none."""
        if not self._recipes:
            return False
        check_span(self._spans, first, last)
        if self._state is not None:
            _, begin, end, earliest, latest = self._state
            if begin <= first <= last <= end:
                return False
            first, last = min(first, earliest), max(last, latest)
        self._state = self._made(first, last)
        return True

    def _made(self, first: float, last: float) -> tuple[Given, float, float, float, float]:
        """The bundle, the times that its data reach to, and those that were asked for."""
        begin, end = days(first, last)
        data = block_of(self._recipes, begin, end)
        return Given(parameters=self._given, manoeuvres=self._manoeuvres, data=data), begin, end, first, last
