"""Finished kernels on disk: one sub-folder of the private folder per specification, with a checksum manifest."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

from piazzi.kernels.folder import Folder
from piazzi.kernels.settings import may_be_kept

LOGGER = logging.getLogger("piazzi.kernels")
MANIFEST = "manifest.json"
_texts: dict[tuple[Path, str], str] = {}  # of finished folders that were looked at


class Kept(NamedTuple):
    """What a finished folder holds: object files, their symbols with what they take, units that are called, the text's hash."""

    objects: dict[str, bytes]
    symbols: dict[str, tuple[str, tuple[str, ...]]]
    calls: list[str]
    text: str


def kept_in(place: Folder, digest: str) -> Kept | None:
    """What a finished folder holds, or None where something is missing, truncated, altered or not ours."""
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
        return Kept(objects, symbols, manifest["calls"], manifest["text"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def kept_of_text(place: Folder, text: str) -> Kept | None:
    """What was compiled of the same text, which models whose names differ have in common; None where nothing was."""
    try:
        there = [name for name in place.ages() if not name.startswith(".")]
    except OSError:
        return None
    for digest in there:
        at = place.path, digest
        if at not in _texts:
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError, RecursionError), place.inside(digest) as home:
                _texts[at] = json.loads(home.read(MANIFEST))["text"]
        kept = kept_in(place, digest) if _texts.get(at) == text else None
        if kept is not None and kept.text == text:
            return kept
    return None


def _seal(manifest: dict[str, Any], digest: str) -> str:
    """Checksum of the manifest itself, and of whose it is: its symbols and kinds decide how the code is called."""
    body = json.dumps([digest, *(manifest[name] for name in ("objects", "symbols", "calls", "text"))], sort_keys=True)
    return hashlib.sha256(body.encode()).hexdigest()


def keep_where_possible(place: Folder | None, digest: str, source: str, kept: Kept) -> None:
    """Write what was compiled into the folder, where there is one and that can be done."""
    if place is None or not may_be_kept():
        return
    try:
        _keep(place, digest, source, kept)
    except OSError as error:  # a full disk: the code is here, and is made again next time
        LOGGER.info("kernels are not kept in %s: %s", place.path, error.strerror or error)


def _keep(place: Folder, digest: str, source: str, kept: Kept) -> None:
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
                "text": kept.text,
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
            if kept_in(place, digest) is not None:
                return
            aside = f".damaged-{os.urandom(4).hex()}"
            with contextlib.suppress(OSError):
                place.rename(digest, aside)
            place.remove(aside)
