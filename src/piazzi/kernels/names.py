"""Names of a composed kernel: what each part defines and what it needs, checked before anything is compiled."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterable, Mapping
from pathlib import Path

FRAGMENTS = Path(__file__).parent / "fragments"


def check_names(parts: Mapping[str, str]) -> None:
    """Check the parts of a module, by name, against each other and the vocabulary of kernels.

    Raises
    ------
    ValueError
        Where two parts define the same function, or one needs a name that nothing defines.
    """
    from piazzi.kernels import plain

    trees = {part: ast.parse(text) for part, text in parts.items()}
    home: dict[str, str] = {}
    for part, tree in trees.items():
        for name in provided(tree):
            if name in home:
                where = f"twice in {part!r}" if home[name] == part else f"in {home[name]!r} and in {part!r}"
                raise ValueError(f"kernel function {name!r} is defined {where}")
            home[name] = part
    known = home.keys() | vars(plain).keys() | vars(builtins).keys()
    functions = {f.name: f for tree in trees.values() for f in tree.body if isinstance(f, ast.FunctionDef)}
    for function in reached(functions):
        for name in sorted(needed(functions[function]) - known):
            where = f"kernel fragment {home[function]!r}: {function!r}"
            raise ValueError(f"{where} needs {name!r}, which no part of the kernel defines{_elsewhere(name)}")


def reached(functions: Mapping[str, ast.FunctionDef]) -> list[str]:
    """Functions that an entry calls, directly or not: the others are never compiled."""
    found = [
        name for name, f in functions.items() if any(isinstance(d, ast.Name) and d.id == "entry" for d in f.decorator_list)
    ]
    for name in found:
        found += [other for other in needed(functions[name]) if other in functions and other not in found]
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


def needed(function: ast.FunctionDef) -> set[str]:
    """Names that a function takes from outside of itself."""
    names = [node for node in ast.walk(function) if isinstance(node, ast.Name)]
    own = {a.arg for a in ast.walk(function.args) if isinstance(a, ast.arg)}
    own |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return {node.id for node in names if isinstance(node.ctx, ast.Load)} - own


def _elsewhere(name: str) -> str:
    """Which fragments of the package define it."""
    found = sorted(_defining(name, FRAGMENTS.glob("*.py")))
    return f"; it is in {', '.join(found)}" if found else ""


def _defining(name: str, files: Iterable[Path]) -> list[str]:
    return [file.stem for file in files if name in provided(ast.parse(file.read_text(encoding="utf-8")))]
