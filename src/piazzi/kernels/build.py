"""Generated source -> object files, by Numba.  The only place that compiles."""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.abc import InspectLoader
from importlib.util import module_from_spec, spec_from_loader
from types import ModuleType

from piazzi.kernels.entries import signatures
from piazzi.kernels.library import Entry, PlainEntry
from piazzi.kernels.settings import own_settings
from piazzi.kernels.shared import fill

UNKNOWN_INSIDE = (ImportError, AttributeError, TypeError)
_pausing = False


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


def plain_entries(source: str, sizes: Mapping[str, int]) -> dict[str, PlainEntry]:
    """The entries of a module generated for the plain vocabulary."""
    module = module_of(source)
    return {name: PlainEntry(name, getattr(module, name), takes, sizes) for name, takes in signatures(source).items()}


def compile_entries(source: str) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    """Object code of each entry, and its symbol with what it takes.

    Raises
    ------
    ImportError, AttributeError, TypeError
        Among others, where parts of Numba are no longer what they were: `live_entries` may serve.
    """
    try:
        return _compiled(source)
    except UNKNOWN_INSIDE:
        raise
    except Exception as error:
        note_source(source, error)
        raise


def note_source(source: str, error: Exception) -> None:
    """Keep a source in the folder for temporary files, and name it in the error."""
    try:
        with tempfile.NamedTemporaryFile("w", prefix="failed-", suffix=".py", delete=False) as copy:
            copy.write(source)
    except OSError:  # the error is what counts
        return
    error.add_note(f"the source of the kernel that could not be compiled is kept in {copy.name}")


def _compiled(source: str) -> tuple[dict[str, bytes], dict[str, tuple[str, tuple[str, ...]]]]:
    with own_settings(), _garbage_kept():
        from piazzi.kernels.compiled import SHARED
        from piazzi.kernels.compiler import calls_resolved_once, object_code

        with calls_resolved_once():
            module = ModuleType("piazzi_generated")
            fill(module, source, SHARED)
        callbacks = {name: (getattr(module, name), takes) for name, takes in signatures(source).items()}
        objects = {name: object_code(callback) for name, (callback, _) in callbacks.items()}
        symbols = {name: (callback.native_name, takes) for name, (callback, takes) in callbacks.items()}
        for name in callbacks:  # what is shared keeps the module
            delattr(module, name)
    return objects, symbols


@contextmanager
def _garbage_kept() -> Iterator[None]:
    """Look for no garbage while the block lasts: nearly all that Numba makes stays, and looking takes a tenth of its time."""
    global _pausing  # noqa: PLW0603
    _pausing = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        look_for_garbage()


def look_for_garbage() -> None:
    """Go on with what a build, which may have been left behind in another process, has switched off."""
    global _pausing  # noqa: PLW0603
    if _pausing:
        gc.enable()
    _pausing = False


def live_entries(source: str, sizes: Mapping[str, int]) -> dict[str, Entry]:
    """The entries as Numba itself loads them, by its public functions alone: there is no object code to keep."""
    with own_settings(), _garbage_kept():
        from piazzi.kernels.compiler import public_way

        with public_way():
            module = module_of(source)
        callbacks = {name: (getattr(module, name), takes) for name, takes in signatures(source).items()}
        return {name: Entry(name, c.address, takes, sizes, c) for name, (c, takes) in callbacks.items()}
