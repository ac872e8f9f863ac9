"""Entries of kernels, as written with bundles and as compiled: what they take, and the source that takes it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable

from piazzi.kernels import bundle  # noqa: F401  # declares them
from piazzi.kernels.members import BUNDLES, FLOATS, INDICES, INTEGER, REAL, Slot

_ANNOTATIONS = {FLOATS: "Array", INDICES: "Indices", INTEGER: "int", REAL: "float"}
_KINDS = {annotation: kind for kind, annotation in _ANNOTATIONS.items()}
_PREFIXES = {FLOATS: "", INDICES: "int64 ", INTEGER: "int "}


def opened(text: str) -> str:
    """The functions of a fragment, with entries that take the members of their bundles, one by one."""
    lines = text.splitlines()
    for node in reversed(ast.parse(text).body):
        if not isinstance(node, ast.FunctionDef) or not is_entry(node):
            continue
        arguments, begin = [], []
        for a in node.args.args:
            if a.annotation is None:
                raise ValueError(f"kernel entry {node.name!r} does not say what {a.arg!r} is")
            kind = ast.unparse(a.annotation)
            slots = BUNDLES[kind].slots if kind in BUNDLES else None
            names = [a.arg] if slots is None else [f"{a.arg}_{slot}" for slot in slots]
            kinds = [kind] if slots is None else [_ANNOTATIONS[slot.kind] for slot in slots.values()]
            arguments += [f"{name}: {k}" for name, k in zip(names, kinds, strict=True)]
            if slots is not None:
                begin.append(f"    {a.arg} = {kind}({', '.join(names)})")
        lines[node.lineno - 1 : node.body[0].lineno - 1] = [f"def {node.name}({', '.join(arguments)}) -> None:", *begin]
    return "\n".join(lines) + "\n"


def definitions(text: str) -> str:
    """Source of the bundles that a text uses."""
    called = {*re.findall(r"\b(\w+)\(", text)}
    used = [b for name, b in BUNDLES.items() if name in called]
    return "".join(f"{b.__name__} = namedtuple({b.__name__!r}, {list(b.slots)!r})\n" for b in used)


def signatures(source: str) -> dict[str, tuple[str, ...]]:
    """The arguments of each entry of a generated source: names of bundles, and what else is passed, as in "x: K N".

    Of what has no size in the entry's `sizes`, the kind by itself.
    """
    return {
        node.name: _signature(node) for node in ast.parse(source).body if isinstance(node, ast.FunctionDef) and is_entry(node)
    }


def is_entry(node: ast.FunctionDef) -> bool:
    """Whether a function is marked as one that Python calls."""
    return any(isinstance(d, ast.Name) and d.id == "entry" for d in node.decorator_list)


def _signature(node: ast.FunctionDef) -> tuple[str, ...]:
    bundles = {}
    for statement in node.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=target)], value=ast.Call(func=ast.Name(id=name), args=args)) if (
                name in BUNDLES
            ):
                if [ast.unparse(a) for a in args] == [f"{target}_{slot}" for slot in BUNDLES[name].slots]:
                    bundles[ast.unparse(args[0])] = name
    said = [k for d in node.decorator_list if isinstance(d, ast.Call) for k in d.keywords]
    sized = {str(k.arg): ast.literal_eval(k.value) for k in said}
    for name in sized.keys() - {a.arg for a in node.args.args}:
        raise ValueError(f"kernel entry {node.name!r} has no argument {name!r} to be of size {sized[name]!r}")
    out, skip = [], 0
    for a in node.args.args:
        if skip:
            skip -= 1
        elif a.arg in bundles:
            out.append(bundles[a.arg])
            skip = len(BUNDLES[bundles[a.arg]].slots) - 1
        else:
            kind = _KINDS[ast.unparse(a.annotation)] if a.annotation else ""
            out.append(f"{a.arg}: {_PREFIXES[kind]}{sized[a.arg]}" if a.arg in sized else kind)
    return tuple(out)


def slot_of(argument: str) -> Slot:
    """What an argument is that is no bundle."""
    _, sized, text = argument.partition(": ")
    return Slot.of(text) if sized else Slot(argument, None)


def flat(signature: Iterable[str]) -> list[str]:
    """Kinds of what object code takes."""
    return [s.kind for a in signature for s in (BUNDLES[a].slots.values() if a in BUNDLES else [slot_of(a)])]
