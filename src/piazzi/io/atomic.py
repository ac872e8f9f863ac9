"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary name in the folder of `path`, moved to `path` when the block ends well, and removed when it does not.

    A link is followed; what is no regular file (a pipe, /dev/null) is written to and not replaced.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    target = Path(os.path.realpath(path))
    check_writable(target)
    special = target.exists() and not target.is_file()
    folder = None if special else target.parent
    handle, name = tempfile.mkstemp(prefix=f".{target.stem[:40]}-", suffix=target.suffix, dir=folder)
    os.close(handle)
    work = Path(name)
    try:
        yield work
        if special:
            with open(work, "rb") as source, open(target, "wb") as sink:
                shutil.copyfileobj(source, sink)
        else:
            _settle(work, target)
    finally:
        with suppress(FileNotFoundError):
            work.unlink()


def check_writable(path: str | os.PathLike[str]) -> None:
    """Return nothing if a file can be written at `path`; raise OSError, saying why, if not.  Nothing is changed."""
    target = Path(os.path.realpath(path))
    name = os.fspath(path)
    if target.is_dir():
        raise IsADirectoryError(f"cannot write {name}: it is a folder")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write {name}: there is no folder {target.parent}")
    special = target.exists() and not target.is_file()
    if not os.access(target if special else target.parent, os.W_OK):
        raise PermissionError(f"cannot write {name}: no permission to write {'to it' if special else f'in {target.parent}'}")


def _settle(work: Path, target: Path) -> None:
    """Give the finished file the permissions of the one it replaces, or the usual ones, and move it there."""
    if target.exists():
        mode = stat.S_IMODE(target.stat().st_mode)
    else:
        mask = os.umask(0)
        os.umask(mask)
        mode = 0o666 & ~mask
    os.chmod(work, mode)
    with open(work, "rb+") as file:
        os.fsync(file.fileno())
    os.replace(work, target)
