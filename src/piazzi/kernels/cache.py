"""Compiled kernels between runs: one sub-folder of the private folder per specification, each with a checksum manifest."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import shutil
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from piazzi.kernels.build import compile_entries, entry_names, plain_entries
from piazzi.kernels.folder import private_folder, writable_folder
from piazzi.kernels.library import load_objects
from piazzi.kernels.spec import KernelSpec

LOGGER = logging.getLogger("piazzi.kernels")
MANIFEST = "manifest.json"
# PIAZZI_JIT is read at every run, and the usual way takes as long as the rest of finding a kernel
_environment: Any = getattr(os.environ, "_data", os.environ)
_JIT, _OFF = ("PIAZZI_JIT", "0") if _environment is os.environ else map(os.environ.encodekey, ("PIAZZI_JIT", "0"))
_spent: list[float] = []
_loaded: dict[tuple[KernelSpec, bool], SimpleNamespace] = {}


def is_compiled() -> bool:
    """Whether kernels run compiled: ``PIAZZI_JIT=0`` runs their source as it is."""
    return bool(_environment.get(_JIT) != _OFF)


def load(spec: KernelSpec) -> SimpleNamespace:
    """The callable entries of a specification, as attributes: from memory, from disk, or built now.

    A first build logs one line at level INFO on the logger ``piazzi.kernels``.
    """
    compiled = is_compiled()
    found = _loaded.get((spec, compiled))
    if found is None:
        started = time.perf_counter()
        found = _loaded[spec, compiled] = _from_disk_or_built(spec) if compiled else _plain(spec)
        _spent.append(time.perf_counter() - started)
    return found


def build_seconds() -> float:
    """Seconds that this process has spent on loading and compiling kernels."""
    return sum(_spent)


def _plain(spec: KernelSpec) -> SimpleNamespace:
    source = spec.source("plain")
    with tempfile.TemporaryDirectory(prefix="piazzi-") as folder:
        path = Path(folder) / "kernels.py"
        path.write_text(source)
        return SimpleNamespace(**plain_entries(path, entry_names(source)))


def _from_disk_or_built(spec: KernelSpec) -> SimpleNamespace:
    digest, (place, _) = spec.digest(), private_folder()
    entries = _read(place / digest) if place else None
    if entries is None:
        home = writable_folder() / digest
        LOGGER.info("compiling %s for %s, once (about 3 to 15 s) ...", spec.fragments[-1], spec.subject)
        started = time.perf_counter()
        entries = _build(spec, home)
        LOGGER.debug("compiled in %.1f s into %s", time.perf_counter() - started, home)
    return SimpleNamespace(**entries)


def _read(home: Path) -> dict[str, Any] | None:
    """Entries of a finished folder, or None where something is missing, truncated or altered."""
    try:
        manifest = json.loads((home / MANIFEST).read_text())
        objects = {}
        for name, checksum in manifest["objects"].items():
            objects[name] = (home / f"{name}.o").read_bytes()
            if hashlib.sha256(objects[name]).hexdigest() != checksum:
                return None
        symbols = {name: (symbol, tuple(kinds)) for name, (symbol, kinds) in manifest["symbols"].items()}
        if manifest["seal"] != _seal(manifest):
            return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return dict(load_objects(objects, symbols))


def _seal(manifest: dict[str, Any]) -> str:
    """Checksum of the manifest itself: its symbols and kinds decide how the code is called."""
    body = json.dumps([manifest["objects"], manifest["symbols"]], sort_keys=True)
    return hashlib.sha256(body.encode()).hexdigest()


def _build(spec: KernelSpec, home: Path) -> dict[str, Any]:
    """Compile in a folder of our own, then move it into place: two processes may do so at once."""
    source = spec.source("compiled")
    _sweep(home.parent)
    work = Path(tempfile.mkdtemp(prefix=".building-", dir=home.parent))
    try:
        (work / "kernels.py").write_text(source)
        objects, symbols = compile_entries(work / "kernels.py", entry_names(source))
        for name, code in objects.items():
            (work / f"{name}.o").write_bytes(code)
        manifest: dict[str, Any] = {
            "objects": {n: hashlib.sha256(c).hexdigest() for n, c in objects.items()},
            "symbols": symbols,
        }
        (work / MANIFEST).write_text(json.dumps(manifest | {"seal": _seal(json.loads(json.dumps(manifest)))}))
        _move(work, home)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return dict(load_objects(objects, symbols))


def _sweep(place: Path) -> None:
    """Remove what builds that were killed left behind: nothing takes an hour to compile."""
    for leftover in [*place.glob(".building-*"), *place.glob(".damaged-*")]:
        with contextlib.suppress(OSError):
            if time.time() - leftover.stat().st_mtime > 3600:
                shutil.rmtree(leftover, ignore_errors=True)


def _move(work: Path, home: Path) -> None:
    """Put a finished folder in its place; one that is damaged makes way, one that another process finished stays."""
    for _ in range(3):
        try:
            os.rename(work, home)
            return
        except OSError:
            if _read(home) is not None:
                return
            aside = Path(tempfile.mkdtemp(prefix=".damaged-", dir=home.parent))
            with contextlib.suppress(OSError):
                os.rename(home, aside / "old")
            shutil.rmtree(aside, ignore_errors=True)
