"""Functions of generated modules that are the same in several, down to all that they call: compiled once in a process.

Modules of one run differ in little: the motion alone, with its derivative, in lanes; the same forces with one more unknown.
Most of what a kernel takes to compile, Numba spends on types and on intermediate code, and both are kept with the function.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

from piazzi.kernels.entries import is_entry
from piazzi.kernels.names import needed, provided

MOST_SHARED = 1000  # functions that are remembered


def fill(module: ModuleType, source: str, shared: dict[str, Any]) -> None:
    """Run the source of a module in it, but for definitions that `shared` has; what it defines is in there afterwards.

    Entries are not shared: each is what its module is for.
    """
    tree = ast.parse(source)
    keys = _keys(tree.body, source.splitlines())
    if len(shared) > MOST_SHARED:
        shared.clear()
    there = {name: shared[key] for name, key in keys.items() if key in shared}
    vars(module).update(there)
    tree.body = [node for node in tree.body if not there.keys() & _defined(node)]
    exec(compile(tree, "<string>", "exec", dont_inherit=True), vars(module))
    shared.update({key: getattr(module, name) for name, key in keys.items()})


def _keys(body: Iterable[ast.stmt], lines: list[str]) -> Mapping[str, str]:
    """By name of what may be shared, a hash of its own text and of all that it reaches."""
    texts, needs = dict[str, str](), dict[str, set[str]]()
    entries = set[str]()
    rest = ""  # what else runs there, such as `a, b = 1, 2` of a user's own code: any function may need it
    for node in body:
        first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
        for name in _defined(node):
            texts[name] = "\n".join(lines[first - 1 : node.end_lineno])
            needs[name] = needed(node)
        if isinstance(node, ast.FunctionDef) and is_entry(node):
            entries.add(node.name)
        if not _defined(node) and not isinstance(node, ast.Import | ast.ImportFrom | ast.Expr):
            rest += "\n".join(lines[first - 1 : node.end_lineno])
    return {name: _key(name, texts, needs, rest) for name in texts.keys() - entries}


def _key(name: str, texts: Mapping[str, str], needs: Mapping[str, set[str]], rest: str) -> str:
    found, waiting = {name}, [name]
    while waiting:
        new = (needs[waiting.pop()] & texts.keys()) - found
        found |= new
        waiting += new
    return hashlib.sha256(repr([name, rest, *((n, texts[n]) for n in sorted(found))]).encode()).hexdigest()


def _defined(node: ast.stmt) -> set[str]:
    return set(provided(ast.Module([node], [])))
