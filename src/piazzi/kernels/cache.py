"""Compiled kernels between runs: one sub-folder of the private folder per specification, each with a checksum manifest."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

from piazzi.kernels.apart import entry_name, symbol
from piazzi.kernels.build import UNKNOWN_INSIDE, compile_entries, live_entries, look_for_garbage, note_source, plain_entries
from piazzi.kernels.folder import Folder, private_folder, writable_folder
from piazzi.kernels.library import load_objects, say_where
from piazzi.kernels.settings import may_be_kept
from piazzi.kernels.spec import KernelSpec, fragment_file, tried

LOGGER = logging.getLogger("piazzi.kernels")
MANIFEST = "manifest.json"
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


class _Kept(NamedTuple):
    """What a finished folder holds: object files, their symbols with what they take, and the units that they call."""

    objects: dict[str, bytes]
    symbols: dict[str, tuple[str, tuple[str, ...]]]
    calls: list[str]


def _read(place: Folder, digest: str, spec: KernelSpec) -> dict[str, Any] | None:
    """Entries of a finished folder, or None where something is missing, truncated, altered or not ours."""
    kept = _kept(place, digest)
    return None if kept is None else _bound(spec, kept)


def _kept(place: Folder, digest: str) -> _Kept | None:
    try:
        with place.inside(digest) as home:
            manifest = json.loads(home.read(MANIFEST))
            objects = {}
            for name, checksum in manifest["objects"].items():
                objects[name] = home.read(f"{name}.o")
                if hashlib.sha256(objects[name]).hexdigest() != checksum:
                    return None
        symbols = {name: (symbol, tuple(kinds)) for name, (symbol, kinds) in manifest["symbols"].items()}
        if manifest["seal"] != _seal(manifest, digest):
            return None
        return _Kept(objects, symbols, manifest["calls"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _bound(spec: KernelSpec, kept: _Kept) -> dict[str, Any]:
    """Entries of object code, whose calls of other modules go to those of this specification's model."""
    _bind(spec, kept.calls)
    return dict(load_objects(kept.objects, kept.symbols, spec.sizes))


def _bind(spec: KernelSpec, calls: Iterable[str]) -> None:
    """Load the modules that are called, and tell where they are: what is loaded next finds them."""
    found = [(unit, load(spec.module_of(unit))) for unit in calls]  # each may tell of its own
    for unit, module in found:
        say_where(symbol(unit), getattr(module, entry_name(unit)).address)


def _seal(manifest: dict[str, Any], digest: str) -> str:
    """Checksum of the manifest itself, and of whose it is: its symbols and kinds decide how the code is called."""
    body = json.dumps([digest, manifest["objects"], manifest["symbols"], manifest["calls"]], sort_keys=True)
    return hashlib.sha256(body.encode()).hexdigest()


def _build(spec: KernelSpec, place: Folder | None, digest: str) -> dict[str, Any]:
    """Compile, and keep what came of it where that can be done."""
    source, calls = spec.parts("compiled")
    try:
        kept = _Kept(*compile_entries(source), calls)
    except UNKNOWN_INSIDE as error:
        _bind(spec, calls)
        return _built_publicly(source, spec.sizes, error)
    _keep_where_possible(place, digest, source, kept)
    return _bound(spec, kept)


def _keep_where_possible(place: Folder | None, digest: str, source: str, kept: _Kept) -> None:
    if place is None or not may_be_kept():
        return
    try:
        _keep(place, digest, source, kept)
    except OSError as error:  # a full disk: the code is here, and is made again next time
        LOGGER.info("kernels are not kept in %s: %s", place.path, error.strerror or error)


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


def _keep(place: Folder, digest: str, source: str, kept: _Kept) -> None:
    """Write into a folder of our own and move that into place: two processes may do so at once."""
    with contextlib.suppress(OSError):
        _sweep(place)
    with place.new(".building-") as (work, home):
        try:
            home.write("kernels.py", source.encode())
            for name, code in kept.objects.items():
                home.write(f"{name}.o", code)
            manifest: dict[str, Any] = {
                "objects": {n: hashlib.sha256(c).hexdigest() for n, c in kept.objects.items()},
                "symbols": kept.symbols,
                "calls": kept.calls,
            }
            seal = _seal(json.loads(json.dumps(manifest)), digest)
            home.write(MANIFEST, json.dumps(manifest | {"seal": seal}).encode())
            _move(place, work, digest)
        finally:
            place.remove(work)


def _sweep(place: Folder) -> None:
    """Remove what builds that were killed left behind: what no living process has locked, or is an hour old."""
    for name, written in place.ages().items():
        if not name.startswith((".building-", ".damaged-")):
            continue
        if time.time() - written > 3600:
            place.remove(name)
            continue
        with contextlib.suppress(OSError), place.inside(name) as found:
            if found.hold(wait=False):
                place.remove(name)


def _move(place: Folder, work: str, digest: str) -> None:
    """Put a finished folder in its place; one that is damaged makes way, one that another process finished stays."""
    for _ in range(3):
        try:
            place.rename(work, digest)
            return
        except OSError:
            if _kept(place, digest) is not None:
                return
            aside = f".damaged-{os.urandom(4).hex()}"
            with contextlib.suppress(OSError):
                place.rename(digest, aside)
            place.remove(aside)
