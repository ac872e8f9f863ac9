"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

from piazzi.locks import lock


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary name in the folder of `path`, moved to `path` when the block ends well, and removed when it does not.

    A link is followed; a device (/dev/null) is written to, not replaced; a pipe is refused, because nobody may read it.  Owner
    and permissions of the file that is replaced stay; one with other hard links, or of an owner that the new one cannot be
    given, is written into in place.  What killed writers of `path` left behind goes.

    Raises
    ------
    OSError
        Where nothing can be written there.
    """
    check_writable(path)
    special = _is_special(path)
    target = Path(path if special else os.path.realpath(path))
    if not special:
        _remove_leftovers(str(target), os.getpid())
    work, handle = _temporary(target) if special else _temporary_beside(target)
    try:
        with _naming(path, work):
            yield work
            if special:
                with open(work, "rb") as source, open(target, "wb") as sink:
                    shutil.copyfileobj(source, sink)
            else:
                _replace(work, target)
    finally:
        with suppress(FileNotFoundError):
            work.unlink()
        if handle is not None:
            os.close(handle)  # with its lock


@contextmanager
def _naming(path: str | os.PathLike[str], work: Path) -> Iterator[None]:
    """What the system refuses of the temporary file, with the name that was asked for."""
    try:
        yield
    except OSError as error:
        if error.errno is None or error.filename not in (None, work, os.fspath(work)):
            raise
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error


@lru_cache(maxsize=1000)
def _remove_leftovers(path: str, process: int) -> None:
    """Remove what killed writers of `path` left behind, once in a process: files of ours that no living process has locked."""
    target = Path(path)
    name = re.compile(re.escape(_prefix(target)) + r"[0-9a-f]{8}" + re.escape(target.suffix[-40:]))
    with suppress(OSError), os.scandir(target.parent) as found:
        for leftover in [entry.path for entry in found if entry.name.startswith(".") and name.fullmatch(entry.name)]:
            with suppress(OSError):
                _remove_dead(leftover)


def _remove_dead(leftover: str) -> None:
    """Remove a temporary file that nobody is writing."""
    handle = os.open(leftover, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    try:
        if lock(handle, wait=False) and os.fstat(handle).st_uid == os.geteuid():
            os.unlink(leftover)  # while it is locked: who has just made it finds it gone, and makes another
    finally:
        os.close(handle)


def sync_folder(path: str | os.PathLike[str]) -> None:
    """Make a new name survive a power failure, where the system can."""
    with suppress(OSError, AttributeError):
        folder = os.open(Path(path).parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


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
    elif target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"cannot write {name}: it is read-only")
    elif not os.access(target.parent, os.W_OK | os.X_OK):
        raise PermissionError(f"cannot write {name}: no permission to write in {target.parent}")


def _is_special(path: str | os.PathLike[str]) -> bool:
    """Whether there is something that is neither a file nor a folder."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def _prefix(target: Path) -> str:
    """How the names of temporary files beside a file begin: as nobody else's do."""
    return f".{target.stem[:40]}.piazzi-"


def _temporary(target: Path) -> tuple[Path, None]:
    """A new, private file with the same ending."""
    handle, name = tempfile.mkstemp(suffix=target.suffix[-40:])
    os.close(handle)
    return Path(name), None


def _temporary_beside(target: Path) -> tuple[Path, int | None]:
    """A new file in the same folder: private if it is to replace one, else with the permissions of all new files there.

    It gets those by being opened as any file is: to ask for the mask is to change it for a moment, in all threads.  The handle
    has it locked for as long as it is open, which says that this process lives; None where there are no such locks.
    """
    mode = 0o600 if target.exists() else 0o666
    while True:
        work = target.with_name(f"{_prefix(target)}{os.urandom(4).hex()}{target.suffix[-40:]}")
        with suppress(FileExistsError):
            handle = os.open(work, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode)
            if not lock(handle, wait=True):
                os.close(handle)
                return work, None
            if os.fstat(handle).st_nlink:
                return work, handle
            os.close(handle)  # removed as one of a dead process, before it was locked


def _replace(work: Path, target: Path) -> None:
    """Put the finished file in the place of the one that it replaces, if it does, with its owner, permissions and links."""
    with open(work, "rb+") as file:
        os.fsync(file.fileno())
    old = target.stat() if target.exists() else None
    if old is not None and not (old.st_nlink == 1 and _copy_owner(work, old)):
        _write_through(work, target)
        return
    os.replace(work, target)
    sync_folder(target)


def _copy_owner(work: Path, old: os.stat_result) -> bool:
    """Give a file the owner and the permissions of another, but no rights to run as its owner; whether that can be done."""
    new = work.stat()
    try:
        if (new.st_uid, new.st_gid) != (old.st_uid, old.st_gid):
            os.chown(work, old.st_uid, old.st_gid)
    except (OSError, AttributeError):
        return False
    os.chmod(work, old.st_mode & 0o777)
    return True


def _write_through(work: Path, target: Path) -> None:
    """Copy the finished file into the other one, after room for it was made: it has names or an owner of its own."""
    with open(work, "rb") as source, open(target, "r+b") as sink:
        size, old = os.fstat(source.fileno()).st_size, os.fstat(sink.fileno())
        try:
            if size > old.st_size and hasattr(os, "posix_fallocate"):
                os.posix_fallocate(sink.fileno(), 0, size)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT):
                sink.truncate(old.st_size)
                raise
        if old.st_mode & 0o7000:
            os.chmod(target, old.st_mode & 0o777)
        shutil.copyfileobj(source, sink)
        sink.truncate()
        sink.flush()
        os.fsync(sink.fileno())
