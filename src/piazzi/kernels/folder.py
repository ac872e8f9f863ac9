"""Where compiled kernels may be kept: a folder that nobody else can write to, because what is in it is executed.

It is opened once, and all that is read comes through what was opened, so that another folder of the same name is not the same.
"""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from piazzi.kernels.ownership import check_ours, check_way
from piazzi.locks import lock

_THROUGH_HANDLES = {os.open, os.mkdir, os.rename, os.unlink} <= os.supports_dir_fd and hasattr(os, "O_NOFOLLOW")
_FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_FILE = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


@dataclass(frozen=True, eq=False)
class Folder:
    """A folder of ours.  Every method raises OSError, and refuses what belongs to others or is theirs to write.

    Attributes
    ----------
    path : where it was when it was opened
    handle : what it is read through; None on systems that open by names only
    """

    path: Path
    handle: int | None = None

    @classmethod
    def of(cls, path: Path) -> Folder:
        """The folder at a path, which is no link."""
        return _opened(path, path, None)

    @contextmanager
    def inside(self, name: str) -> Iterator[Folder]:
        """A folder in this one."""
        found = _opened(self._at(name), self.path / name, self.handle)
        try:
            yield found
        finally:
            found._close()

    @contextmanager
    def new(self, prefix: str) -> Iterator[tuple[str, Folder]]:
        """A new folder in here, with its name; it is in use until the block ends."""
        name, made = self._made(prefix)
        try:
            yield name, made
        finally:
            made._close()

    def hold(self, wait: bool) -> bool:
        """Mark this folder as in use for as long as it is open; False where a living process has done so, or it is gone.

        Where there are no locks, all are in use.
        """
        locked = self.handle is not None and lock(self.handle, wait)
        return (locked or wait) and (self.handle is None or os.fstat(self.handle).st_nlink > 0)

    def read(self, name: str) -> bytes:
        """The content of a file."""
        with open(os.open(self._at(name), _FILE, dir_fd=self.handle), "rb") as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise OSError(f"{self.path / name} is not a file")
            check_ours(found, self.path / name)
            return file.read()

    def write(self, name: str, content: bytes) -> None:
        """Make a file."""
        with open(os.open(self._at(name), _NEW, 0o600, dir_fd=self.handle), "wb") as file:
            file.write(content)

    def make(self, name: str) -> None:
        """Make a folder."""
        os.mkdir(self._at(name), 0o700, dir_fd=self.handle)

    def rename(self, name: str, new: str) -> None:
        """Move what is in here; raises OSError where the place is taken."""
        os.rename(self._at(name), self._at(new), src_dir_fd=self.handle, dst_dir_fd=self.handle)

    def remove(self, name: str) -> None:
        """Remove a file, or a folder with all that is in it, as far as that can be done."""
        with suppress(OSError):
            os.unlink(self._at(name), dir_fd=self.handle)
        shutil.rmtree(self._at(name), ignore_errors=True, dir_fd=self.handle)

    def ages(self) -> dict[str, float]:
        """When each of the things in here was last written to, s."""
        with os.scandir(self.path if self.handle is None else self.handle) as found:
            return {entry.name: entry.stat(follow_symlinks=False).st_mtime for entry in found}

    def _made(self, prefix: str) -> tuple[str, Folder]:
        while True:
            name = f"{prefix}{os.urandom(4).hex()}"
            self.make(name)
            with suppress(FileNotFoundError):  # removed as one of a dead process, before it was locked
                made = _opened(self._at(name), self.path / name, self.handle)
                if made.hold(wait=True):
                    return name, made
                made._close()

    def _close(self) -> None:
        if self.handle is not None:
            os.close(self.handle)

    def _at(self, name: str) -> str:
        return os.fspath(self.path / name) if self.handle is None else name


def _opened(name: str | Path, path: Path, above: int | None) -> Folder:
    if not _THROUGH_HANDLES:
        found = os.lstat(path)
        if not stat.S_ISDIR(found.st_mode):
            raise NotADirectoryError(f"{path} is not a folder")
        check_ours(found, path)
        return Folder(path)
    handle = os.open(name, _FOLDER, dir_fd=above)
    try:
        check_ours(os.fstat(handle), path)
    except OSError:
        os.close(handle)
        raise
    return Folder(path, handle)


@cache
def private_folder() -> tuple[Folder | None, str]:
    """The folder of finished kernels, or None and why there is none.

    It is PIAZZI_CACHE, else XDG_CACHE_HOME/piazzi, else ~/.cache/piazzi.
    """
    try:
        named = os.environ.get("PIAZZI_CACHE")
        place = Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "piazzi"
        place = place.absolute()
        check_way(place)  # before anything is made there: root leaves no folders in the homes of users
        for missing in reversed([p for p in (place, *place.parents) if not os.path.lexists(p)]):
            missing.mkdir(mode=0o700, exist_ok=True)
        check_way(place)
        return Folder.of(place.resolve(strict=True)), ""
    except (OSError, RuntimeError) as error:
        return None, str(error)


@cache
def writable_folder() -> Folder | None:
    """Where new kernels go: the private folder, or nowhere, with one warning, where that cannot be written to."""
    place, reason = private_folder()
    if place is not None:
        try:
            with tempfile.TemporaryFile(dir=place.path):
                return place
        except OSError as error:
            reason = str(error)
    warnings.warn(
        f"no private, writable folder for compiled kernels ({reason}); every run compiles them anew. Set PIAZZI_CACHE.",
        stacklevel=2,
    )
    return None
