"""Downloads of data: whole, checked by the reader that will read them, and in place all at once or not at all."""

from __future__ import annotations

import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from pathlib import Path

from piazzi.io.atomic import atomic_path

TIMEOUT = 60.0  # s, without a byte
_PIECE = 1 << 20


def download(address: str, path: Path, check: Callable[[Path], object]) -> int:
    """Bytes of a file fetched from an address to a path, once `check`, which raises ValueError, has read it.

    Raises
    ------
    ValueError
        Where the address is no http or https, the answer is an error or is cut short, or the file is not what is wanted.
    OSError
        Where nothing can be written.
    """
    parts = urllib.parse.urlsplit(address)
    if parts.scheme not in ("http", "https") or not parts.netloc:
        raise ValueError(f"address {address!r}: only http and https are fetched")
    with atomic_path(path) as work:
        try:
            count = _fetch(address, work)
        except urllib.error.HTTPError as error:
            raise ValueError(f"{address}: the server answered {error.code} {error.reason}") from None
        except (urllib.error.URLError, TimeoutError, ConnectionError) as error:
            reason = error.reason if isinstance(error, urllib.error.URLError) else error
            raise ValueError(f"{address}: {str(reason) or 'no answer'}") from None
        try:
            check(work)
        except ValueError as error:
            text = str(error).replace(work.name, path.name)
            raise ValueError(f"{address}: not taken, because it is not what it should be: {text}") from None
    return count


def _fetch(address: str, work: Path) -> int:
    import http.client

    request = urllib.request.Request(address, headers={"User-Agent": "piazzi", "Accept-Encoding": "identity"})
    with urllib.request.urlopen(request, timeout=TIMEOUT) as answer, open(work, "wb") as sink:
        promised = answer.headers.get("Content-Length")
        count = 0
        try:
            while piece := answer.read(_PIECE):
                count += sink.write(piece)
        except http.client.IncompleteRead as error:
            count += len(error.partial)
    if promised is not None and count != int(promised):
        raise ValueError(f"{address}: cut short, {count:,} of {int(promised):,} bytes came")
    return count
