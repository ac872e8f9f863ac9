"""Where the estimates of a stream go, line by line: standard output, or a file that goes on where a checkpoint stands."""

from __future__ import annotations

import os
import stat
import sys
from contextlib import suppress
from typing import IO

from piazzi.io.atomic import sync_folder

STDOUT = "-"


class Sink:
    """Lines out.  A file is left alone until the first of them, or until `begin`: then it is cut back to what is known of it.

    Attributes
    ----------
    written : bytes, those of earlier runs that are kept included
    """

    def __init__(self, path: str | None, known: int = 0) -> None:
        """Raise ValueError where less is in the file than is known of it."""
        self.written, self._path, self._file = known, None if path == STDOUT else path, None
        if self._path is not None:
            with suppress(FileNotFoundError):
                found = os.stat(self._path)
                self._check(found.st_size if stat.S_ISREG(found.st_mode) else known)
                return
            self._check(0)

    _file: IO[bytes] | None

    def begin(self) -> None:
        """Open the file and cut it back; nothing where that is done."""
        if self._file is None:
            self._file = sys.stdout.buffer if self._path is None else self._opened(self._path)

    def emit(self, text: str) -> None:
        """Write a line, at once."""
        self.begin()
        assert self._file is not None
        data = (text + "\n").encode()
        self._file.write(data)
        self._file.flush()
        self.written += len(data)

    def sync(self) -> None:
        """Return when everything is on disk, if it goes into a file."""
        if self._file is not None and self._path is not None and stat.S_ISREG(os.fstat(self._file.fileno()).st_mode):
            os.fsync(self._file.fileno())

    def close(self) -> None:
        if self._file is not None and self._path is not None:
            self._file.close()

    def _opened(self, path: str) -> IO[bytes]:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        file: IO[bytes] = open(handle, "r+b")  # noqa: SIM115 (`close` closes it)
        found = os.fstat(file.fileno())
        if stat.S_ISREG(found.st_mode):
            self._check(found.st_size)
            file.truncate(self.written)
            file.seek(0, os.SEEK_END)
            sync_folder(path)
        return file

    def _check(self, size: int) -> None:
        if size < self.written:
            raise ValueError(
                f"{self._path}: it has {size:,} bytes, but {self.written:,} were written before the checkpoint was made: put "
                "them back, or begin anew without the checkpoint"
            )
