"""Where compiled kernels may be kept: a folder that nobody else can write to, because what is in it is executed."""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
import warnings
from functools import cache
from pathlib import Path


@cache
def private_folder() -> tuple[Path | None, str]:
    """The folder of finished kernels, or None and why there is none.

    It is PIAZZI_CACHE, else XDG_CACHE_HOME/piazzi, else ~/.cache/piazzi.
    """
    try:
        named = os.environ.get("PIAZZI_CACHE")
        place = Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "piazzi"
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        _check_private(place)
        return place.absolute(), ""
    except (OSError, RuntimeError) as error:
        return None, str(error)


@cache
def writable_folder() -> Path:
    """Where new kernels go: the private folder, or a temporary one, with one warning, where that cannot be written to."""
    place, reason = private_folder()
    if place is not None:
        try:
            with tempfile.TemporaryFile(dir=place):
                return place
        except OSError as error:
            reason = str(error)
    temporary = Path(tempfile.mkdtemp(prefix="piazzi-cache-"))
    atexit.register(shutil.rmtree, temporary, True)
    warnings.warn(
        f"no private, writable folder for compiled kernels ({reason}); compiling into a temporary one. Set PIAZZI_CACHE.",
        stacklevel=2,
    )
    return temporary


def _check_private(place: Path) -> None:
    """Raise unless the folder, and the link to it if it is one, are ours alone to write."""
    if not hasattr(os, "geteuid"):
        return
    target = place.stat()
    if {target.st_uid, place.lstat().st_uid} != {os.geteuid()}:
        raise OSError(f"{place} belongs to another user")
    mode = stat.S_IMODE(target.st_mode)
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise OSError(f"others can write to {place}: its mode is {mode:o}; chmod go-w mends that")
