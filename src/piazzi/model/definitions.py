"""Names, equations and named values of equations, as they are given: SymPy or text, in; canonical text, out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from piazzi.expressions import CONSTANTS, FUNCTIONS, from_sympy, is_name, names
from piazzi.expressions.outside import split, whole_call
from piazzi.model.functions import ROOT

TIME = "t"
STEP = "dt"
ITERATIONS = 4


@dataclass(frozen=True)
class Definition:
    """One or several named values that are worked out together.

    `texts` is the equation of a value; with a `function` the arguments of its call; of a root the equation that is zero and
    where the iteration starts, with `iterations` Newton steps through definitions `inner` of its own.
    """

    names: tuple[str, ...]
    texts: tuple[str, ...]
    function: str = ""
    inner: tuple[Definition, ...] = ()
    iterations: int = 0

    def __iter__(self) -> Iterator[str]:
        """The names and the text, as a scenario has them."""
        return iter((", ".join(self.names), self.text))

    @property
    def text(self) -> str:
        """Its equation, or the call that gives it."""
        return f"{self.function}({', '.join(self.texts)})" if self.function else self.texts[0]

    @cached_property
    def provides(self) -> tuple[str, ...]:
        """Every name that has a value once this is worked out."""
        return (*self.names, *(name for d in self.inner for name in d.provides))

    @cached_property
    def needs(self) -> frozenset[str]:
        """Names that have to be known before."""
        found = [name for text in self.texts for name in names(text)]
        if self.function != ROOT:
            return frozenset(found)
        return frozenset([*found, *(name for d in self.inner for name in d.needs)]) - set(self.provides)

    @property
    def calls(self) -> Iterator[Definition]:
        """Calls of functions from outside, in it and in its own definitions."""
        if self.function and self.function != ROOT:
            yield self
        for d in self.inner:
            yield from d.calls


Definitions = tuple[Definition, ...]


class Hoist:
    """Calls of functions from outside, each made a definition with a name of its own.

    `outside` names the functions; None is for any name, where they are not known yet.
    """

    def __init__(self, outside: Collection[str] | None, suffix: str = "") -> None:
        self.outside = outside
        self.found: list[Definition] = []
        self._suffix = suffix
        self._seen: dict[tuple[str, tuple[str, ...]], str] = {}

    def text(self, equation: Any) -> str:
        """Canonical text of an equation given as text, number or SymPy expression; raises `ExpressionError`."""
        written = equation.strip() if isinstance(equation, str) else from_sympy(equation, self.outside)
        rest = split(written, self.outside, self._stand_in)
        names(rest)
        return rest

    def _stand_in(self, function: str, arguments: tuple[str, ...]) -> str:
        """The name of a call's value: one for every function and set of arguments."""
        if (function, arguments) not in self._seen:
            name = self._seen[function, arguments] = f"{function}_{len(self._seen) + 1}{self._suffix}"
            self.found.append(Definition((name,), arguments, function))
        return self._seen[function, arguments]

    def definition(self, left: tuple[str, ...], equation: Any) -> Definition:
        """Names and what they are: a value, or the outputs of one call."""
        written = equation.strip() if isinstance(equation, str) else from_sympy(equation, self.outside)
        if whole_call(written, self.outside):
            self.text(written)
            made = self.found.pop()
            self._seen.pop((made.function, made.texts))
            return replace(made, names=left)
        if len(left) > 1:
            raise ValueError(f"{', '.join(left)} are several values, which only a function from outside gives: {written!r}")
        return Definition(left, (self.text(written),))


def text_of(equation: Any) -> str:
    """Canonical text of an equation of the language, given as text, number or SymPy expression; raises `ExpressionError`."""
    return Hoist(()).text(equation)


def name_of(symbol: Any, what: str) -> str:
    """Name of a SymPy symbol, or the text itself; raises ValueError unless it can name a variable in an equation."""
    name = str(symbol)
    if not is_name(name):
        taken = "it is one of the language" if name in (*FUNCTIONS, *CONSTANTS) else ""
        why = taken or "write a letter followed by letters, digits and single underscores"
        raise ValueError(f"{what} {name!r} cannot be used as a name: {why}")
    return name


