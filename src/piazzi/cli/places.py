"""Which files of a command are the same: what is written must be neither what is read nor a second thing that is written."""

from __future__ import annotations

import os
import stat
from collections.abc import Hashable, Iterable, Mapping
from contextlib import suppress
from itertools import combinations
from typing import Any

import click

STREAM = "-"


def check_places(given: Mapping[str, Any]) -> None:
    """Refuse parameters of a command of which one names what another would overwrite.  Nothing is opened, nothing changed.

    Raises
    ------
    click.UsageError
        Where a file that is written is one that is read, or is written twice, by whatever names.
    """
    sources = given.get("sources") or (given.get("source"),)
    scenario = "--scenario" if {"source", "sources"} & given.keys() else "SCENARIO"
    read = [*(("SOURCE", s, 0) for s in sources), (scenario, given.get("scenario"), 0), ("--follow", given.get("follow"), 0)]
    output = given.get("output_file")
    printed = given.get("follow") is not None and output is None  # estimates of a stream come while it is read
    written = [("-o", STREAM if printed else output, 1), ("--checkpoint", given.get("checkpoint"), 1)]
    for (label, path, key), (other, second, also) in combinations([*_keyed(written), *_keyed(read)], 2):
        if key == also and label in ("-o", "--checkpoint"):
            first, then = (_shown(*place) for place in ((label, path), (other, second)))
            raise click.UsageError(f"{first} and {then} are the same file", click.get_current_context(silent=True))


def _keyed(places: Iterable[tuple[str, Any, int]]) -> list[tuple[str, str, Hashable]]:
    """Those that are files, each with what it is the same file by."""
    found = [(label, path, _key(path, handle)) for label, path, handle in places if isinstance(path, str) and path]
    return [(label, path, key) for label, path, key in found if key is not None]


def _key(path: str, handle: int) -> Hashable | None:
    """Device and number of a file, where its name leads to for one that is not there yet; None for what is no file."""
    with suppress(OSError, ValueError):
        try:
            found = os.fstat(handle) if path == STREAM else os.stat(path)
        except FileNotFoundError:
            return os.path.realpath(path)
        return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None
    return None


def _shown(label: str, path: str) -> str:
    if path == STREAM:
        return "standard output" if label == "-o" else "standard input"
    return f"{label} {path}"
