"""Generated source -> object files, by Numba.  The only place that compiles."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from piazzi.kernels.library import INTEGER, POINTER, REAL, Entry, PlainEntry
from piazzi.kernels.settings import own_settings

UNKNOWN_INSIDE = (ImportError, AttributeError, TypeError)


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
    """Object code of each entry, and its symbol with the kinds of its arguments.

    Raises
    ------
    ImportError, AttributeError, TypeError
        Among others, where parts of Numba are no longer what they were: `live_entries` may serve.
    """
    try:
        return _compiled(path, names)
    except UNKNOWN_INSIDE:
        raise
    except Exception as error:
        tell_of_source(path, error)
        raise


def tell_of_source(path: Path, error: Exception) -> None:
    """Keep a copy of a source beside the folder that it is built in, which goes, and name it in the error."""
    handle, name = tempfile.mkstemp(prefix="failed-", suffix=".py", dir=path.parent.parent)
    with open(handle, "wb") as copy:
        copy.write(path.read_bytes())
    error.add_note(f"the source of the kernel that could not be compiled is kept in {name}")


def _compiled(path: Path, names: tuple[str, ...]) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    with own_settings():
        from piazzi.kernels.compiler import object_code

        module = import_file(path)
        callbacks = {name: getattr(module, name) for name in names}
        objects = {name: object_code(callback) for name, callback in callbacks.items()}
        symbols = {name: (callback.native_name, _kinds(callback)) for name, callback in callbacks.items()}
    return objects, symbols


def live_entries(path: Path, names: tuple[str, ...]) -> dict[str, Entry]:
    """The entries as Numba itself loads them, by its public functions alone: there is no object code to keep."""
    with own_settings():
        from piazzi.kernels.compiler import public_way

        with public_way():
            module = import_file(path)
        callbacks = {name: getattr(module, name) for name in names}
        return {name: Entry(callback.address, _kinds(callback), callback) for name, callback in callbacks.items()}


def _kinds(callback: Any) -> tuple[str, ...]:
    """Of an entry's arguments, by its annotations."""
    given = callback.__wrapped__.__annotations__.items()
    return tuple({int: INTEGER, float: REAL}.get(kind, POINTER) for name, kind in given if name != "return")


def entry_names(source: str) -> tuple[str, ...]:
    """Names of the functions marked `entry`."""
    import ast

    found = [n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef)]
    return tuple(n.name for n in found if any(isinstance(d, ast.Name) and d.id == "entry" for d in n.decorator_list))
