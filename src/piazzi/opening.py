"""Files that are read: whatever has the name of one and is none, such as a pipe, would never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

_PACKAGE = os.path.join(os.path.dirname(__file__), "")


class RecordingWarning(UserWarning):
    """What was put right in a recording, or taken to mean something."""


def told_path(path: str | os.PathLike[str]) -> str:
    """A file as messages and results name it: one of the package by the name that it goes by there."""
    text = os.fspath(path)
    return Path(text).stem if text.startswith(_PACKAGE) else text


def opened(path: str | os.PathLike[str]) -> BinaryIO:
    """A file, open for reading; raises OSError where it cannot be, or is a pipe or a device, behind links or not."""
    # a pipe that nobody writes to would make the call itself wait
    file = open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0)))  # noqa: SIM115
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise OSError(errno.EINVAL, "is a pipe or a device; only files are read", os.fspath(path))
