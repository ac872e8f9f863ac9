"""Names, equations and named values of equations, as they are given: SymPy or text, in; canonical text, out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from piazzi.expressions import evaluate, from_sympy, is_name, names

TIME = "t"
STEP = "dt"
Definitions = tuple[tuple[str, str], ...]


def text_of(equation: Any) -> str:
    """Canonical text of an equation given as text, number or SymPy expression; raises `ExpressionError`."""
    if isinstance(equation, str):
        names(equation)
        return equation.strip()
    return from_sympy(equation)


def name_of(symbol: Any, what: str) -> str:
    """Name of a SymPy symbol, or the text itself; raises ValueError unless it can name a variable in an equation."""
    name = str(symbol)
    if not is_name(name):
        raise ValueError(
            f"{what} {name!r} cannot be used as a name: write a letter followed by letters, digits and single underscores"
        )
    return name


def definitions_of(given: Any, owner: str) -> Definitions:
    """Names and the text of their equations, sorted by what they need.

    Raises
    ------
    ValueError
        For a name that cannot stand in an equation, an equation outside the language, or definitions that need each other.
    """
    pairs = given.items() if isinstance(given, Mapping) else tuple(given)
    texts = {name_of(name, "definition"): text_of(equation) for name, equation in pairs}
    if len(texts) < len(pairs):
        raise ValueError(f"{owner}: a name is defined twice")
    return _sorted(texts, owner)


def _sorted(texts: Mapping[str, str], owner: str) -> Definitions:
    """By need, and else in the order given."""
    needs = {name: names(text) & texts.keys() for name, text in texts.items()}
    done: dict[str, str] = {}
    while len(done) < len(texts):
        ready = [name for name in texts if name not in done and needs[name] <= done.keys()]
        if not ready:
            raise ValueError(f"{owner}: {_circle(needs, done)} need each other")
        done.update((name, texts[name]) for name in ready)
    return tuple(done.items())


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
    texts = {name: text for layer in layers for name, text in layer}
    found: set[str] = set()
    waiting = [name for text in wanted for name in names(text)]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += names(texts[name]) if name in texts else ()
    return frozenset(found)


def with_values(values: Mapping[str, float], *layers: Definitions) -> dict[str, float]:
    """The values with those of the definitions beside them; a definition whose own names have no value is left out."""
    out = dict(values)
    for layer in layers:
        for name, text in layer:
            if all(n in out for n in names(text)):
                out[name] = evaluate(text, out)
    return out


def unused(definitions: Definitions, users: Sequence[str]) -> list[str]:
    """Names of definitions that no equation needs."""
    found = needed(users, definitions)
    return [name for name, _ in definitions if name not in found]
