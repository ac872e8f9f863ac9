"""Generated source -> object files, by Numba.  The only place that compiles."""

from __future__ import annotations

import hashlib
import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

from piazzi.kernels.library import INTEGER, POINTER, REAL, PlainEntry
from piazzi.kernels.settings import own_settings


def import_file(path: Path) -> ModuleType:
    """The module of a source file that we wrote ourselves, without leaving it in `sys.modules`."""
    spec = importlib.util.spec_from_file_location(f"piazzi_generated_{path.parent.name}", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"cannot import {path}")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def plain_entries(path: Path, names: tuple[str, ...]) -> dict[str, PlainEntry]:
    """The entries of a module generated for the plain vocabulary."""
    module = import_file(path)
    return {name: PlainEntry(getattr(module, name)) for name in names}


def compile_entries(path: Path, names: tuple[str, ...]) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    """Object code of each entry, and its symbol with the kinds of its arguments."""
    try:
        return _compiled(path, names)
    except Exception as error:
        error.add_note(f"the source of the kernel that could not be compiled is kept in {_kept(path)}")
        raise


def _kept(path: Path) -> Path:
    """A copy of a source beside the folder that it is built in, which goes."""
    text = path.read_bytes()
    copy = path.parent.parent / f"failed-{hashlib.sha256(text).hexdigest()[:16]}.py"
    copy.write_bytes(text)
    return copy


def _compiled(path: Path, names: tuple[str, ...]) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    with own_settings():
        from numba import types

        module = import_file(path)
        kinds = {types.int64: INTEGER, types.float64: REAL}
        objects, symbols = {}, {}
        for name in names:
            callback: Any = getattr(module, name)
            objects[name] = callback._library.object_code()
            symbols[name] = (callback.native_name, tuple(kinds.get(a, POINTER) for a in callback._sig.args))
    return objects, symbols


def entry_names(source: str) -> tuple[str, ...]:
    """Names of the functions marked `entry`."""
    import ast

    found = [n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef)]
    return tuple(n.name for n in found if any(isinstance(d, ast.Name) and d.id == "entry" for d in n.decorator_list))
