"""Generated source -> object files, by Numba.  The only place that compiles."""

from __future__ import annotations

import tempfile
from importlib.abc import InspectLoader
from importlib.util import module_from_spec, spec_from_loader
from types import ModuleType
from typing import Any

from piazzi.kernels.library import INTEGER, POINTER, REAL, Entry, PlainEntry
from piazzi.kernels.settings import own_settings

UNKNOWN_INSIDE = (ImportError, AttributeError, TypeError)


class _Generated(InspectLoader):
    """Source that we wrote ourselves, in memory: a disk may be full."""

    def __init__(self, source: str) -> None:
        self.source = source

    def get_source(self, fullname: str) -> str:
        return self.source


def module_of(source: str) -> ModuleType:
    """The module of a source, without leaving it in `sys.modules`."""
    spec = spec_from_loader("piazzi_generated", _Generated(source))
    if spec is None or spec.loader is None:
        raise ImportError("cannot import what was generated")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def plain_entries(source: str, names: tuple[str, ...]) -> dict[str, PlainEntry]:
    """The entries of a module generated for the plain vocabulary."""
    module = module_of(source)
    return {name: PlainEntry(getattr(module, name)) for name in names}


def compile_entries(source: str, names: tuple[str, ...]) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    """Object code of each entry, and its symbol with the kinds of its arguments.

    Raises
    ------
    ImportError, AttributeError, TypeError
        Among others, where parts of Numba are no longer what they were: `live_entries` may serve.
    """
    try:
        return _compiled(source, names)
    except UNKNOWN_INSIDE:
        raise
    except Exception as error:
        tell_of_source(source, error)
        raise


def tell_of_source(source: str, error: Exception) -> None:
    """Keep a source in the folder for temporary files, and name it in the error."""
    try:
        with tempfile.NamedTemporaryFile("w", prefix="failed-", suffix=".py", delete=False) as copy:
            copy.write(source)
    except OSError:  # the error is what counts
        return
    error.add_note(f"the source of the kernel that could not be compiled is kept in {copy.name}")


def _compiled(source: str, names: tuple[str, ...]) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    with own_settings():
        from piazzi.kernels.compiler import object_code

        module = module_of(source)
        callbacks = {name: getattr(module, name) for name in names}
        objects = {name: object_code(callback) for name, callback in callbacks.items()}
        symbols = {name: (callback.native_name, _kinds(callback)) for name, callback in callbacks.items()}
    return objects, symbols


def live_entries(source: str, names: tuple[str, ...]) -> dict[str, Entry]:
    """The entries as Numba itself loads them, by its public functions alone: there is no object code to keep."""
    with own_settings():
        from piazzi.kernels.compiler import public_way

        with public_way():
            module = module_of(source)
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
