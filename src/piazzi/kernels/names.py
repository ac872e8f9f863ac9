"""Names of a composed kernel: what each part defines and what it needs, checked before anything is compiled."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from piazzi.kernels.entries import is_entry

FRAGMENTS = Path(__file__).parent / "fragments"
MOST_TEXTS = 200  # parts that are remembered, for other modules that have them too


def check_names(parts: Mapping[str, str]) -> tuple[str, ...]:
    """Check the parts of a module, by name, against each other and the vocabulary of kernels; the functions that are reached.

    Raises
    ------
    ValueError
        Where two parts define the same function, or one needs a name that nothing defines.
    """
    from piazzi.kernels import plain

    home: dict[str, str] = {}
    functions: dict[str, _Function] = {}
    for part, text in parts.items():
        names, inside = _read(text)
        for name in names:
            if name in home:
                where = f"twice in {part!r}" if home[name] == part else f"in {home[name]!r} and in {part!r}"
                raise ValueError(f"kernel function {name!r} is defined {where}")
            home[name] = part
        functions |= inside
    known = home.keys() | vars(plain).keys() | vars(builtins).keys()
    reached = tuple(_reached(functions))
    for function in reached:
        for name in sorted(functions[function].needs - known):
            where = f"kernel fragment {home[function]!r}: {function!r}"
            raise ValueError(f"{where} needs {name!r}, which no part of the kernel defines{_elsewhere(name)}")
    return reached


class _Function(NamedTuple):
    is_entry: bool
    needs: frozenset[str]


@lru_cache(maxsize=MOST_TEXTS)
def _read(text: str) -> tuple[tuple[str, ...], Mapping[str, _Function]]:
    """What a part defines, and its functions."""
    tree = ast.parse(text)
    functions = {f.name: _Function(is_entry(f), frozenset(needed(f))) for f in tree.body if isinstance(f, ast.FunctionDef)}
    return tuple(provided(tree)), functions


def _reached(functions: Mapping[str, _Function]) -> Iterable[str]:
    """Functions that an entry calls, directly or not: the others are never compiled."""
    found = dict.fromkeys(name for name, f in functions.items() if f.is_entry)
    waiting = [*found]
    while waiting:
        new = [other for other in sorted(functions[waiting.pop()].needs) if other in functions and other not in found]
        found |= dict.fromkeys(new)
        waiting += new
    return found


def provided(tree: ast.Module) -> list[str]:
    """Functions and constants that a module defines, in their order; one that is defined twice comes twice."""
    out = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            out.append(node.name)
        elif isinstance(node, ast.Assign):
            out += [target.id for target in node.targets if isinstance(target, ast.Name)]
    return out


def needed(statement: ast.stmt) -> set[str]:
    """Names that a function, or what is assigned, takes from outside of itself."""
    inside = [*ast.walk(statement)]
    names = [node for node in inside if isinstance(node, ast.Name)]
    own = {a.arg for a in inside if isinstance(a, ast.arg)} | {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return {node.id for node in names if isinstance(node.ctx, ast.Load)} - own


def _elsewhere(name: str) -> str:
    """Which fragments of the package define it."""
    found = sorted(_defining(name, FRAGMENTS.glob("*.py")))
    return f"; it is in {', '.join(found)}" if found else ""


def _defining(name: str, files: Iterable[Path]) -> list[str]:
    return [file.stem for file in files if name in provided(ast.parse(file.read_text(encoding="utf-8")))]
