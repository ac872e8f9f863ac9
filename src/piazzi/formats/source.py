"""Text of a file as it lies: packed by gzip or compress or not at all, and never more than a machine holds."""

from __future__ import annotations

import os
import zlib

from piazzi.formats.lzw import unpacked
from piazzi.opening import opened

FREE_BYTES = 2**28  # a file may unpack to this much, or to so many times its own size if that is more
EXPANSION = 100


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Contents of a file, unpacked where its first bytes say that it is packed (gzip, or ``.Z`` of compress).

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError
        Where a packed file is damaged, or would take absurdly much memory.
    """
    with opened(path) as file:
        data = file.read()
    limit = max(FREE_BYTES, EXPANSION * len(data))
    try:
        if data[:2] == b"\x1f\x8b":
            return _gunzipped(data, limit)
        if data[:2] == b"\x1f\x9d":
            return unpacked(data, limit)
    except (zlib.error, EOFError, ValueError) as error:
        raise ValueError(f"{os.fspath(path)}: the file is packed, and damaged ({str(error)[:100]})") from None
    return data


def plain_lines(data: bytes) -> bytes:
    """The same text without a mark of byte order, its lines ended by line feeds alone."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    return data if b"\r" not in data else data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _gunzipped(data: bytes, limit: int) -> bytes:
    out = bytearray()
    while data:
        member = zlib.decompressobj(wbits=31)
        out += member.decompress(data, limit + 1 - len(out))
        if len(out) > limit:
            raise ValueError(f"it unpacks to more than {limit:,} bytes")
        if not member.eof:
            raise ValueError("it ends too early")
        data = member.unused_data.lstrip(b"\0")
    return bytes(out)
