"""Arrays out of an ``.npz`` archive that may be anything: nothing is unpickled, and nothing absurdly large is read."""

from __future__ import annotations

import os
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Collection, Sequence
from math import prod
from typing import IO, Any

import numpy as np

from piazzi.opening import opened
from piazzi.problem.checks import Array
from piazzi.text import nearest, printable

# An archive may hold this much, or this many times its own size if that is more: real measurements do not shrink further.
FREE_BYTES = 64 * 2**20
EXPANSION = 20
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, NotImplementedError, OverflowError, MemoryError)
_NO_HEADER = (ValueError, TypeError, SyntaxError, RecursionError, KeyError, tokenize.TokenError)


def read_arrays(path: str | os.PathLike[str], keys: Sequence[str], required: Collection[str]) -> dict[str, Array]:
    """The arrays of these keys, those that are there; others in the archive are left alone.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where it is not an archive of plain numeric arrays, lacks a required key, or would take absurdly much memory.
    """
    name = os.fspath(path)
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        try:
            with zipfile.ZipFile(file) as archive:
                return _arrays(archive, keys, required, max(FREE_BYTES, EXPANSION * size))
        except _DAMAGE as error:
            what = "is empty" if not size else f"is not a whole .npz archive ({_one_line(error)})"
            raise ValueError(f"{name}: the file {what}") from None
        except ValueError as error:
            raise ValueError(f"{name}: {_one_line(error)}") from None


def _arrays(archive: zipfile.ZipFile, keys: Sequence[str], required: Collection[str], limit: int) -> dict[str, Array]:
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist() if info.filename.endswith(".npy")}
    for key in keys:
        if key in required and key not in members:
            raise ValueError(f"there is no key {key!r}{nearest(key, sorted(members)[:20])}")
    wanted = {key: members[key] for key in keys if key in members}
    total = sum(info.file_size for info in wanted.values())
    if total > limit:
        raise ValueError(f"its arrays would take {total:,} bytes, absurd for an archive of this size (limit {limit:,})")
    return {key: _array(archive, info, key) for key, info in wanted.items()}


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, key: str) -> Array:
    """One member, after its header has been found to be of numbers and to declare as many bytes as there are."""
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"key {key!r} is compressed in a way that .npz files are not (method {info.compress_type})")
    with archive.open(info) as stream:
        dtype, shape = _header(stream, key)
        if dtype.hasobject:
            raise ValueError(f"key {key!r} holds Python objects (pickled), which are never loaded")
        if dtype.kind not in "biuf":
            raise ValueError(f"key {key!r} is not made of real numbers: it has type {str(dtype)[:60]}")
        held = info.file_size - stream.tell()
        if prod(shape) * dtype.itemsize != held:
            raise ValueError(f"key {key!r} declares shape {str(shape)[:60]} but holds {held:,} bytes of data")
    with archive.open(info) as stream:
        out: Array = np.lib.format.read_array(stream, allow_pickle=False)
    return out


def _header(stream: IO[bytes], key: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
    try:
        version = np.lib.format.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"unknown version {version}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # files written by Python 2 are fine
            shape, _, dtype = _HEADERS[version](stream)
    except _NO_HEADER as error:
        raise ValueError(f"key {key!r} is not an array: {_one_line(error)}") from None
    if any(s < 0 for s in shape):
        raise ValueError(f"key {key!r} declares shape {str(shape)[:60]}")
    return dtype, shape


def _one_line(error: BaseException) -> str:
    """The first line of an error's text, or its kind."""
    text = (str(error.args[0] if error.args and isinstance(error.args[0], str) else error).splitlines() or [""])[0][:200]
    return printable(text) or type(error).__name__
