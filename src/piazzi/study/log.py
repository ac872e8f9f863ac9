"""Finished pieces on disk while a study runs: one file that only grows, each record whole or not there at all."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import stat
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from piazzi.io.atomic import sync_folder
from piazzi.study.schema import check_record
from piazzi.study.tasks import Piece, Task

LOGGER = logging.getLogger("piazzi.study")
ENDING = ".runs"
_MAGIC = b"PZRUNS1\n"
_HEAD = struct.Struct("<8sQ32s")  # magic, length of what follows, its SHA-256
_LONGEST, _LONGEST_HEADER, _PART = 2**34, 2**30, 2**20
_LOCKED_BYTE = 2**31 - 2  # Windows keeps others from the bytes that are locked, and locks none behind this one


Check = Callable[[Mapping[str, Any]], None]  # of the header of a record; raises ValueError


@dataclass(frozen=True)
class Entry:
    """Where a piece is in the file."""

    task: Task
    offset: int


class _Record(NamedTuple):
    """A whole record: what it says, its bytes where they were asked for, and how many they are."""

    header: dict[str, Any]
    body: bytes
    size: int


class Log:
    """The file, open for reading and appending; only one process at a time can have it open."""

    def __init__(self, path: Path, file: IO[bytes], specification: dict[str, Any], entries: list[Entry]) -> None:
        self.path, self._file, self.specification, self.entries = path, file, specification, entries

    @classmethod
    def create(cls, path: Path, specification: dict[str, Any]) -> Log:
        """A new, empty one; raises OSError (FileExistsError where there is one)."""
        file = open(path, "x+b", buffering=0)  # noqa: SIM115
        try:
            _lock(file, path)
            log = cls(path, file, specification, [])
            log._append_bytes(_record({"specification": specification}, b""))
        except BaseException:
            file.close()
            with suppress(OSError):
                path.unlink()
            raise
        sync_folder(path)
        return log

    @classmethod
    def open(cls, path: Path, checks: Callable[[dict[str, Any]], Check] | None = None) -> Log:
        """What there is, without damaged records and the tail that a sudden end left behind.

        Parameters
        ----------
        checks : is given the specification before anything is changed, and says what a record has to be; a ValueError of
            its own refuses the file

        Raises
        ------
        OSError, ValueError
            The second for another file, and where another process runs this study.
        """
        file = open(path, "r+b", buffering=0)  # noqa: SIM115
        try:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise ValueError(f"{path}: it is a pipe or a device, not a file")
            _lock(file, path)
            return cls._scan(path, file, checks)
        except BaseException:
            file.close()
            raise

    @classmethod
    def _scan(cls, path: Path, file: IO[bytes], checks: Callable[[dict[str, Any]], Check] | None) -> Log:
        first = _read(file)
        specification = None if first is None else first.header.get("specification")
        if not isinstance(specification, dict):
            raise ValueError(f"{path}: no runs of a study are in this file")
        check = None if checks is None else checks(specification)
        entries, end, damaged = list[Entry](), file.tell(), 0
        while True:
            found = _read(file, body=False)
            if found is None:
                behind = _next_record(file, end)
                if behind is None:
                    damaged += not _is_incomplete(file, end)
                    break
                damaged += 1
                end = file.seek(behind)  # its runs are missing, so they are computed again
                continue
            try:
                check_record(found.header, found.size)
                if check is not None:
                    check(found.header)
            except ValueError as error:
                LOGGER.debug("%s, byte %d: %s", path, end, error)
                damaged, end = damaged + 1, file.tell()
                continue
            entries.append(Entry(Task(*found.header["task"]), end))
            end = file.tell()
        if damaged:
            _keep_copy(path, damaged, sum(entry.task.count for entry in entries))
        if os.fstat(file.fileno()).st_size > end:
            file.truncate(end)
        return cls(path, file, specification, entries)

    def append(self, piece: Piece) -> None:
        """Add a piece, on disk when this returns.

        Raises
        ------
        OSError
            Where it cannot be written; what was there before stays as it was.
        """
        offset = self._file.seek(0, os.SEEK_END)
        self._append_bytes(_packed(piece))
        self.entries.append(Entry(piece.task, offset))

    def read(self, entry: Entry) -> Piece:
        """A piece; raises ValueError where it was damaged meanwhile."""
        self._file.seek(entry.offset)
        found = _read(self._file)
        if found is None:
            raise ValueError(f"{self.path}: the runs at byte {entry.offset} were damaged")
        return _unpacked(found.header, found.body)

    def pieces(self) -> Iterator[Piece]:
        """All pieces, one at a time, in the order of points and runs, whatever the order in which they were finished."""
        for entry in sorted(self.entries, key=lambda entry: (entry.task.point, entry.task.first)):
            yield self.read(entry)

    def close(self) -> None:
        self._file.close()

    def remove(self) -> None:
        """Close and delete."""
        try:  # while it is locked, where the system removes files that are open; Windows does not
            self.path.unlink(missing_ok=True)
        except PermissionError:
            self._file.close()
            self.path.unlink(missing_ok=True)
        self._file.close()

    def _append_bytes(self, data: bytes) -> None:
        start = self._file.seek(0, os.SEEK_END)
        try:
            view = memoryview(data)
            while view:
                view = view[self._file.write(view) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(start)
            raise OSError(error.errno, error.strerror, str(self.path)) from error


def _record(header: dict[str, Any], body: bytes) -> bytes:
    text = json.dumps(header).encode()
    payload = struct.pack("<Q", len(text)) + text + body
    return _HEAD.pack(_MAGIC, len(payload), hashlib.sha256(payload).digest()) + payload


def _read(file: IO[bytes], body: bool = True) -> _Record | None:
    """The next record, with its body where that is wanted; None where there is no whole one.

    It is read in parts: a file with holes can declare what no memory holds.
    """
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    magic, length, digest = _HEAD.unpack(head)
    if magic != _MAGIC or not 8 <= length <= _LONGEST or length > os.fstat(file.fileno()).st_size - file.tell():
        return None
    start = file.read(8)
    (size,) = struct.unpack("<Q", start)
    if size > min(length - 8, _LONGEST_HEADER):
        return None
    behind = left = length - 8 - size
    text, parts = file.read(size), list[bytes]()
    checksum = hashlib.sha256(start + text)
    while left > 0 and (part := file.read(min(left, _PART))):
        checksum.update(part)
        left -= len(part)
        parts += [part] * body
    if checksum.digest() != digest:
        return None
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return _Record(header if isinstance(header, dict) else {}, b"".join(parts), behind)


def _next_record(file: IO[bytes], start: int) -> int | None:
    """Where the next whole record after a damaged one at `start` begins; None where there is none.

    What is damaged may be its length, so the next one is looked for by its first bytes.
    """
    at = start + 1
    while True:
        file.seek(at)
        window = file.read(_PART + len(_MAGIC))
        found = window.find(_MAGIC)
        if found < 0:
            if len(window) <= _PART:
                return None
            at += _PART
            continue
        file.seek(at + found)
        if _read(file, body=False) is not None:
            return file.seek(at + found)
        at += found + 1


def _is_incomplete(file: IO[bytes], start: int) -> bool:
    """Whether what is left from `start` on is a record that was not written to its end, or nothing at all."""
    file.seek(start)
    head, left = file.read(_HEAD.size), os.fstat(file.fileno()).st_size - start
    if len(head) < _HEAD.size:
        return _MAGIC.startswith(head[: len(_MAGIC)]) or not any(head)
    magic, length, _ = _HEAD.unpack(head)
    return not any(head) or (magic == _MAGIC and length > left - _HEAD.size)


def _keep_copy(path: Path, damaged: int, kept: int) -> None:
    """A copy of a damaged file beside it, before its runs are computed again, and a line that says so."""
    copy = path.with_name(path.name + ".damaged")
    try:
        shutil.copyfile(path, copy)
        kept_at = f"copy: {copy.name}"
    except OSError as error:
        kept_at = f"no copy could be made: {error.strerror}"
    records = f"{damaged} record{'s' * (damaged > 1)}"
    text = f"{path}: {records} damaged; {kept} runs are whole, the others are computed again ({kept_at})"
    warnings.warn(text, stacklevel=2)


def _packed(piece: Piece) -> bytes:
    arrays = {name: np.ascontiguousarray(a) for name, a in piece.arrays.items()}
    header = {
        "task": [piece.task.point, piece.task.first, piece.task.count],
        "arrays": [[name, a.dtype.str, list(a.shape)] for name, a in arrays.items()],
        "messages": [list(m) for m in piece.messages],
    }
    return _record(header, b"".join(a.tobytes() for a in arrays.values()))


def _unpacked(header: dict[str, Any], body: bytes) -> Piece:
    arrays, at = {}, 0
    for name, kind, shape in header["arrays"]:
        count = int(np.prod(shape, dtype=np.int64))
        arrays[name] = np.frombuffer(body, np.dtype(kind), count, at).reshape(shape)
        at += arrays[name].nbytes
    return Piece(Task(*header["task"]), arrays, tuple((row, run, text) for row, run, text in header["messages"]))


def _lock(file: IO[bytes], path: Path) -> None:
    """Keep other processes out for as long as the file is open, where the system can."""
    try:
        _lock_exclusively(file)
    except (BlockingIOError, PermissionError):
        raise ValueError(f"{path}: another process is running this study") from None
    except (ImportError, OSError):
        return  # a system or a file system without locks


def _lock_exclusively(file: IO[bytes]) -> None:
    """Raise BlockingIOError, on Windows PermissionError, where another process has the lock."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        windows: Any = msvcrt
        file.seek(_LOCKED_BYTE)
        try:
            windows.locking(file.fileno(), windows.LK_NBLCK, 1)
        finally:
            file.seek(0)
        return
    fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
