"""Compiled kernels: from memory, from disk, or made now."""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any

from piazzi.kernels.apart import entry_name, symbol
from piazzi.kernels.build import UNKNOWN_INSIDE, compile_entries, live_entries, look_for_garbage, note_source, plain_entries
from piazzi.kernels.folder import Folder, private_folder, writable_folder
from piazzi.kernels.library import load_objects, say_where
from piazzi.kernels.spec import KernelSpec, fragment_file, text_digest, tried
from piazzi.kernels.store import Kept, keep_where_possible, kept_in, kept_of_text

LOGGER = logging.getLogger("piazzi.kernels")
_spent: list[float] = []
_loaded: dict[tuple[KernelSpec, bool], SimpleNamespace] = {}
_making = threading.RLock()  # what is made may ask for another kernel


def is_compiled() -> bool:
    """Whether kernels run compiled: ``PIAZZI_JIT=0`` runs their source as it is."""
    return os.environ.get("PIAZZI_JIT") != "0"


def load(spec: KernelSpec) -> SimpleNamespace:
    """The callable entries of a specification, as attributes: from memory, from disk, or built now.

    A first build logs one line at level INFO on the logger ``piazzi.kernels``.
    """
    compiled = is_compiled()
    found = _loaded.get((spec, compiled))
    return _made(spec, compiled) if found is None else found


def load_plain(spec: KernelSpec) -> SimpleNamespace:
    """The entries uncompiled, in any mode: for a single look."""
    found = _loaded.get((spec, False))
    return _made(spec, False) if found is None else found


def _made(spec: KernelSpec, compiled: bool) -> SimpleNamespace:
    """The entries, by one thread at a time: the others wait for what it makes, which is sooner than to make it as well."""
    with _making:
        found = _loaded.get((spec, compiled))
        if found is None:
            started = time.perf_counter()
            found = _loaded[spec, compiled] = _from_disk_or_built(spec) if compiled else _plain(spec)
            _spent.append(time.perf_counter() - started)
        return found


@contextlib.contextmanager
def fragment(name: str, text: str) -> Iterator[None]:
    """A fragment of one's own within a block, for trying and for tests; raises ValueError where there is one of that name."""
    if name in tried or fragment_file(name).exists():
        raise ValueError(f"there is a kernel fragment {name!r} already")
    tried[name] = text
    try:
        yield
    finally:
        del tried[name]
        for key in [key for key in _loaded if name in key[0].fragments]:
            del _loaded[key]


def _renew_lock() -> None:
    """In a new process the thread that held the lock, and what it was building, is not there."""
    global _making  # noqa: PLW0603
    _making = threading.RLock()
    look_for_garbage()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_lock)


def build_seconds() -> float:
    """Seconds that this process has spent on loading and compiling kernels."""
    return sum(_spent)


def _plain(spec: KernelSpec) -> SimpleNamespace:
    source = spec.source("plain")
    return SimpleNamespace(**plain_entries(source, spec.sizes))


def _from_disk_or_built(spec: KernelSpec) -> SimpleNamespace:
    digest, (place, _) = spec.digest(), private_folder()
    entries = _read(place, digest, spec) if place else None
    if entries is None:
        home = writable_folder()
        LOGGER.info("compiling %s for %s, once (about 3 to 15 s) ...", spec.unit or spec.fragments[-1], spec.subject)
        started = time.perf_counter()
        entries = _build(spec, home, digest)
        LOGGER.debug("compiled in %.1f s into %s", time.perf_counter() - started, home and home.path / digest)
    return SimpleNamespace(**entries)


def _read(place: Folder, digest: str, spec: KernelSpec) -> dict[str, Any] | None:
    """Entries of a finished folder, or None where something is missing, truncated, altered or not ours."""
    kept = kept_in(place, digest)
    return None if kept is None else _bound(spec, kept)


def _bound(spec: KernelSpec, kept: Kept) -> dict[str, Any]:
    """Entries of object code, whose calls of other modules go to those of this specification's model."""
    _bind(spec, kept.calls)
    return dict(load_objects(kept.objects, kept.symbols, spec.sizes))


def _bind(spec: KernelSpec, calls: Iterable[str]) -> None:
    """Load the modules that are called, and tell where they are: what is loaded next finds them."""
    found = [(unit, load(spec.module_of(unit))) for unit in calls]  # each may tell of its own
    for unit, module in found:
        say_where(symbol(unit), getattr(module, entry_name(unit)).address)


def _build(spec: KernelSpec, place: Folder | None, digest: str) -> dict[str, Any]:
    """Compile, and load what came of it."""
    source, calls = spec.parts("compiled")
    try:
        kept = _compiled(place, digest, source, calls)
    except UNKNOWN_INSIDE as error:
        _bind(spec, calls)
        return _built_publicly(source, spec.sizes, error)
    return _bound(spec, kept)


def _compiled(place: Folder | None, digest: str, source: str, calls: list[str]) -> Kept:
    """What the source gives, kept under this name where that can be done: compiled, unless a model of other names had it."""
    text = text_digest(source, calls)
    kept = kept_of_text(place, text) if place else None
    if kept is None:
        kept = Kept(*compile_entries(source), calls, text)
    keep_where_possible(place, digest, source, kept)
    return kept


def make(spec: KernelSpec) -> None:
    """Compile a module and keep it on disk, for other processes."""
    _compiled(writable_folder(), spec.digest(), *spec.parts("compiled"))


def missing(specs: Iterable[KernelSpec]) -> list[KernelSpec]:
    """Of the modules, and of those that they call, the ones that are neither in memory nor on disk."""
    place, _ = private_folder()
    out, seen = list[KernelSpec](), set[str]()
    waiting = [spec for spec in specs if (spec, True) not in _loaded]
    while waiting:
        spec = waiting.pop(0)
        digest = spec.digest()
        if digest in seen or not tried.keys().isdisjoint(spec.fragments):
            continue
        seen.add(digest)
        kept = kept_in(place, digest) if place else None
        if kept is None:
            out.append(spec)
        calls = kept.calls if kept is not None else spec.parts("compiled")[1]
        waiting += [spec.module_of(unit) for unit in calls] if spec.apart is not None else []
    return out


def _built_publicly(source: str, sizes: Mapping[str, int], error: Exception) -> dict[str, Any]:
    """The entries by public functions of Numba; raises what was wrong first where they do not serve either."""
    try:
        entries = live_entries(source, sizes)
    except Exception:
        note_source(source, error)
        raise error from None
    _warn_of_numba(f"{type(error).__name__}: {error}")
    return dict(entries)


@cache
def _warn_of_numba(why: str) -> None:
    from importlib.metadata import version

    numba = version("numba")
    warnings.warn(
        f"Piazzi does not know Numba {numba} from inside ({why}): every run compiles its kernels anew, and for longer.",
        stacklevel=2,
    )
