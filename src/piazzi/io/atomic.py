"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary name in the folder of `path`, moved to `path` when the block ends well, and removed when it does not.

    A link is followed; a device (/dev/null) is written to, not replaced; a pipe is refused, because nobody may read it.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    check_writable(path)
    special = _is_special(path)
    target = Path(path if special else os.path.realpath(path))
    work = _temporary(target) if special else _beside(target)
    try:
        with _told(path, work):
            yield work
            if special:
                with open(work, "rb") as source, open(target, "wb") as sink:
                    shutil.copyfileobj(source, sink)
            else:
                _settle(work, target)
    finally:
        with suppress(FileNotFoundError):
            work.unlink()


@contextmanager
def _told(path: str | os.PathLike[str], work: Path) -> Iterator[None]:
    """What the system refuses of the temporary file, with the name that was asked for."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, work, os.fspath(work)):
            raise
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


def sweep(path: str | os.PathLike[str]) -> None:
    """Remove what writers of `path` left behind that were killed; only for who knows that nobody else is writing it."""
    target = Path(os.path.realpath(path))
    name = re.compile(re.escape(f".{target.stem[:40]}-") + r"[a-z0-9_]{8}" + re.escape(target.suffix[-40:]))
    for leftover in target.parent.glob(".*"):
        if name.fullmatch(leftover.name):
            with suppress(OSError):
                leftover.unlink()


def check_writable(path: str | os.PathLike[str]) -> None:
    """Return nothing if a file can be written at `path`; raise OSError, saying why, if not.  Nothing is changed."""
    name, target = os.fspath(path), Path(os.path.realpath(path))
    if _is_special(path):
        if stat.S_ISFIFO(os.stat(path).st_mode) or stat.S_ISSOCK(os.stat(path).st_mode):
            raise OSError(f"cannot write {name}: it is a pipe, not a file")
        if not os.access(path, os.W_OK):
            raise PermissionError(f"cannot write {name}: no permission")
    elif target.is_dir() or not target.name:
        raise IsADirectoryError(f"cannot write {name}: it is a folder")
    elif not target.parent.is_dir():
        raise FileNotFoundError(f"cannot write {name}: there is no folder {target.parent}")
    elif not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"cannot write {name}: no permission to write in {target.parent}")


def _is_special(path: str | os.PathLike[str]) -> bool:
    """Whether there is something that is neither a file nor a folder."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def _temporary(target: Path) -> Path:
    """A new, private file with the same ending."""
    handle, name = tempfile.mkstemp(suffix=target.suffix[-40:])
    os.close(handle)
    return Path(name)


def _beside(target: Path) -> Path:
    """A new file in the same folder: private if it is to replace one, else with the permissions of all new files there.

    It gets those by being opened as any file is: to ask for the mask is to change it for a moment, in all threads.
    """
    mode = 0o600 if target.exists() else 0o666
    while True:
        work = target.with_name(f".{target.stem[:40]}-{os.urandom(4).hex()}{target.suffix[-40:]}")
        with suppress(FileExistsError):
            os.close(os.open(work, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
            return work


def _settle(work: Path, target: Path) -> None:
    """Give the finished file the permissions of the one it replaces, if it does, and move it there."""
    if target.exists():
        os.chmod(work, stat.S_IMODE(target.stat().st_mode))
    with open(work, "rb+") as file:
        os.fsync(file.fileno())
    os.replace(work, target)