def definitions_of(given: Any, owner: str, hoist: Hoist, roots: Any = ()) -> Definitions:
    """Definitions and roots as given, with the calls in them; unsorted (see `in_order`).

    Raises
    ------
    ValueError
        For a name that cannot stand in an equation, or an equation outside the language.
    """
    pairs = given.items() if isinstance(given, Mapping) else tuple(given)
    out = [d if isinstance(d, Definition) else hoist.definition(_names_of(d[0]), d[1]) for d in pairs]
    for name, root in dict(roots).items():
        out.append(_root(name_of(name, "root"), root, owner, hoist))
    return tuple(out)


def _names_of(left: Any) -> tuple[str, ...]:
    parts = left.split(",") if isinstance(left, str) else left if isinstance(left, tuple | list) else [left]
    return tuple(name_of(part.strip() if isinstance(part, str) else part, "definition") for part in parts)


def _root(name: str, given: Any, owner: str, hoist: Hoist) -> Definition:
    """A root from its table: `root`, `start`, `iterations`, `definitions`."""
    where = f"{owner}: root {name!r}"
    table = dict(given)
    for key in table.keys() - {"root", "start", "iterations", "definitions", "roots"}:
        raise ValueError(f"{where} has {key!r}; it takes root, start, iterations, definitions and roots")
    if "root" not in table:
        raise ValueError(f"{where} has no equation: give root = an expression that is zero at the solution")
    iterations = table.get("iterations", ITERATIONS)
    if not isinstance(iterations, int) or not 1 <= iterations <= 20:
        raise ValueError(f"{where} has iterations = {iterations!r}; it must be a whole number from 1 to 20")
    own = Hoist(hoist.outside, f"_{name}")
    equation = own.text(table["root"])
    start = hoist.text(table.get("start", "0"))
    inner = definitions_of(table.get("definitions", {}), where, own, table.get("roots", {}))
    return Definition((name,), (equation, start), ROOT, in_order((*inner, *own.found), where, (name,)), iterations)


def in_order(given: Iterable[Definition], owner: str, known: Collection[str] = ()) -> Definitions:
    """By need, and else in the order given; raises ValueError for definitions that need each other, or names given twice."""
    waiting = list(given)
    by_name: dict[str, Definition] = {}
    for d in waiting:
        for name in d.provides:
            if name in by_name or name in known:
                raise ValueError(f"{owner}: a name is defined twice ({name!r})")
            by_name[name] = d
    done: list[Definition] = []
    have: set[str] = set()
    while waiting:
        ready = [d for d in waiting if d.needs & by_name.keys() <= have]
        if not ready:
            needs = {name: d.needs & by_name.keys() for d in waiting for name in d.names}
            raise ValueError(f"{owner}: {_circle(needs, have)} need each other")
        done += ready
        have.update(name for d in ready for name in d.provides)
        waiting = [d for d in waiting if d not in ready]
    return tuple(done)


def _circle(needs: Mapping[str, Collection[str]], done: Collection[str]) -> str:
    """The names of one circle, in the order in which they need each other."""
    path = [next(name for name in needs if name not in done)]
    while True:
        name = min(n for n in needs[path[-1]] if n not in done)
        if name in path:
            circle = path[path.index(name) :]
            return " and ".join(map(repr, circle)) if len(circle) > 1 else f"{name!r} and itself"
        path.append(name)


def needed(wanted: Iterable[str], *layers: Definitions) -> frozenset[str]:
    """The names that occur in these texts, or in a definition that they need."""
    definitions = {name: d for layer in layers for d in layer for name in d.provides}
    found: set[str] = set()
    waiting = [name for text in wanted for name in names(text)]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            if name in definitions:
                waiting += (*definitions[name].names, *definitions[name].needs)
    return frozenset(found)


def unused(definitions: Definitions, users: Sequence[str]) -> list[str]:
    """Names of definitions of which no equation needs any value."""
    found = needed(users, definitions)
    return [", ".join(d.names) for d in definitions if not found & set(d.provides)]
